"""Nothing kills the process: each kind of bad mesh gives the right answer or a clear error, in every operator."""

from __future__ import annotations

import numpy as np
import pytest
from brute_force_contact import distances

from mapping.errors import SurfaceError
from mapping.geometry.contact.first_contact import BallContact, ContactError
from mapping.geometry.curvature.principal_curvatures import principal_curvatures
from mapping.geometry.mesh.nearest import NearestPoint
from mapping.surface import Surface

DOWN = np.array([0.0, 0.0, -1.0])
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])

# Each is at height 0 under the point (0.3, 0.2), except the wall of "non-manifold edges", which rises at y = 0.
MESHES = {
    "one triangle": (SQUARE[:3], HALVES[:1]),
    "degenerate triangles": (SQUARE, np.vstack([HALVES, [[0, 0, 0], [0, 1, 1], [2, 0, 2]]])),
    "collinear triangles": (np.vstack([SQUARE, [[0.5, 0, 0]]]), np.vstack([HALVES, [[0, 1, 4]]])),
    "duplicate triangles": (SQUARE, np.vstack([HALVES, HALVES, HALVES])),
    "duplicate vertices": (np.vstack([SQUARE, SQUARE]), np.array([[0, 1, 2], [4, 6, 7]])),
    "unreferenced vertices": (np.vstack([[[0.3, 0.2, 9.0]], SQUARE, [[0.3, 0.2, 1e6]]]), HALVES + 1),
    "non-manifold edges": (
        np.vstack([SQUARE, [[0.5, 0, -1], [0.5, 0, -2]]]),
        np.vstack([HALVES, [[0, 1, 4], [0, 1, 5]]]),
    ),
    "flipped orientation": (SQUARE, HALVES[:, ::-1]),
    "mixed orientation": (SQUARE, np.array([[0, 1, 2], [0, 3, 2]])),
}
RADII = (1e-9, 0.1, 1.0, 1e3, 1e9)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("name", MESHES)
def test_the_ball_rests_on_it_from_above_and_from_behind(name: str, radius: float) -> None:
    body = Surface(*MESHES[name])
    over = np.array([0.3, 0.2, 3 * radius])
    found = BallContact(body, radius).first_contact([over, over * [1, 1, -1]], [DOWN, -DOWN])
    np.testing.assert_allclose(found.centers[0, 2], radius, rtol=1e-12)
    if name != "non-manifold edges":
        np.testing.assert_allclose(found.centers[1, 2], -radius, rtol=1e-12)
    gap = distances(body.vertices[body.faces], found.centers)
    np.testing.assert_allclose(gap, radius, rtol=1e-9)


@pytest.mark.parametrize("name", MESHES)
def test_nearest_points_and_curvatures_survive_it(name: str) -> None:
    body = Surface(*MESHES[name])
    nearest = NearestPoint(body).query([[0.3, 0.2, 0.4]])
    np.testing.assert_allclose(nearest.points, [[0.3, 0.2, 0.0]], atol=1e-15)
    for method in ("jet", "libigl"):
        curvature = principal_curvatures(body, method=method)
        told = curvature.valid
        assert len(told) == len(body.vertices)
        assert np.isfinite(curvature.k1[told]).all() and np.isfinite(curvature.k2[told]).all()


def test_what_is_no_mesh_or_no_ball_is_refused() -> None:
    with pytest.raises(SurfaceError, match="vertices of shape"):
        Surface(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))
    with pytest.raises(SurfaceError, match="triangles of shape"):
        Surface(SQUARE, np.zeros((0, 3), dtype=int))
    for bad in (np.nan, np.inf, -np.inf):
        with pytest.raises(SurfaceError, match="must be finite; 1 of 4 are not, the first is vertex 2"):
            Surface(np.where(np.arange(4)[:, None] == 2, bad, SQUARE), HALVES)
    with pytest.raises(SurfaceError, match="indices from 0 to 4"):
        Surface(SQUARE, [[0, 1, 4]])
    for radius in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ContactError, match="positive length"):
            BallContact(Surface(SQUARE, HALVES), radius)
