"""Lines that run along the sweeps of a raster: told where the other sweeps say that no offset is so large."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray
from mapping.assembly import AlongSweeps, along_sweeps
from mapping.base import LaidTrace, fit_base
from mapping.detection import detect
from mapping.inference.joint import refine_all
from mapping.trace import Trace

TIP, PITCH, ROWS, WHITE = 3e-3, 1e-3, 31, 10e-6


def found(heights: FloatArray, offsets: float = 0.0, part: float = 1.0) -> tuple[AlongSweeps | None, LaidTrace]:
    """What runs along the rows of a plate that stand at heights (ROWS,), over a part of their length; each has an
    offset of its own, m."""
    rng = np.random.default_rng(5)
    x = np.arange(0.0, 40e-3, 0.1e-3)
    centers = []
    for k in range(ROWS):
        way = x if k % 2 == 0 else x[::-1]
        z = TIP + heights[k] * (way <= part * x[-1]) + offsets * rng.standard_normal()
        centers.append(np.column_stack([way, np.full(len(x), k * PITCH), z + WHITE * rng.standard_normal(len(x))]))
    points = np.concatenate(centers)
    trace = Trace(1e-2 * np.arange(len(points)), points, np.repeat(np.arange(ROWS), len(x)), TIP)
    laid = LaidTrace(trace, fit_base(trace))
    return along_sweeps(laid, detect(laid, laid.base), 0.01), laid


def slot(width: float, depth: float) -> FloatArray:
    """(ROWS,) heights of a ball over a slot with upright walls, which rests on its floor or on the nearer rim."""
    inside = np.clip(0.5 * width - np.abs(PITCH * np.arange(ROWS) - 15.2e-3), 0.0, TIP)
    return -np.minimum(TIP - np.sqrt(TIP**2 - inside**2), depth)


def wire(diameter: float) -> FloatArray:
    """(ROWS,) heights of a ball over a wire."""
    around, aside = TIP + 0.5 * diameter, PITCH * np.arange(ROWS) - 15.2e-3
    over = np.sqrt(np.maximum(around**2 - aside**2, 0.0)) + 0.5 * diameter - TIP
    return np.maximum(over, 0.0)


def test_a_slot_between_the_rows_has_its_width_and_depth() -> None:
    along, laid = found(slot(6.5e-3, 0.3e-3))
    assert along is not None
    (groove,) = refine_all(along.features, along.trace, 0, base=laid.base, noise=along.noise, confirm=None)
    assert groove.kind == "groove" and groove.length.censored
    assert abs(groove.width.median - 6.5e-3) < 30e-6
    assert abs(groove.height.median + 0.3e-3) < 3e-6
    assert np.abs(groove.axis[:, 1] - 15.2e-3).max() < 0.1e-3
    assert any("along the sweeps" in note for note in groove.notes)


@pytest.mark.slow
def test_a_wire_along_the_rows_has_its_height() -> None:
    along, laid = found(wire(0.4e-3))
    assert along is not None
    (ridge,) = refine_all(along.features, along.trace, 0, base=laid.base, noise=along.noise, confirm=None)
    assert ridge.kind == "ridge"
    assert ridge.height.low < 0.4e-3 < ridge.height.high


def test_rows_that_the_instrument_puts_off_are_no_line() -> None:
    assert found(np.zeros(ROWS), offsets=30e-6)[0] is None
    assert found(slot(6.5e-3, 0.05e-3), offsets=30e-6)[0] is None


def test_what_jumps_higher_than_a_ball_climbs_between_two_rows_is_no_line() -> None:
    heights = np.zeros(ROWS)
    heights[12:18] = 0.3e-3  # the ball rolls 1.3 mm to get there
    assert found(heights)[0] is None


def test_a_step_that_does_not_come_back_is_no_line() -> None:
    heights = np.where(np.arange(ROWS) < 15, 0.0, 0.1e-3)
    assert found(heights)[0] is None


def test_what_ends_within_the_rows_is_left_to_them() -> None:
    assert found(slot(6.5e-3, 0.3e-3), part=0.5)[0] is None
