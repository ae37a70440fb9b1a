"""The paper's bump against differences of its own formula."""

import numpy as np
import pytest

from mapping.errors import MappingError
from mapping.geometry.templates.bump_of_revolution import BumpOfRevolution


@pytest.mark.parametrize("a", [1.0, 15.0, 1000.0])
def test_curvatures_agree_with_differences_of_the_meridian(a):
    bump, u, h = BumpOfRevolution(a), np.linspace(0.01, 1.5, 300), 1e-4 / np.sqrt(a)
    first = (bump.height(u + h) - bump.height(u - h)) / (2 * h)
    second = (bump.height(u + h) - 2 * bump.height(u) + bump.height(u - h)) / h**2
    radial, around = bump.curvatures(u)
    np.testing.assert_allclose(radial, -second / (1 + first**2) ** 1.5, atol=1e-5 * a)
    np.testing.assert_allclose(around, -first / (u * np.sqrt(1 + first**2)), atol=1e-5 * a)


def test_the_crest_is_an_umbilic_of_curvature_2a():
    radial, around = BumpOfRevolution(15.0).curvatures([0.0])
    np.testing.assert_allclose([radial[0], around[0]], [30.0, 30.0])


@pytest.mark.parametrize("r", [0.1, 1.0, 5.0])
def test_the_parallel_surface_keeps_its_distance_and_direction(r):
    bump, u = BumpOfRevolution(15.0), np.linspace(0, 2, 50)
    x, z = bump.parallel(u, r)
    np.testing.assert_allclose(np.hypot(x - u, z - bump.height(u)), r, rtol=1e-14)
    slope = np.gradient(bump.height(u), u, edge_order=2)
    assert np.abs((x - u) + slope * (z - bump.height(u)))[5:-5].max() < 2e-2 * r


def test_the_paper_figure_3_has_three_curvature_features():
    u = np.linspace(-1.5, 1.5, 20001)
    k, threshold = BumpOfRevolution(15.0).curvatures(np.abs(u))[0], 1.0
    signs = np.where(k > threshold, 1, np.where(k < -threshold, -1, 0))
    runs = signs[np.r_[True, np.diff(signs) != 0]]
    assert list(runs[runs != 0]) == [-1, 1, -1]


@pytest.mark.parametrize(("a", "r"), [(15.0, 1.0), (1000.0, 1.0), (15.0, 2.0), (1000.0, 0.2)])
def test_caustics_are_where_the_parallel_meridian_turns_back(a, r):
    bump = BumpOfRevolution(a)
    caustics = bump.caustics(r)
    assert len(caustics) == 2
    radial, _ = bump.curvatures(caustics)
    np.testing.assert_allclose(1 + r * radial, 0, atol=1e-9)
    for u in caustics:
        steps = np.diff(bump.parallel(u + np.array([-2e-4, -1e-4, 1e-4, 2e-4]) * u, r)[0])
        assert steps[0] * steps[-1] < 0


def test_a_tip_finer_than_the_bump_meets_no_caustic():
    assert len(BumpOfRevolution(15.0).caustics(1e-3)) == 0
    assert BumpOfRevolution(15.0).interference(1e-3) is None


@pytest.mark.parametrize("a", [15.0, 1000.0])
def test_at_the_interference_point_one_ball_touches_twice(a):
    bump = BumpOfRevolution(a)
    flank, plain = bump.interference(1.0)
    (x1, x2), (z1, z2) = bump.parallel([flank, plain], 1.0)
    np.testing.assert_allclose([x1, z1], [x2, z2], atol=1e-9)
    u = np.linspace(0, 4, 20001)
    assert np.hypot(u - x1, bump.height(u) - z1).min() >= 1 - 1e-9


def test_the_mesh_lies_on_the_bump_and_faces_outward():
    bump = BumpOfRevolution(15.0)
    mesh = bump.mesh(1.0, rings=30, sectors=60)
    assert len(mesh.vertices) == 30 * 60 + 1
    np.testing.assert_allclose(mesh.vertices[:, 2], bump.height(np.hypot(*mesh.vertices[:, :2].T)), atol=1e-15)
    assert (mesh.face_normals[:, 2] > 0).all()


@pytest.mark.parametrize("a", [0.0, -1.0, np.nan, np.inf])
def test_a_sharpness_that_is_none_is_refused(a):
    with pytest.raises(MappingError, match="positive"):
        BumpOfRevolution(a)


def test_a_mesh_of_no_rings_is_refused():
    with pytest.raises(MappingError, match="rings"):
        BumpOfRevolution().mesh(1.0, rings=0)


@pytest.mark.parametrize("sharpness", [1e4, 1e6, 1e9])
@pytest.mark.parametrize("tip_radius", [0.1, 1.0])
def test_the_kink_beside_a_needle_is_found_to_the_last_digits(sharpness: float, tip_radius: float) -> None:
    bump = BumpOfRevolution(sharpness)
    pair = bump.interference(tip_radius)
    assert pair is not None
    there, beyond = (bump.parallel(u, tip_radius) for u in pair)
    np.testing.assert_allclose(there, beyond, rtol=1e-12)
