"""Where courses leave a face of the body: at its sharp edges, exactly, whatever triangles meet there."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.base.base import Base
from mapping.errors import EmptyWindowError
from mapping.inference.curves.body_edge import up_to_edges
from mapping.inference.curves.chart import chart_along
from mapping.surface import Surface

TIP = 3e-3
UP = np.array([0.0, 0.0, 1.0])
# Half of a box, m
BOX = np.array([0.03, 0.02, 0.004])


def box() -> Base:
    """Its top is z = 0."""
    corners = BOX * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) - BOX * UP
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))]
    return Base(Surface(corners, faces))


def chart(start: list[float], stop: list[float], extension: float = 0.012):
    axis = 1e-3 * np.array([start, stop])
    return chart_along(axis, np.tile(UP, (2, 1)), box(), TIP, 1.0, extension, 2e-3)


def test_a_course_ends_where_it_crosses_an_edge_at_a_slant() -> None:
    laid = chart([0.0, 0.0, 0.0], [6.0, 12.0, 0.0])
    assert laid.points[-1] == pytest.approx([0.010, 0.020, 0.0], abs=1e-12)
    assert laid.walls[0] is None
    assert laid.walls[1] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)


def test_an_axis_that_was_drawn_down_the_wall_ends_at_the_edge() -> None:
    laid = chart([4.0, 20.0, -2.0], [-4.0, 6.0, 0.0])
    assert laid.points[0] == pytest.approx([4e-3, 0.020, 0.0], abs=1e-9)
    assert laid.walls[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)


def test_what_was_felt_along_the_edge_is_no_part_of_the_course_and_does_not_tilt_it() -> None:
    line = 1e-3 * np.array([[0.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 20.0, 0.0], [1.5, 20.0, 0.0]])
    leaning = np.array([0.0, 0.6, 0.8])
    laid = up_to_edges(line, np.stack([UP, UP, leaning, leaning]), box(), TIP)
    assert laid.line[-1] == pytest.approx([0.0, 0.020, 0.0], abs=1e-9)
    assert laid.lift[-1] == pytest.approx(UP)
    assert len(laid.line) < len(line) + 1 and (laid.line[:, 0] == 0.0).all()


def test_a_course_that_meets_no_edge_goes_on() -> None:
    laid = chart([-5.0, 0.0, 0.0], [5.0, 0.0, 0.0])
    assert laid.walls == (None, None)
    assert laid.points[[0, -1], 0] == pytest.approx([-0.017, 0.017])


def test_a_course_along_an_edge_crosses_none() -> None:
    line = 1e-3 * np.linspace([-10.0, 20.0, 0.0], [10.0, 20.0, 0.0], 5)
    assert up_to_edges(line, np.tile(UP, (5, 1)), box(), TIP).walls == (None, None)


def test_an_edge_is_found_where_triangles_touch_it_with_a_corner_alone() -> None:
    turn = 2.0 * np.pi * np.arange(90) / 90
    ring = 0.02 * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    height = 0.01 * UP
    vertices = np.vstack([ring - height, ring, ring + height, -height, height])
    here, ahead = np.arange(90), np.roll(np.arange(90), -1)
    side = [
        np.column_stack(each)
        for low in (0, 90)
        for each in ((low + here, low + ahead, low + 90 + ahead), (low + here, low + 90 + ahead, low + 90 + here))
    ]
    caps = [np.column_stack([ahead, here, here * 0 + 270]), np.column_stack([180 + here, 180 + ahead, here * 0 + 271])]
    axis = np.array([[0.02, 0.0, -0.002], [0.02, 0.0, 0.004]])
    normals = np.tile([1.0, 0.0, 0.0], (2, 1))
    base = Base(Surface(vertices, np.vstack([*side, *caps])))
    laid = up_to_edges(np.vstack([axis, [[0.02, 0.0, 0.016]]]), np.vstack([normals, normals[:1]]), base, TIP)
    assert laid.line[-1] == pytest.approx([0.02, 0.0, 0.01], abs=1e-9)
    assert laid.walls[1] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


def test_an_axis_of_one_place_has_no_chart() -> None:
    with pytest.raises(EmptyWindowError, match="are one"):
        chart([3.0, 2.0, 0.0], [3.0, 2.0, 0.0])
