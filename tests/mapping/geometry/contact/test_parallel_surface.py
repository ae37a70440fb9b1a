"""The parallel surface and its caustic points, against spheres and the bump of revolution."""

import numpy as np
import pytest

from mapping.errors import ParallelError
from mapping.geometry.contact.parallel_surface import parallel_surface
from mapping.geometry.templates.bump_of_revolution import BumpOfRevolution
from mapping.surface import Surface


def on_bump(a, r, rings):
    bump = BumpOfRevolution(a)
    mesh = bump.mesh(1.0, rings, 4 * rings)
    u = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1])
    v = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    radial, axial = bump.normal(u)
    normals = np.column_stack([radial * np.cos(v), radial * np.sin(v), axial])
    return bump, parallel_surface(mesh, r, normals, *bump.curvatures(u))


def caustic_error(rings):
    bump, parallel = on_bump(15.0, 1.0, rings)
    expected = np.column_stack(bump.parallel(bump.caustics(1.0), 1.0))
    found = np.column_stack([np.hypot(*parallel.caustics[:, :2].T), parallel.caustics[:, 2]])
    return np.linalg.norm(found[:, None] - expected[None], axis=2).min(axis=1).max()


def test_caustics_of_the_bump_lie_on_its_two_circles():
    bump, parallel = on_bump(15.0, 1.0, 100)
    radius = bump.parallel(bump.caustics(1.0), 1.0)[0]
    found = np.hypot(*parallel.caustics[:, :2].T)
    for circle in radius:
        assert (np.abs(found - circle) < 0.01).sum() >= 400


@pytest.mark.parametrize("rings", [50, 100, 200])
def test_caustics_converge_with_the_square_of_the_mesh_size(rings):
    # Linear interpolation leaves h^2 / 8 of the parallel meridian's second derivative, about 20 at the caustics.
    assert caustic_error(rings) < 20 / 8 / rings**2


def test_between_the_caustics_the_surface_is_inside_out():
    bump, parallel = on_bump(15.0, 1.0, 80)
    u = np.linalg.norm(parallel.surface.vertices[:, :2], axis=1)
    inner, outer = bump.caustics(1.0)
    own = bump.mesh(1.0, 80, 320).vertices
    u = np.hypot(own[:, 0], own[:, 1])
    np.testing.assert_array_equal(parallel.reachable, (u <= inner) | (u >= outer))


def test_a_convex_body_has_no_caustics_outside_and_one_point_inside():
    axis = np.eye(3)
    vertices = np.vstack([axis, -axis])
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    octahedron = Surface(vertices, faces)
    outside = parallel_surface(octahedron, 0.5, vertices, np.ones(6), np.ones(6))
    assert len(outside.caustics) == 0
    assert outside.reachable.all()
    np.testing.assert_allclose(np.linalg.norm(outside.surface.vertices, axis=1), 1.5)
    assert not parallel_surface(octahedron, -1.5, vertices, np.ones(6), np.ones(6)).reachable.any()


def test_arrays_that_do_not_fit_the_mesh_are_refused():
    mesh = BumpOfRevolution().mesh(1.0, 3, 6)
    with pytest.raises(ParallelError, match="belong to the 19 vertices"):
        parallel_surface(mesh, 1.0, np.zeros((3, 3)), np.zeros(19), np.zeros(19))
    with pytest.raises(ParallelError, match="finite"):
        parallel_surface(mesh, 1.0, np.zeros((19, 3)), np.full(19, np.nan), np.zeros(19))
