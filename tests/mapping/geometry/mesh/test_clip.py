"""Clip: the part of a mesh in a box, against what is known of blocks and spheres."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.geometry.mesh import clipped
from mapping.surface import Surface


def block() -> Surface:
    """A cube of side 1, two triangles a side, one corner in the origin."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Surface(corners, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def test_a_box_inside_a_side_cuts_a_rectangle_out_of_its_triangles() -> None:
    part = clipped(block(), np.array([0.2, 0.3, 0.5]), np.array([0.6, 0.5, 2.0]))
    assert part is not None
    assert np.allclose(part.bounds, [[0.2, 0.3, 1.0], [0.6, 0.5, 1.0]])
    assert part.face_areas.sum() == pytest.approx(0.4 * 0.2)
    assert np.allclose(part.face_normals, [0, 0, 1])


def test_the_halves_of_a_body_have_all_of_its_surface_and_one_border_each() -> None:
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=3)
    whole = Surface(ball.vertices, ball.faces)
    halves = [
        clipped(whole, np.array([-2.0, -2.0, low]), np.array([2.0, 2.0, high])) for low, high in ((-2, 0.1), (0.1, 2))
    ]
    areas = [half.face_areas.sum() for half in halves if half is not None]
    assert sum(areas) == pytest.approx(whole.face_areas.sum())
    for half in halves:
        assert half is not None
        own = Surface(half.vertices, half.faces)  # its normals by its corners: the winding is kept
        outward = (own.face_normals * half.vertices[half.faces].mean(axis=1)).sum(axis=1)
        assert (outward[own.face_areas > 1e-9] > 0.9).all()
        # neighbours share their cuts: every side that belongs to one face alone lies in the plane
        face, corner = np.nonzero(half.open_sides)
        border = [half.faces[face, (corner + step) % 3] for step in (1, 2)]
        assert len(face) and np.allclose(half.vertices[border][..., 2], 0.1)


def test_what_no_plane_cuts_stays_as_it_is() -> None:
    whole = block()
    assert clipped(whole, np.zeros(3), np.ones(3)) is whole
    top = clipped(whole, np.array([0.0, 0.0, 1.0]), np.array([1.0, 1.0, 2.0]))
    assert top is not None and np.array_equal(top.vertices, whole.vertices[whole.vertices[:, 2] == 1.0])
    assert len(top.faces) == 2


def test_a_side_drawn_in_a_plane_of_the_box_belongs_to_it_though_its_file_held_32_bit_numbers() -> None:
    height = float(np.float32(7.3e-3))
    whole = Surface(block().vertices * height, block().faces)
    assert height != 7.3e-3
    for low, high in ((7.3e-3, 1.0), (1e-3, 7.3e-3)):
        part = clipped(whole, np.array([1e-3, 1e-3, low]), np.array([2e-3, 2e-3, high]))
        assert part is not None and part.face_areas.sum() == pytest.approx(1e-6)


def test_a_box_without_surface_holds_none() -> None:
    within, beside = np.array([0.4, 0.6]), np.array([1.5, 2.0])
    for low, high in (within, beside):
        assert clipped(block(), np.full(3, low), np.full(3, high)) is None
