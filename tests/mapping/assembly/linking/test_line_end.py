"""Ends of a crest from closed-form heights at the places of parallel sweeps."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.assembly.linking.inspection import Inspection
from mapping.assembly.linking.line_ends import line_end
from mapping.geometry.mesh.polyline import distances
from mapping.geometry.templates.small_heights import crest_trace

HEIGHT, WIDTH, LENGTH = 0.65e-3, 3.6e-3, 0.03


def inspected(far: float, pitch: float = 4e-3, sd: float = 1e-5, height: float = HEIGHT, seed: int = 0) -> Inspection:
    """Sweeps across a ridge from x = 0 to LENGTH, up to x = far."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(-0.01, far, pitch), np.arange(-0.01, 0.01, 5e-4), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    # a groove's rim at its end holds the ball up half a width before
    stop = LENGTH if height > 0 else LENGTH - WIDTH
    truth = crest_trace(distances(points, np.array([[0.0, 0, 0], [stop, 0, 0]])), height, WIDTH)
    sweep = np.repeat(np.arange(len(x)), x.shape[1])
    return Inspection(points, truth + sd * rng.standard_normal(len(points)), np.full(len(points), sd), sweep, 5e-4)


@pytest.mark.parametrize("height", [HEIGHT, -HEIGHT])
@pytest.mark.parametrize("last", [0.024, 0.028])
def test_the_end_lies_where_the_heights_fall(last, height):
    axis = np.array([[0.002, 0, 0], [0.012, 0, 0], [last, 0, 0]])
    end = line_end(axis, height, WIDTH, inspected(0.05, height=height), 0.015)
    assert end.seen
    assert abs(end.point[0] - LENGTH) < (0.3e-3 if height > 0 else 0.7e-3)
    assert end.point[0] - end.low - 2e-4 <= LENGTH <= end.point[0] + end.high + 2e-4


def test_a_ridge_that_runs_to_the_border_of_what_was_inspected_goes_at_least_so_far():
    axis = np.array([[0.002, 0, 0], [0.012, 0, 0], [0.018, 0, 0]])
    end = line_end(axis, HEIGHT, WIDTH, inspected(0.0185), 0.015)
    assert not end.seen
    assert end.point[0] <= LENGTH and end.high > 5e-3


def test_points_beyond_the_end_are_dropped():
    axis = np.array([[0.002, 0, 0], [0.012, 0, 0], [0.0275, 0, 0], [0.0325, 0, 0]])
    end = line_end(axis, HEIGHT, WIDTH, inspected(0.05), 0.015)
    assert end.seen and end.dropped == 1
    assert abs(end.point[0] - LENGTH) < 0.3e-3


def test_the_interval_widens_with_the_noise():
    axis = np.array([[0.002, 0, 0], [0.012, 0, 0], [0.026, 0, 0]])

    def span(sd: float) -> float:
        ends = [line_end(axis, HEIGHT, WIDTH, inspected(0.05, sd=sd, seed=seed), 0.015) for seed in range(8)]
        return float(np.mean([end.low + end.high for end in ends]))

    assert span(3e-4) > 1.5 * span(1e-5)
