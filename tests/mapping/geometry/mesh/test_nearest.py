"""Points in boxes: the nearest is found wherever the search begins, and in whatever order; and smooth normals."""

import numpy as np
import pytest

from mapping import Surface
from mapping.geometry.mesh import BoxedPoints, MovedNearestPoint, NearestPoint


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


def test_smooth_normals_on_facets_are_those_of_the_round_body() -> None:
    from trimesh.creation import icosphere

    ball = icosphere(subdivisions=2)
    surface, rng = Surface(ball.vertices, ball.faces), np.random.default_rng(0)
    face, shares = rng.integers(len(ball.faces), size=500), rng.dirichlet([1.0, 1.0, 1.0], 500)
    places = np.einsum("nc,ncx->nx", shares, surface.vertices[surface.faces[face]])
    true = places / np.linalg.norm(places, axis=1, keepdims=True)
    normals = NearestPoint(surface).smooth_normals(face, shares)
    facets = np.arccos(np.einsum("ij,ij->i", surface.face_normals[face], true))
    assert np.degrees(facets.max()) > 7.0
    assert np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", normals, true), -1.0, 1.0)).max()) < 1.0
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = MovedNearestPoint(surface.moved(turn, np.ones(3)), NearestPoint(surface), turn, np.ones(3))
    np.testing.assert_allclose(moved.smooth_normals(face, shares), normals @ turn.T, atol=1e-12)


def test_an_edge_of_the_body_is_not_smoothed_away() -> None:
    from trimesh.creation import box

    cube = box(extents=(1.0, 1.0, 1.0))
    surface = Surface(cube.vertices, cube.faces)
    face = np.arange(len(cube.faces))
    normals = NearestPoint(surface).smooth_normals(face, np.tile([0.8, 0.1, 0.1], (len(face), 1)))
    np.testing.assert_allclose(normals, surface.face_normals, atol=1e-12)


def test_what_is_nearer_is_told_without_asking_how_near() -> None:
    from trimesh.creation import icosphere

    ball = icosphere(subdivisions=2, radius=0.02)
    body = NearestPoint(Surface(ball.vertices, ball.faces))
    rng = np.random.default_rng(0)
    points, turn = 0.02 * rng.standard_normal((400, 3)), np.linalg.qr(rng.standard_normal((3, 3)))[0]
    true = body.query(points).distance
    for reach in (1e-3, 1e-2):
        near = body.nearer_than(points, reach)
        assert 0 < near.sum() < len(points)
        assert (near == (true < reach)).all()
    moved = MovedNearestPoint(Surface(ball.vertices @ turn.T + 1.0, ball.faces), body, turn, np.ones(3))
    assert (moved.nearer_than(points @ turn.T + 1.0, 1e-2) == (true < 1e-2)).all()
    assert not body.nearer_than(points, 0.0).any()
    assert body.nearer_than(np.zeros((0, 3)), 1e-2).shape == (0,)
