"""Points in boxes: the nearest is found wherever the search begins, and in whatever order they come."""

import numpy as np
import pytest

from mapping.geometry.mesh import BoxedPoints


@pytest.mark.parametrize("count", [1, 16, 17, 300, 1025])
@pytest.mark.parametrize("in_a_row", [True, False])
def test_the_nearest_point_is_found(count: int, in_a_row: bool) -> None:
    rng = np.random.default_rng(count)
    points, places = rng.standard_normal((count, 3)), 10.0 * rng.standard_normal((200, 3))
    points = 0.1 * points.cumsum(axis=0) if in_a_row else 5.0 * points
    apart = np.linalg.norm(places[:, None] - points, axis=2)
    distance, number = BoxedPoints(points).nearest(places)
    assert (number == apart.argmin(axis=1)).all()
    np.testing.assert_allclose(distance, apart.min(axis=1), rtol=1e-14)


def test_what_is_not_within_reach_is_infinitely_far_and_none_of_them() -> None:
    rng = np.random.default_rng(1)
    points, places = rng.standard_normal((500, 3)), 2.0 * rng.standard_normal((200, 3))
    apart = np.linalg.norm(places[:, None] - points, axis=2)
    distance, number = BoxedPoints(points).nearest(places, 0.5)
    within = apart.min(axis=1) < 0.5
    assert 0 < within.sum() < len(within)
    assert (number == np.where(within, apart.argmin(axis=1), len(points))).all()
    np.testing.assert_allclose(distance, np.where(within, apart.min(axis=1), np.inf), rtol=1e-14)
