"""Contacts against closed forms (theory section 4), for any radius and features from dust to larger than the ball."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bodies import extruded, grid, merged

from mapping.geometry.contact.first_contact import BallContact
from mapping.geometry.contact.interference_points import interference_points
from mapping.surface import Surface

DOWN = np.array([0.0, 0.0, -1.0])
RADII = [1e-9, 1e-2, 1.0, 1e3]
SIZES = [1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 10.0]  # relative to the radius
X = np.concatenate([np.linspace(-3, 3, 25), np.geomspace(1e-13, 1, 14), -np.geomspace(1e-13, 1, 14)])


def heights(body: Surface, radius: float, x: np.ndarray) -> np.ndarray:
    """Heights of the centre over x (relative to the radius), in radii."""
    start = np.column_stack([x * radius, np.full(len(x), 1e-3 * radius), np.full(len(x), 999.0 * radius)])
    return BallContact(body, radius).first_contact(start, DOWN).centers[:, 2] / radius


def chord(x: np.ndarray, radius: float = 1.0) -> np.ndarray:
    """Height of a circle over x; NaN beside it."""
    with np.errstate(invalid="ignore"):
        return np.sqrt((radius - x) * (radius + x))


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("size", SIZES)
def test_sphere_and_capsule_are_the_point_and_the_segment_under_a_larger_ball(radius: float, size: float) -> None:
    tip = (1.0 + size) * radius
    x = X[np.abs(np.abs(X) / (1.0 + size) - 1.0) > 1e-6] / (1.0 + size)  # else x has too few digits for the height
    seen = heights(Surface([[0, 0, 0]], [[0, 0, 0]]), tip, x)
    np.testing.assert_allclose(seen, chord(np.hypot(x, 1e-3)), atol=1e-12)
    wire = Surface(np.array([[0, -9, 0], [0, 9, 0]]) * tip, [[0, 1, 1]])
    np.testing.assert_allclose(heights(wire, tip, x), chord(x), atol=1e-12)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("size", SIZES)
def test_groove(radius: float, size: float) -> None:
    half = size / 2
    body = extruded(
        np.array([(-40, 0), (-half, 0), (-half, -50), (half, -50), (half, 0), (40, 0)]) * radius, 20 * radius
    )
    inside = np.abs(X) < half
    if half < 1.0:
        expected = np.where(inside, chord(half - np.abs(X)), 1.0)
    else:
        fits = np.abs(X) < half - 1.0
        expected = np.where(fits, -49.0, np.where(inside, chord(np.maximum(half - np.abs(X), 0.0)), 1.0))
    away = np.abs(np.abs(X) - (half - 1.0)) > 1e-6  # beside the wall that it grazes
    np.testing.assert_allclose(heights(body, radius, X)[away], expected[away], atol=1e-12)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("size", SIZES)
def test_step(radius: float, size: float) -> None:
    body = extruded(np.array([(-40, 0), (0, 0), (0, size), (40, size)]) * radius, 20 * radius)
    with np.errstate(invalid="ignore"):
        expected = np.where(X >= 0, 1.0 + size, np.fmax(1.0, size + chord(X)))
    away = np.abs(X + 1.0) > 1e-6
    np.testing.assert_allclose(heights(body, radius, X)[away], expected[away], atol=1e-12)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("slope", [1e-6, 1e-3, 0.1, 1.0, 10.0])
def test_v_groove(radius: float, slope: float) -> None:
    body = extruded(np.array([(-40, 40 * slope), (0, 0), (40, 40 * slope)]) * radius, 20 * radius)
    expected = np.hypot(1.0, slope) + slope * np.abs(X)
    np.testing.assert_allclose(heights(body, radius, X), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("size", SIZES)
def test_wire_on_a_plane(radius: float, size: float) -> None:
    """A wire of radius a under a ball r: the segment in its axis under a ball R = r + a."""
    a = size / 2
    big = 1.0 + a
    axis = Surface(np.array([[0, -20, 0], [0, 20, 0]]) * radius, [[0, 1, 1]])
    floor = grid(*np.broadcast_arrays(*np.meshgrid([-40.0, 40.0], [-20.0, 20.0], indexing="ij"), 0.0))
    floor = Surface(
        floor.vertices * radius, floor.faces
    )  # the plane below the axis of a segment: its parallel by r - a
    seen = np.fmax(
        heights(axis, big * radius, X / big) * big + a,
        heights(floor, radius, X),
    )
    stable = 2 * a - X**2 / (big + chord(X, big))
    np.testing.assert_allclose(seen, 1.0 + np.fmax(stable, 0.0), atol=1e-12)


def test_a_polygonal_wire_converges_to_the_round_one_with_the_square_of_its_corners() -> None:
    errors = []
    for corners in (32, 64, 128):
        angle = 2 * np.pi * np.arange(corners + 1) / corners
        prism = extruded(np.column_stack([-0.3 * np.cos(angle), 0.3 * np.sin(angle)]), 5.0)
        x = np.linspace(-0.9, 0.9, 301)
        errors.append(np.abs(heights(prism, 1.0, x) - chord(x, 1.3)).max())
    rate = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(rate, 2.0, atol=0.2)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("size", [1e-3, 0.05, 0.7, 1.9])
def test_the_interference_point_of_a_groove_is_its_middle(radius: float, size: float) -> None:
    half = size / 2
    body = extruded(np.array([(-9, 0), (-half, 0), (-half, -9), (half, -9), (half, 0), (9, 0)]) * radius, 5 * radius)
    path = np.array([[-2.0, 0, 2.0], [2.03, 0, 2.0]]) * radius
    found = interference_points(BallContact(body, radius), path, DOWN, min(0.11, half) * radius)
    assert found.count.tolist() == [2]
    np.testing.assert_allclose(found.centers / radius, [[0.0, 0.0, np.sqrt(1 - half**2)]], atol=1e-9)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("size", [1e-6, 1e-3, 0.05, 0.9])
def test_the_interference_point_before_a_step(radius: float, size: float) -> None:
    body = extruded(np.array([(-9, 0), (0, 0), (0, size), (9, size)]) * radius, 5 * radius)
    path = np.array([[-3.0, 0, 2.0], [2.03, 0, 2.0]]) * radius
    found = interference_points(BallContact(body, radius), path, DOWN, 0.11 * radius)
    assert found.count.tolist() == [2]
    np.testing.assert_allclose(found.centers / radius, [[-np.sqrt(size * (2 - size)), 0, 1.0]], atol=1e-9)


def test_both_interference_points_beside_a_ridge_are_found() -> None:
    floor = extruded([(-9, 0), (9, 0)], 5.0)
    wall = Surface([[0, -5, 0], [0, 5, 0], [0, -5, 0.1], [0, 5, 0.1]], [[0, 1, 2], [1, 3, 2]])
    found = interference_points(BallContact(merged(floor, wall), 1.0), [[-3, 0, 2], [3.1, 0, 2]], DOWN, 0.2)
    reach = np.sqrt(0.2 - 0.01)
    np.testing.assert_allclose(found.centers, [[-reach, 0, 1], [reach, 0, 1]], atol=1e-9)


def test_a_convex_path_has_no_interference_points() -> None:
    wire = Surface([[0, -5, 0], [0, 5, 0]], [[0, 1, 1]])
    assert len(interference_points(BallContact(wire, 1.0), [[-0.9, 0, 2], [0.9, 0, 2]], DOWN, 0.1)) == 0
