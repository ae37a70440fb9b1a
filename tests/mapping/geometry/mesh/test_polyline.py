"""The nearest places on a polyline, against all pairs, in little memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from mapping.geometry.mesh import arclengths, nearest_on


@pytest.mark.parametrize("size", [2, 3])
def test_the_nearest_point_is_that_of_the_nearest_leg(size: int) -> None:
    rng = np.random.default_rng(4)
    points, axis = rng.normal(size=(500, size)), np.cumsum(rng.normal(size=(40, size)), axis=0)
    axis[7] = axis[6]  # a leg of no length
    on, along = nearest_on(points, axis)
    leg = np.diff(axis, axis=0)
    share = ((points[:, None] - axis[:-1]) * leg).sum(axis=2) / np.maximum((leg**2).sum(axis=1), 1e-300)
    every = axis[:-1] + np.clip(share, 0.0, 1.0)[..., None] * leg
    apart = np.linalg.norm(points[:, None] - every, axis=2)
    np.testing.assert_allclose(np.linalg.norm(points - on, axis=1), apart.min(axis=1), atol=1e-14)
    np.testing.assert_allclose(on, [every[n, k] for n, k in enumerate(apart.argmin(axis=1))], atol=1e-14)
    ways = np.column_stack([np.interp(along, arclengths(axis), axis[:, i]) for i in range(size)])
    np.testing.assert_allclose(ways, on, atol=1e-13)


def test_a_long_recording_and_a_long_axis_need_little_memory() -> None:
    points, axis = np.zeros((400_000, 3)), np.column_stack([np.arange(64.0), np.zeros(64), np.ones(64)])
    tracemalloc.start()
    nearest_on(points, axis)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # all pairs at once are 0.6 GB for each of the arrays between
    assert peak < 200e6
