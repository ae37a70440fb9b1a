"""Contacts on random bad meshes: whatever the mesh, the ball comes as far as it can and no further."""

from __future__ import annotations

import numpy as np
import pytest
from brute_force_contact import distances
from hypothesis import HealthCheck, given, settings, strategies as st

from mapping.geometry.contact.first_contact import BallContact
from mapping.surface import Surface


@st.composite
def bad_meshes(draw: st.DrawFn) -> Surface:
    """Few coordinates and any faces: degenerate, doubled, flipped, non-manifold, coplanar, touching, scattered."""
    count = draw(st.integers(1, 12))
    coordinate = st.integers(-3, 3) | st.floats(-3, 3, width=32)
    vertices = draw(st.lists(st.tuples(*[coordinate] * 3), min_size=count, max_size=count))
    corner = st.integers(0, count - 1)
    faces = draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=40))
    squeeze = draw(st.sampled_from([1.0, 1e-3, 1e-9]))  # needles
    return Surface(np.array(vertices, dtype=float) * [1.0, 1.0, squeeze], np.array(faces))


RADII = st.sampled_from([1e-3, 0.1, 0.5, 1.0, 3.0, 100.0])
COMPONENTS = st.integers(-2, 2) | st.floats(-2, 2, width=32)
DIRECTIONS = st.tuples(COMPONENTS, COMPONENTS, COMPONENTS).filter(lambda d: np.linalg.norm(d) > 1e-6)
SETTINGS = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large]}


def check(body: Surface, radius: float, origin: tuple[float, ...], direction: tuple[float, ...]) -> None:
    d = np.array(direction) / np.linalg.norm(direction)
    corners, start = body.vertices[body.faces], np.array(origin, dtype=float)
    contact = BallContact(body, radius).first_contact(start[None], d)
    slack = 1e-9 * radius + 1e-13 * (body.size + np.linalg.norm(start))
    if contact.overlap[0]:
        assert distances(corners, start[None])[0] < radius and contact.count[0] == 0
        return
    end = min(contact.distance[0], np.abs(start).sum() + 2 * np.abs(body.vertices).sum(axis=1).max() + 2 * radius)
    way = start + np.concatenate([np.linspace(0, end, 60), end * (1 - np.geomspace(1e-9, 1, 20))])[:, None] * d
    assert distances(corners, way).min() >= radius - slack
    if contact.count[0]:
        assert abs(distances(corners, contact.centers)[0] - radius) <= slack
        assert contact.normals[0] @ d <= 1e-7
        assert contact.feature[0] in (1, 2, 3)


@settings(max_examples=150, **SETTINGS)
@given(bad_meshes(), RADII, st.tuples(*[st.integers(-6, 6)] * 3), DIRECTIONS)
def test_the_ball_touches_and_never_sinks_in(
    body: Surface, radius: float, origin: tuple[float, ...], direction: tuple[float, ...]
) -> None:
    check(body, radius, origin, direction)


@pytest.mark.slow
@settings(max_examples=5000, **SETTINGS)
@given(bad_meshes(), RADII, st.tuples(*[st.floats(-6, 6)] * 3), DIRECTIONS)
def test_the_ball_touches_and_never_sinks_in_at_length(
    body: Surface, radius: float, origin: tuple[float, ...], direction: tuple[float, ...]
) -> None:
    check(body, radius, origin, direction)


@settings(max_examples=100, **SETTINGS)
@given(bad_meshes(), RADII, st.tuples(*[st.integers(-6, 6)] * 3), DIRECTIONS)
def test_a_pressed_ball_rests_without_sinking_in(
    body: Surface, radius: float, origin: tuple[float, ...], direction: tuple[float, ...]
) -> None:
    start = np.array(origin, dtype=float)
    rest = BallContact(body, radius).press(start[None], direction)
    assert not rest.overlap.any()
    if rest.count[0]:
        slack = 1e-9 * radius + 1e-12 * (body.size + radius + np.linalg.norm(start))
        assert abs(distances(body.vertices[body.faces], rest.centers)[0] - radius) <= slack
