"""Levels that no sweep climbs are told: a step along the sweeps looks like an instrument that moved between them."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray, Trace
from mapping.base import LaidTrace, fit_base
from mapping.detection import detect
from mapping.estimate.deviation import UnclimbedLevel, unclimbed_levels
from mapping.geometry.templates import step_height

TIP, HEIGHT, LINES, PITCH = 2e-3, 0.4e-3, 20, 1e-3


def told(across: bool, heights: FloatArray) -> list[UnclimbedLevel]:
    """What a raster of lines along x, or across, tells of what lies along x at half its width."""
    u = np.arange(0.0, 40e-3, 0.1e-3)
    rng = np.random.default_rng(0)
    rows = []
    for k in range(LINES):
        along, beside = (u if k % 2 == 0 else u[::-1]), np.full(len(u), 2 * PITCH * k if across else PITCH * k)
        x, y = (beside, along) if across else (along, beside)
        z = step_height(y - 10e-3 - (10e-3 if across else 0.0), HEIGHT, TIP) * heights[0] + heights[1] * x
        rows.append(np.column_stack([x, y, z + TIP + rng.normal(0.0, 5e-6, len(u))]))
    centers = np.concatenate(rows)
    trace = Trace(np.arange(len(centers)) * 1e-3, centers, np.repeat(np.arange(LINES), len(u)), TIP)
    laid = LaidTrace.of(trace, fit_base(trace))
    detect(laid, laid.base)
    return unclimbed_levels(laid)


def test_a_step_along_the_sweeps_is_told_once_with_its_height_and_place() -> None:
    (level,) = told(across=False, heights=np.array([1.0, 0.0]))
    assert level.height == pytest.approx(HEIGHT, abs=3e-6)
    # the arc beside the edge is 1.2 mm wide: two lines stand on it
    assert level.before < 10 <= level.behind <= 11 and level.behind - level.before <= 3
    assert abs(level.place[1] - 10e-3) < 1.5e-3


@pytest.mark.parametrize("across, heights", [(True, (1.0, 0.0)), (False, (0.0, 0.0)), (False, (0.0, 0.05))])
def test_a_step_that_is_climbed_and_a_plain_plate_are_not(across: bool, heights: tuple[float, float]) -> None:
    assert told(across, np.array(heights)) == []


def test_levels_that_come_back_at_once_are_told_as_two() -> None:
    u, rng = np.arange(0.0, 40e-3, 0.1e-3), np.random.default_rng(0)
    rows = []
    for k in range(LINES):
        z = TIP - 0.2e-3 * (k in (9, 10)) + rng.normal(0.0, 5e-6, len(u))
        rows.append(np.column_stack([u, np.full(len(u), PITCH * k), z]))
    trace = Trace(np.arange(LINES * len(u)) * 1e-3, np.concatenate(rows), np.repeat(np.arange(LINES), len(u)), TIP)
    laid = LaidTrace.of(trace, fit_base(trace))
    detect(laid, laid.base)
    assert [level.height for level in unclimbed_levels(laid)] == pytest.approx([-0.2e-3, 0.2e-3], abs=3e-6)
