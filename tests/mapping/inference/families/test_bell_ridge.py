"""Lines whose flanks run out are found for what they are, and of their width what the ball knows is said."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from explore3d.bench.scenes import dilated
from mapping import FloatArray
from mapping.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.geometry.templates import cap_height
from mapping.inference.feature_posterior import refine
from mapping.inference.kinds import feature_trace
from mapping.instrument import Noise
from mapping.surface import Surface
from mapping.trace import Trace

HIGH, HALF_WAY, NOISE = 0.3e-3, 1e-3, Noise(2e-6)
CORNERS = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0.0]])
PLATE = Base(Surface(CORNERS, [[0, 1, 2], [0, 2, 3]]))
UP = np.array([0.0, 0.0, 1.0])
ENDS = (-6e-3, 6.5e-3)


def cosine(u: FloatArray) -> FloatArray:
    return 0.5 * HIGH * (1.0 + np.cos(np.pi * np.clip(u / HALF_WAY, -1.0, 1.0)))


def gaussian(u: FloatArray) -> FloatArray:
    return np.asarray(HIGH * 0.5 ** ((2.0 * u / HALF_WAY) ** 2))


def found_in(heights: Callable[[FloatArray], FloatArray], tip: float) -> tuple[Feature, Trace]:
    """A line with round ends, 0.03 mm from where it was detected, refined."""
    y, at = np.arange(-6e-3, 6e-3, 18e-6), np.linspace(-8e-3, 8e-3, 9)
    feet = np.column_stack([np.repeat(at, len(y)), np.tile(y, len(at)), np.zeros(len(at) * len(y))])
    beyond = np.maximum(np.maximum(ENDS[0] - feet[:, 0], feet[:, 0] - ENDS[1]), 0.0)
    felt = heights(np.hypot(feet[:, 1] - 0.03e-3, beyond))
    felt += NOISE.white * np.random.default_rng(3).standard_normal(len(feet))
    trace = Trace(
        1e-3 * np.arange(float(len(feet))), feet + np.outer(tip + felt, UP), np.repeat(np.arange(9), len(y)), tip
    )
    axis = np.array([[ENDS[0], 0.0, 0.0], [ENDS[1], 0.0, 0.0]])
    sizes = Interval.normal(0.95 * HIGH, 5e-6), Interval.normal(HALF_WAY, 0.1e-3), Interval.normal(12e-3, 1e-3)
    guess = Feature("ridge", axis, np.tile(UP, (2, 1)), *sizes, Support(200.0, 7), True, 20e-6)
    return refine(guess, trace, np.random.default_rng(0), base=PLATE, noise=NOISE, confirm=False), trace


@pytest.mark.parametrize("section", [cosine, gaussian])
def test_a_ridge_without_an_edge_has_its_height_and_its_width_at_half_height(
    section: Callable[[FloatArray], FloatArray],
) -> None:
    def heights(away: FloatArray) -> FloatArray:
        return dilated(section, 2.5e-3, away, 1e-3)

    found, trace = found_in(heights, 1e-3)
    assert found.details.misfit is None and found.details.exponent is not None
    assert "its flank runs out into the base: width at half height" in found.notes
    assert abs(found.height.median - HIGH) < 0.5e-6 and found.height.high - found.height.low < 1e-6
    assert abs(found.width.median - HALF_WAY) < 4e-6 and found.width.high - found.width.low < 10e-6
    assert found.length.low - 0.1e-3 < ENDS[1] - ENDS[0] < found.length.high + 0.1e-3
    feet = (trace.centers - 1e-3 * UP) * [1.0, 1.0, 0.0]
    inside = (feet[:, 0] > ENDS[0]) & (feet[:, 0] < ENDS[1])
    drawn = feature_trace(found, feet[inside], np.tile(UP, (inside.sum(), 1)), 1e-3)
    np.testing.assert_allclose(drawn, heights(feet[inside, 1] - 0.03e-3), atol=0.02 * HIGH)


def test_where_the_ball_bridges_the_flanks_the_width_is_a_bound() -> None:
    found, _ = found_in(lambda away: dilated(cosine, HALF_WAY, away, 3e-3), 3e-3)
    assert found.details.misfit is None and abs(found.height.median - HIGH) < 1e-6
    assert found.width.bounded and 0.5e-3 < found.width.low < HALF_WAY < found.width.high < 3.2e-3
    assert any("at half height it may be anything up to" in note for note in found.notes)


def test_a_wire_stays_a_wire() -> None:
    found, _ = found_in(lambda away: cap_height(away, HIGH, 0.5 * HIGH, 1e-3), 1e-3)
    assert found.details.exponent is None and not found.width.bounded
    assert abs(found.width.median - HIGH) < 5e-6 and not any("section" in note for note in found.notes)
