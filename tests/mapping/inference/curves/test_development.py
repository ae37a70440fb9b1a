"""Curves unrolled into the plane, and axes that are smooth within their base."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.base.base import Base
from mapping.base.projection import onto_base
from mapping.geometry.mesh.polyline import arclengths, nearest_on
from mapping.inference.curves.development import developed, smooth_on_base
from mapping.inference.curves.smooth_axis import smooth_axis
from mapping.surface import Surface

TIP, HALF_WIDTH = 10e-3, 3.6e-3
FOLD = np.radians(40.0)
DOWN = np.array([np.cos(FOLD), 0.0, -np.sin(FOLD)])
NORMALS = np.array([[0.0, 0.0, 1.0], [np.sin(FOLD), 0.0, np.cos(FOLD)]])


def folded(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (K, 3) and normals of a roof whose edge is x = 0, at places of its development."""
    x = np.array([1.0, 0.0, 0.0])
    points = np.where(u[:, None] < 0.0, u[:, None] * x, u[:, None] * DOWN) + v[:, None] * [0.0, 1.0, 0.0]
    return points, NORMALS[(u >= 0.0).astype(int)]


def roof() -> Base:
    y = np.array([0.0, 0.1, 0.0])
    left, right = np.array([-0.1, 0.0, 0.0]), 0.1 * DOWN
    corners = np.array([left - y, -y, right - y, left + y, y, right + y])
    return Base(Surface(corners, [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]))


def bow(flat: np.ndarray) -> float:
    """Largest distance of points (K, 2) from their straight line, m."""
    off = flat - flat.mean(axis=0)
    return float(np.abs(off @ np.linalg.svd(off, full_matrices=False)[2][1]).max())


@pytest.mark.parametrize("begin", [0.0, 0.1e-3, 0.37e-3, 0.9e-3])
def test_a_straight_way_over_a_fold_is_straight_wherever_the_fold_lies_between_its_points(begin: float) -> None:
    u = begin + np.arange(-20, 20) * 1e-3
    flat = developed(*folded(u, 0.7 * u))
    assert bow(flat) < 1e-15 and arclengths(flat)[-1] == pytest.approx(39e-3 * np.hypot(1.0, 0.7), abs=1e-15)


def test_a_helix_is_straight_and_a_small_circle_bends_as_within_the_surface() -> None:
    turn = np.linspace(0.0, 3.0, 400)
    out = np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    helix = developed(0.02 * out + np.outer(8e-3 * turn, [0, 0, 1]), out)
    assert bow(helix) < 1e-7 and arclengths(helix)[-1] == pytest.approx(3.0 * np.hypot(0.02, 8e-3), rel=1e-5)
    # 30 degrees from the pole of a sphere a parallel turns by cos(30 deg) of its longitude (Gauss and Bonnet)
    up = np.column_stack([0.5 * out[:, 0], 0.5 * out[:, 1], np.full(400, np.sqrt(0.75))])
    flat = developed(0.02 * up, up)
    first, last = flat[1] - flat[0], flat[-1] - flat[-2]
    angle = np.arctan2(first[0] * last[1] - first[1] * last[0], first @ last)
    assert angle == pytest.approx(3.0 * np.sqrt(0.75), rel=1e-2)


def test_a_line_over_a_fold_is_smoothed_as_the_straight_line_that_it_is() -> None:
    rng = np.random.default_rng(0)
    u = np.linspace(-0.03, 0.03, 15)
    across = 0.1e-3 * rng.standard_normal(len(u))
    axis, normals = folded(u - 0.5 * across, 0.5 * u + across)
    line, degree = smooth_on_base(axis, normals, 0.1e-3, 8, 1, roof(), TIP, HALF_WIDTH)
    places = np.linspace(-0.032, 0.032, 2001)
    true = folded(places, 0.5 * places)[0]

    def off(found: np.ndarray) -> float:
        return float(np.linalg.norm(found - nearest_on(found, true)[0], axis=1).max())

    assert degree == 1 and off(line) < 0.12e-3
    assert off(smooth_axis(axis, 0.1e-3)[0]) > 0.5e-3  # a curve in space cuts the corner


def test_sparse_exact_crossings_of_a_line_over_a_fold_give_the_line_itself() -> None:
    u = np.linspace(-0.03, 0.03, 8)
    line, degree = smooth_on_base(*folded(u, 0.5 * u), 1e-6, 8, 1, roof(), TIP, HALF_WIDTH)
    places = np.linspace(-0.032, 0.032, 20001)
    true = folded(places, 0.5 * places)[0]
    assert degree == 1 and np.linalg.norm(line - nearest_on(line, true)[0], axis=1).max() < 2e-6


def test_on_a_plane_nothing_is_rolled() -> None:
    plane = Base(Surface([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]], [[0, 1, 2], [0, 2, 3]]))
    x = np.linspace(-0.02, 0.02, 9)
    axis = np.column_stack([x, 1e-3 * np.sin(100 * x), 0 * x])
    up = np.tile([0.0, 0.0, 1.0], (9, 1))
    line, degree = smooth_on_base(axis, up, 0.05e-3, 8, 1, plane, TIP, HALF_WIDTH)
    plain, same = smooth_axis(axis, 0.05e-3)
    assert degree == same and np.array_equal(line, plain)


def test_points_on_a_folded_base_stay_where_they_are() -> None:
    u = np.linspace(-0.01, 0.01, 201)
    points, normals = folded(u, 0.3 * u)
    lifts = np.tile(NORMALS[0], (len(u), 1))  # as for points whose nearest crossing lies on the other side
    np.testing.assert_allclose(onto_base(points, normals, roof(), TIP)[0], points, atol=1e-9)
    np.testing.assert_allclose(onto_base(points, lifts, roof(), TIP)[0], points, atol=1e-5)
