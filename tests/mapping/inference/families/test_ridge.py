"""A ridge over a bent body: what a bin looks at is all that it can touch."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.geometry.templates import chain_heights
from mapping.inference.families import Surroundings
from mapping.inference.families.ridge import RidgeShape, rounding_of
from mapping.inference.feature_posterior import pose_problem
from mapping.instrument import Noise
from mapping.surface import Surface
from mapping.trace import Trace

AXIS = np.array([0.0, 0.0, 1.0])
TIP, RADIUS, HEIGHT = 10e-3, 3e-3, 0.5e-3


def cylinder(sides: int = 720, length: float = 40e-3) -> Surface:
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = RADIUS * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    vertices = np.concatenate([ring - 0.5 * length * AXIS, ring + 0.5 * length * AXIS])
    a, b = np.arange(sides), (np.arange(sides) + 1) % sides
    return Surface(
        vertices, np.concatenate([np.column_stack([a, b, b + sides]), np.column_stack([a, b + sides, a + sides])])
    )


def helix() -> Feature:
    """A ridge that winds about the cylinder at 45 degrees."""
    angle = np.linspace(-1.2, 1.2, 25)
    out = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    axis = RADIUS * (out + np.outer(angle, AXIS))
    sizes = (
        Interval.normal(HEIGHT, 0.05 * HEIGHT),
        Interval(HEIGHT, 2 * HEIGHT, 4 * HEIGHT),
        Interval.normal(10.2e-3, 1e-4),
    )
    return Feature("ridge", axis, out, *sizes, Support(50.0, 9), True, 0.05e-3)


@pytest.fixture(scope="module")
def shape() -> RidgeShape:
    angle = np.linspace(-1.8, 1.8, 2000)
    out = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    rises = np.linspace(-6e-3, 6e-3, 25)
    centers = np.concatenate([(RADIUS + TIP) * out + rise * AXIS for rise in rises])
    sweep = np.repeat(np.arange(len(rises)), len(angle))
    trace = Trace(1e-3 * np.arange(len(centers), dtype=np.float64), centers, sweep, TIP)
    problem = pose_problem(helix(), Surroundings(trace, Base(cylinder()), Noise(0.03e-3)))
    assert isinstance(problem.target.shape, RidgeShape)
    return problem.target.shape


@pytest.mark.parametrize("turn", [0.0, 0.4, 0.999999, 1.0])
def test_where_normals_lean_along_the_line_a_bin_still_looks_at_all_that_it_can_touch(
    shape: RidgeShape, turn: float
) -> None:
    """On a torus a ridge's flanks were cut off where normals leaned by more than a tenth: 0.48 mm found for 0.497."""
    theta = shape.start[None].copy()
    theta[:, -5], theta[:, -2], theta[:, -1] = turn, HEIGHT, np.log(0.5e-3)
    window, radius = shape.window, np.exp(theta[:, -1])
    all_of_it = np.empty((1, len(window)))
    first, last = np.zeros(len(window), dtype=np.int64), np.full(len(window), len(shape.chart.s) - 1, dtype=np.int64)
    where = window.feet, window.normals, window.tangents, window.half, first, last
    chains = shape.chains(theta, theta[:, -2] - radius)
    chain_heights(*where, chains, radius, rounding_of(theta[:, -5]), TIP, all_of_it)
    assert (all_of_it > 0.1e-3).sum() > 100
    np.testing.assert_allclose(shape.templates(theta), all_of_it, atol=1e-9)
