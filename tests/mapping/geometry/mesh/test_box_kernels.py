"""Boxes about points: the nearest is found from wherever the search begins."""

import numpy as np
import pytest
from numba import njit

from mapping.geometry.mesh import MOST_WAITING, boxes_about, nearest_from, nearest_within, vector


@njit
def _each_from(points, boxes, starts, places):
    waiting, out = np.empty(MOST_WAITING, np.int64), np.empty(len(places), np.int64)
    for n in range(len(places)):
        out[n] = nearest_from(points, boxes, starts[n], vector(places, n), waiting)
    return out


@pytest.mark.parametrize("count", [1, 16, 17, 300, 1025])
def test_the_nearest_point_is_found_from_any_start(count):
    rng = np.random.default_rng(count)
    points, places = rng.standard_normal((count, 3)).cumsum(axis=0), 20.0 * rng.standard_normal((200, 3))
    apart = np.linalg.norm(places[:, None] - points, axis=2)
    found = _each_from(points, boxes_about(points), rng.integers(0, count, len(places)), places)
    assert (found == apart.argmin(axis=1)).all()


def test_what_is_not_within_reach_is_infinitely_far():
    rng = np.random.default_rng(1)
    points, places = rng.standard_normal((500, 3)), 2.0 * rng.standard_normal((200, 3))
    least = np.linalg.norm(places[:, None] - points, axis=2).min(axis=1)
    found = nearest_within(points, boxes_about(points), places, 0.5)
    np.testing.assert_allclose(found, np.where(least < 0.5, least, np.inf), rtol=1e-14)
