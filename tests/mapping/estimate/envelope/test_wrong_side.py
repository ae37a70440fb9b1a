"""A trace tells by its kinks on which side of it the body lies; outliers do not."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray, Trace
from mapping.base import LaidTrace, fit_base
from mapping.estimate.envelope import WrongSide, wrong_side

TIP, STEP, NOISE, ROWS, WIRES = 1.0, 0.05, 0.002, 10, 4


def rows_of_wires(rng: np.random.Generator) -> FloatArray:
    """(ROWS, N) heights of a ball over round wires of 0.2 that lie across the rows, and white noise: exact."""
    x = STEP * np.arange(600)
    z = np.full((ROWS, len(x)), TIP)
    for place in np.linspace(4.0, 26.0, WIRES):
        z = np.maximum(z, 0.1 + np.sqrt(np.maximum(1.1**2 - (x - place) ** 2, 0.0)))
    return np.asarray(z + NOISE * rng.standard_normal(z.shape))


def asked(heights: FloatArray) -> WrongSide | None:
    rows, count = heights.shape
    x, y = np.tile(STEP * np.arange(count), rows), np.repeat(np.arange(rows) * 1.0, count)
    centers = np.column_stack([x, y, heights.ravel()])
    trace = Trace(np.arange(len(x)) * 1.0, centers, np.repeat(np.arange(rows), count), TIP)
    return wrong_side(LaidTrace.of(trace, fit_base(trace)))


def test_wires_felt_from_above_speak_against_nothing() -> None:
    assert asked(rows_of_wires(np.random.default_rng(1))) is None


def test_wires_on_the_underside_are_told() -> None:
    found = asked(-rows_of_wires(np.random.default_rng(2)))
    assert found is not None and found.chance < 1e-4
    # two feet of each wire, of which those count that lie well between the samples
    assert ROWS * WIRES // 2 < found.outwards <= 2 * ROWS * WIRES and found.inwards == 0


@pytest.mark.parametrize("longest", [1, 6, 40])
def test_readings_that_drop_out_do_not_turn_a_body_over(longest: int) -> None:
    rng = np.random.default_rng(3)
    heights = rows_of_wires(rng)
    for row, begin in zip(rng.integers(0, ROWS, 60), rng.integers(0, 560, 60), strict=True):
        length = int(rng.integers(1, longest + 1))
        heights[row, begin : begin + length] -= rng.uniform(0.05, 0.3)
    assert asked(heights) is None


def test_smooth_dips_all_downwards_do_not_turn_a_bare_plate_over() -> None:
    rng = np.random.default_rng(4)
    heights = TIP + NOISE * rng.standard_normal((ROWS, 600))
    for row, begin in zip(rng.integers(0, ROWS, 60), rng.integers(0, 560, 60), strict=True):
        heights[row, begin : begin + 40] -= rng.uniform(0.02, 0.3) * np.hanning(40)
    assert asked(heights) is None


@pytest.mark.parametrize("seed", [5, 6])
def test_single_readings_that_drop_out_everywhere_do_not_turn_a_bare_plate_over(seed: int) -> None:
    """Their shoulders bend outwards, and their bottoms are jumps, which count for nothing."""
    rng = np.random.default_rng(seed)
    heights = TIP + 0.5 * NOISE * rng.standard_normal((20, 600))
    heights[rng.integers(0, 20, 600), rng.integers(0, 600, 600)] -= rng.uniform(0.05, 0.5, 600)
    assert asked(heights) is None
