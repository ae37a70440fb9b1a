"""The tests of a leaf's sixteen triangles: what they leave out is further away than they say, on any mesh."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from mapping.geometry.mesh.bvh_kernels import BOX_ROUNDING, CACHE_LINE, WIDTH, lanes, leaf_tests
from mapping.geometry.mesh.tree import TriangleTree
from mapping.geometry.mesh.triangle_kernels import closest_on_triangle
from mapping.surface import Surface

PLACES = 400


@njit
def _leaf_tests(leaves, node, end, d, reach, apart):  # type: ignore[no-untyped-def]
    leaf_tests(leaves, node, end, d, reach, apart)


def triangles(size: float, height: float, rng: np.random.Generator) -> Surface:
    """Sixteen triangles of the size anywhere in a body of 1, of so much of their length in height."""
    middle = rng.uniform(-0.5, 0.5, (WIDTH, 3))
    along, aside = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in rng.normal(size=(2, WIDTH, 3)))
    share = rng.uniform(-1.0, 2.0, (WIDTH, 1))
    corners = np.stack([middle, middle + size * along, middle + size * (share * along + height * aside)], axis=1)
    return Surface(corners.reshape(-1, 3), np.arange(3 * WIDTH).reshape(-1, 3))


@pytest.mark.parametrize("size", [1.0, 1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("height", [1.0, 1e-3, 1e-7, 0.0])
@pytest.mark.parametrize("away", [1.0, 1e-2, 1e-4])
def test_no_triangle_ahead_is_told_further_away_than_it_is(size: float, height: float, away: float) -> None:
    rng = np.random.default_rng(7)
    tree = TriangleTree(triangles(size, height, rng), 1.0)
    apart, told, close = np.empty(WIDTH, np.float32), 0, 0
    for _ in range(PLACES):
        row = tree.rows[rng.integers(WIDTH)]
        way, step = rng.normal(size=(2, 3))
        d = way / np.linalg.norm(way)
        shares = rng.dirichlet(np.ones(3) * rng.choice([0.1, 1.0]))
        end = shares @ row[:9].reshape(3, 3) + away * (0.01 * step - d)
        _leaf_tests(tree.leaves, 0, tuple(end), tuple(d), 0.1, apart)
        for lane in np.flatnonzero(apart >= 0.0):
            a, b, c = (tuple(corner - end) for corner in tree.rows[lane, :9].reshape(3, 3))
            true = float(np.linalg.norm(closest_on_triangle(a, b, c, tuple(tree.rows[lane, 9:]))))
            assert np.sqrt(apart[lane]) <= true + 0.5 * BOX_ROUNDING
            told += 1
            close += np.sqrt(apart[lane]) > true - 0.5 * BOX_ROUNDING
    assert close > 0.3 * told > 0  # and of those ahead as a whole, it is their distance


def test_the_lanes_of_a_node_lie_in_one_line_of_the_cache() -> None:
    kept = [lanes(rows) for rows in range(1, 30)]  # at once: numba begins them at multiples of 32 bytes, by chance
    assert all(room.shape == (rows, WIDTH) for rows, room in enumerate(kept, 1))
    tree = TriangleTree(triangles(0.1, 1.0, np.random.default_rng(0)))
    assert all(room.ctypes.data % CACHE_LINE == 0 for room in (*kept, tree.leaves))
