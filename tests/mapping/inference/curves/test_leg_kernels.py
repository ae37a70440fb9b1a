"""The leg of a line that is nearest to a place."""

from __future__ import annotations

import numpy as np

from mapping.inference.curves.leg_kernels import nearest_legs


def test_the_nearest_leg_is_that_of_least_distance_and_the_first_of_equals() -> None:
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [3.0, 1.0, 0.5]])
    points = np.array([[0.5, 0.2, 0.0], [1.3, -0.1, 0.0], [0.8, 0.7, 0.1], [9.0, 1.0, 0.0]])
    assert nearest_legs(points, line).tolist() == [0, 0, 2, 3]
    start, way = line[:-1], np.diff(line, axis=0)
    some = np.random.default_rng(0).uniform(-1.0, 4.0, (200, 3))
    share = ((some[:, None] - start) * way).sum(axis=2) / np.maximum((way**2).sum(axis=1), 1e-300)
    away = np.linalg.norm(some[:, None] - start - np.clip(share, 0.0, 1.0)[..., None] * way, axis=2)
    np.testing.assert_allclose(away[np.arange(200), nearest_legs(some, line)], away.min(axis=1))
