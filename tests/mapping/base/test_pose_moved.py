"""A base after a rigid motion answers as if it had been built there."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from explore3d.bench.scenes.bodies import blob, sphere_mesh
from mapping.base.base import Base
from mapping.base.pose import Pose
from mapping.surface import Surface

TIP = 0.01

STANDS = Pose(np.eye(3), np.zeros(3), np.zeros(3), np.eye(6)).record()


@pytest.fixture(scope="module")
def bases() -> tuple[Base, Base]:
    unit, faces = sphere_mesh(3)
    base = Base(Surface(blob(unit), faces))
    rotation = Rotation.from_rotvec([0.3, -0.7, 0.2]).as_matrix()
    moved = base.moved(rotation, np.array([0.02, -0.01, 0.05]), STANDS)
    return moved, Base(Surface(moved.surface.vertices, moved.surface.faces))


def test_nearest_points_and_heights_agree_with_those_of_a_new_base(bases: tuple[Base, Base]) -> None:
    moved, built = bases
    points = np.random.default_rng(0).uniform(-0.1, 0.15, (500, 3))
    for name in ("points", "normals", "height"):
        np.testing.assert_allclose(
            getattr(moved.foot(points, TIP), name), getattr(built.foot(points, TIP), name), atol=1e-12
        )
    near, again = (base.nearest.query(points) for base in bases)
    np.testing.assert_array_equal(near.side, again.side)


def test_what_is_known_of_the_shape_agrees_with_that_of_a_new_surface(bases: tuple[Base, Base]) -> None:
    moved, built = bases
    for name in ("face_normals", "face_areas"):
        np.testing.assert_allclose(getattr(moved.surface, name), getattr(built.surface, name), atol=1e-12)
    np.testing.assert_array_equal(moved.surface.neighbours, built.surface.neighbours)
    np.testing.assert_allclose(moved.edge_normals, built.edge_normals, atol=1e-12)
    assert moved.pose == STANDS and Base.read(moved.surface, moved.kind, moved.record()).pose == STANDS
