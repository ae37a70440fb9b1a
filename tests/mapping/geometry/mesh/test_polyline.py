"""The nearest places on a polyline, in pieces as at once, in little memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from mapping.geometry.mesh import nearest_on, polyline


def test_many_points_are_compared_in_pieces_with_the_same_result(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    points, axis = rng.normal(size=(5000, 3)), np.cumsum(rng.normal(size=(40, 3)), axis=0)
    on, along = nearest_on(points, axis)
    monkeypatch.setattr(polyline, "_MOST_PAIRS", 3000)
    for found, expected in zip(nearest_on(points, axis), (on, along), strict=True):
        assert np.array_equal(found, expected)


def test_a_long_recording_and_a_long_axis_need_little_memory() -> None:
    points, axis = np.zeros((400_000, 3)), np.column_stack([np.arange(64.0), np.zeros(64), np.ones(64)])
    tracemalloc.start()
    nearest_on(points, axis)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # all pairs at once are 0.6 GB for each of the arrays between
    assert peak < 200e6
