"""Nearest points from the tree of boxes: against every triangle, at any place and scale."""

from __future__ import annotations

import numpy as np
import pytest
from brute_force_contact import distances
from contact_bodies import BODIES, bump, merged

from mapping.geometry.mesh.nearest import NearestPoint
from mapping.surface import Surface


@pytest.mark.parametrize("name", BODIES)
def test_distances_agree_with_every_triangle(name: str) -> None:
    body = BODIES[name]()
    rng = np.random.default_rng(0)
    points = body.bounds.mean(axis=0) + 0.4 * body.size * rng.normal(size=(60, 3))
    points[:8] = body.vertices[body.faces[:8]].mean(axis=1)  # on the body
    nearest = NearestPoint(body).query(points)
    corners = body.vertices[body.faces]
    np.testing.assert_allclose(nearest.distance, distances(corners, points), atol=1e-14 * body.size)
    np.testing.assert_allclose(distances(corners, nearest.points), 0.0, atol=1e-14 * body.size)
    lies = np.einsum("ij,ijk->ik", nearest.barycentric, corners[nearest.face])
    np.testing.assert_allclose(lies, nearest.points, atol=1e-12 * body.size)


@pytest.mark.parametrize("away", [1e3, 1e9])
def test_points_far_away_find_their_nearest_point_exactly(away: float) -> None:
    body = bump(15.0)
    corners, points = body.vertices[body.faces], np.array([[0.2, 0.1, away], [away, 0.0, 0.0]])
    nearest = NearestPoint(body).query(points)
    np.testing.assert_allclose(nearest.distance, distances(corners, points), rtol=1e-15)
    np.testing.assert_allclose(distances(corners, nearest.points), 0.0, atol=1e-15)


def test_of_equally_near_faces_the_first_one_answers() -> None:
    body = bump(0.0, 8)
    nearest = NearestPoint(merged(body, body)).query([[0.3, 0.4, 2.0], [0.0, 0.0, 2.0]])
    assert (nearest.face < len(body.faces)).all()
    at_origin = (np.abs(body.vertices[body.faces][:, :, :2]) < 1e-12).all(axis=2).any(axis=1)
    assert nearest.face[1] == np.flatnonzero(at_origin)[0]


@pytest.mark.parametrize("exponent", [-100, -30, 30, 100])
def test_powers_of_two_scale_exactly(exponent: int) -> None:
    body, scale = bump(15.0), 2.0**exponent
    points = np.random.default_rng(2).normal(size=(50, 3))
    plain = NearestPoint(body).query(points)
    scaled = NearestPoint(Surface(body.vertices * scale, body.faces)).query(points * scale)
    np.testing.assert_array_equal(scaled.face, plain.face)
    np.testing.assert_array_equal(scaled.points, plain.points * scale)
