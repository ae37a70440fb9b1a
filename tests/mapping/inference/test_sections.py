"""Sections by evidence: what a ball cannot tell apart is averaged, and what no family fits is remarked upon."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from mapping import Feature, FloatArray, Interval, Support, Surface, Trace
from mapping.assembly import assemble
from mapping.base import Base
from mapping.detection import detect
from mapping.geometry.templates import cap_height
from mapping.inference import refine
from mapping.inference.evidence import probabilities
from mapping.inference.joint import refine_all
from mapping.inference.pooled_residual import PooledResidual, with_remark
from mapping.instrument import Noise

TIP, NOISE = 10e-3, Noise(20e-6)
CORNERS = 0.1 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
PLATE = Base(Surface(CORNERS, [[0, 1, 2], [0, 2, 3]]))


def bar(y: FloatArray, height: float, top: float) -> FloatArray:
    """Heights of the ball beside the middle of a bar, m."""
    return cap_height(np.maximum(np.abs(y) - 0.5 * top, 0.0), height, 0.0, TIP)


def swept(heights: FloatArray, x: FloatArray, y: FloatArray, seed: int = 0) -> Trace:
    height = heights + NOISE.white * np.random.default_rng(seed).standard_normal(len(y))
    sweep = np.unique(x, return_inverse=True)[1]
    return Trace(1e-3 * np.arange(float(len(y))), np.column_stack([x, y, TIP + height]), sweep, TIP)


def places(sweeps: int) -> tuple[FloatArray, FloatArray]:
    y = np.arange(-16e-3, 16e-3, 50e-6)
    return np.repeat(np.linspace(-8e-3, 8e-3, sweeps), len(y)), np.tile(y, sweeps)


def ridge(height: float = 0.4e-3, kind: str = "ridge", y: float = 0.0) -> Feature:
    axis = np.array([[-8e-3, y, 0.0], [0.0, y, 0.0], [8e-3, y, 0.0]])
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    sizes = Interval.normal(height, 5e-6), Interval.normal(height, 5e-6), Interval.normal(16e-3, 1e-3)
    return Feature(kind, axis, up, *sizes, Support(100.0, 5), True, 20e-6)


@cache
def refined(top: float, growth: float = 0.0) -> Feature:
    x, y = places(5)
    trace = swept((1.0 + growth * x) * bar(y, 0.4e-3, top), x, y)
    return refine(ridge(), trace, np.random.default_rng(0), base=PLATE, noise=NOISE, confirm=False)


@pytest.mark.slow
def test_of_a_bar_the_height_is_known_and_the_foot_is_bounded() -> None:
    found = refined(2e-3)
    assert found.height.low < 0.4e-3 < found.height.high and found.height.high - found.height.low < 10e-6
    assert found.width.bounded and found.width.low < 2e-3 < found.width.high
    # the ball left the plate at x_c = sqrt(2 r H) beside the edges
    assert found.width.high == pytest.approx(2e-3 + 2.0 * np.sqrt(2 * TIP * 0.4e-3), rel=0.03)
    assert found.details.top == pytest.approx(2e-3, rel=0.03) and found.details.misfit is None
    assert f"{found.width}" == f"between 2 and {1e3 * found.width.high:.2g} mm"


@pytest.mark.slow
def test_of_a_roof_nothing_is_said_but_how_wide_it_is_at_most() -> None:
    found = refined(0.0)
    assert found.width.bounded and f"{found.width}".startswith("at most 5.")
    assert "round" in " ".join(found.notes) and "triangular" in " ".join(found.notes)


def test_a_height_that_grows_along_a_line_is_remarked_upon() -> None:
    found = refined(2e-3, 10.0)
    assert "its height varies along it" in (found.details.misfit or "") and found.details.misfit in found.notes
    assert found.height.low < 0.4e-3 < found.height.high
    assert found.evidence.log_odds is not None and found.evidence.log_odds > 100.0


@pytest.mark.slow
def test_two_edges_that_face_each_other_are_one_bar() -> None:
    x, y = places(5)
    trace = swept(bar(y, 0.4e-3, 2e-3), x, y)
    (line,) = assemble(detect(trace, PLATE), trace, PLATE)
    (found,) = refine_all([line], trace, 0, base=PLATE, noise=NOISE, confirm=False)
    assert found.kind == "ridge" and abs(found.height.median - 0.4e-3) < 5e-6
    wide = swept(bar(y, 0.4e-3, 10e-3), x, y)
    assert [each.kind for each in assemble(detect(wide, PLATE), wide, PLATE)] == ["step", "step"]


def test_probabilities_are_those_of_evidences() -> None:
    np.testing.assert_allclose(probabilities([-1000.0, -1000.0 - np.log(3.0)]), [0.75, 0.25])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_height_that_no_form_explains_stays_on_its_side(side: float) -> None:
    size = Interval.normal(side * 0.4e-3, 10e-6)
    found = with_remark(replace(ridge(), height=size), PooledResidual(1e-9, 0.9e-3, False, 50.0), raised=True)
    ends = sorted(abs(end) for end in (found.height.low, found.height.high))
    assert ends[0] == 0.0 and ends[1] == pytest.approx(1.3e-3, abs=0.05e-3)
    assert side * found.height.low >= 0.0 and side * found.height.high >= 0.0
