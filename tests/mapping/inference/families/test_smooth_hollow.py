"""Hollows without an edge: a cosine is found for what it is, where no upright groove or pit fits."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray
from mapping.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.inference.feature_posterior import refine
from mapping.inference.kinds import feature_trace
from mapping.instrument import Noise
from mapping.surface import Surface
from mapping.trace import Trace

TIP, DEPTH, MOUTH, LENGTH = 3e-3, 0.5e-3, 3.5e-3, 15e-3
NOISE = Noise(0.02e-3)
CORNERS = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0.0]])
PLATE = Base(Surface(CORNERS, [[0, 1, 2], [0, 2, 3]]))
UP = np.array([0.0, 0.0, 1.0])
FELT = -0.36045e-3  # where the ball hangs over the middle, by trying all of the section
WIDTH = 2.0 * MOUTH / np.pi * np.arccos(np.sqrt(-0.5 * FELT / DEPTH))  # at half of that


def felt(away: FloatArray) -> FloatArray:
    """Heights (N,) of the ball at distances from the middle of a cosine hollow, by trying all of its section."""
    u = np.linspace(-6e-3, 6e-3, 24_001)
    z = np.where(np.abs(u) < 0.5 * MOUTH, -DEPTH * np.cos(np.pi * u / MOUTH) ** 2, 0.0)
    grid = np.linspace(0.0, 2.5e-3, 501)
    gap = u - grid[:, None]
    rest = np.where(np.abs(gap) < TIP, z + np.sqrt(np.maximum(TIP**2 - gap**2, 0.0)) - TIP, -1.0).max(axis=1)
    return np.interp(away, grid, rest, right=0.0)


def swept(away_of: FloatArray, feet: FloatArray, sweep: FloatArray) -> Trace:
    height = felt(away_of) + NOISE.white * np.random.default_rng(3).standard_normal(len(feet))
    centers = feet + np.outer(TIP + height, UP)
    return Trace(1e-3 * np.arange(len(feet), dtype=np.float64), centers, sweep.astype(np.int64), TIP)


def lines(reach: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Feet of sweeps along y, side by side over |x| < reach, and their numbers."""
    y, at = np.linspace(-8e-3, 8e-3, 1600), np.linspace(-reach, reach, count)
    feet = np.column_stack([np.repeat(at, len(y)), np.tile(y, count), np.zeros(count * len(y))])
    return feet, np.repeat(np.arange(count), len(y))


def guess(kind: str, axis: FloatArray, length: float) -> Feature:
    sizes = Interval.normal(-0.4e-3, 0.02e-3), Interval(2.5e-3, 2e-3, 3.5e-3), Interval.normal(length, 1e-3)
    return Feature(kind, axis, np.tile(UP, (len(axis), 1)), *sizes, Support(200.0, 9), True, 0.05e-3)


@pytest.mark.slow
def test_a_cosine_groove_has_its_width_and_length_and_no_remark() -> None:
    feet, sweep = lines(12e-3, 13)
    beyond = np.maximum(np.abs(feet[:, 0]) - 0.5 * LENGTH, 0.0)
    trace = swept(np.hypot(feet[:, 1], beyond), feet, sweep)
    axis = np.array([[-7e-3, 0.05e-3, 0.0], [7e-3, -0.05e-3, 0.0]])
    found = refine(guess("groove", axis, 14e-3), trace, np.random.default_rng(0), base=PLATE, noise=NOISE)
    assert found.details.misfit is None and found.details.taper is not None
    assert found.width.low < WIDTH < found.width.high and found.width.high - found.width.low < 0.1e-3
    assert found.length.low < LENGTH < found.length.high
    assert found.height.censored and abs(found.height.median - FELT) < 5e-6  # the ball does not reach its bottom
    across = np.column_stack([np.zeros(50), np.linspace(-2.4e-3, 2.4e-3, 50), np.zeros(50)])
    drawn = feature_trace(found, across, np.tile(UP, (50, 1)), TIP)
    np.testing.assert_allclose(drawn, felt(np.abs(across[:, 1])), atol=10e-6)


@pytest.mark.slow
def test_a_cosine_pit_has_its_width_and_no_remark() -> None:
    feet, sweep = lines(3e-3, 13)
    trace = swept(np.hypot(feet[:, 0], feet[:, 1]), feet, sweep)
    found = refine(guess("pit", np.zeros((1, 3)), 0.0), trace, np.random.default_rng(0), base=PLATE, noise=NOISE)
    assert found.details.misfit is None and found.details.taper is not None
    assert found.width.low < WIDTH < found.width.high
    assert found.height.censored and abs(found.height.median - FELT) < 8e-6
