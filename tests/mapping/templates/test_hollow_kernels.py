"""Hollows in a cylinder: their closed forms against exact contact with a finely faceted one."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray, Surface
from mapping.geometry.contact import BallContact
from mapping.geometry.templates import groove_heights, pit_heights, section_heights, step_heights

WALL = 40e-3
TIP = 4e-3
# Facets of 27 um along the cylinder's round, 10 um where rims are: a chord lies 2 nm, a rim 10 um beside its place.
FINE = 1e-5


def knots(rims: list[float]) -> FloatArray:
    """Places from -9 to 9 mm, with a wall 10 nm wide at each rim."""
    walls = np.concatenate([np.array(rims) - 0.5e-8, np.array(rims) + 0.5e-8])
    return np.sort(np.concatenate([np.linspace(-9e-3, 9e-3, 661), walls]))


def felt(u: FloatArray, z: FloatArray, heights: FloatArray, at: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Heights over a cylinder about z at which the ball rests, at arclengths and heights `at`, pressed radially."""
    angle, level = np.meshgrid(u / WALL, z, indexing="ij")
    radius = WALL + heights
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), level], axis=-1).reshape(-1, 3)
    corner = (np.arange(len(u) - 1)[:, None] * len(z) + np.arange(len(z) - 1)).ravel()
    other = corner + len(z)
    faces = np.concatenate(
        [np.column_stack([corner, other, other + 1]), np.column_stack([corner, other + 1, corner + 1])]
    )
    turn = at[0] / WALL
    out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(len(turn))])
    start = (WALL + 3 * TIP) * out + np.column_stack([np.zeros((len(turn), 2)), at[1]])
    centers = BallContact(Surface(points, faces), TIP).first_contact(start, -out).centers
    return np.asarray(np.hypot(centers[:, 0], centers[:, 1]) - WALL - TIP)


def inside(places: FloatArray, half: float) -> FloatArray:
    return np.abs(places) < half


@pytest.mark.parametrize("lengthwise", [True, False], ids=["along the axis", "round the axis"])
def test_a_groove_ends_as_its_own_direction_is_bent(lengthwise: bool) -> None:
    half, depth, end = 1.5e-3, 0.25e-3, 4e-3
    u, z = (knots([-half, half]), knots([-end, end])) if lengthwise else (knots([-end, end]), knots([-half, half]))
    limits = (half, end) if lengthwise else (end, half)
    cut = np.where(inside(u, limits[0])[:, None] & inside(z, limits[1]), -depth, 0.0)
    s, aside = (each.ravel() for each in np.meshgrid(np.linspace(1e-3, 4.2e-3, 33), np.linspace(0.0, 1.8e-3, 7)))
    true = felt(u, z, cut, (aside, s) if lengthwise else (s, aside))

    # chords stand for arclengths round the axis, as they do where a trace lies on its base
    s, aside = (s, WALL * np.sin(aside / WALL)) if lengthwise else (WALL * np.sin(s / WALL), aside)
    bends = [np.full((len(s), 1), each) for each in ((1 / WALL, 0.0) if lengthwise else (0.0, 1 / WALL))]
    out = np.empty((1, len(s)))
    nothing, places = np.zeros((2, 0, len(s), 1)), (s[:, None], aside[:, None])
    ends, size = np.array([[-end, end]]), (np.array([2 * half]), np.array([depth]))
    groove_heights(*places, nothing, *bends, np.zeros((1, 0)), ends, np.zeros(1), *size, TIP, out)
    # a chord at the rim is longer by what is felt over the radius of the cylinder, 0.6 %, than one at the bottom
    np.testing.assert_allclose(out[0], true, atol=2.5e-6)


def test_a_groove_that_a_cutter_left_ends_as_half_a_pit() -> None:
    rng = np.random.default_rng(3)
    width, depth, end = 3e-3, 0.09e-3, 10e-3
    x, y = rng.uniform(-3e-3, 3e-3, (2, 500, 1))
    bends, flat = np.array([20.0, -15.0]), np.zeros((2, 0, 500, 1))
    size = np.array([width]), np.array([depth])
    groove, pit = np.empty((1, 500)), np.empty((1, 500))
    places = end - 0.5 * width + x, y, flat, np.full((500, 1), bends[1]), np.full((500, 1), bends[0]), np.zeros((1, 0))
    groove_heights(*places, np.array([[0.0, end]]), np.array([0.5 * width]), *size, TIP, groove)
    pit_heights(x, y, bends, np.zeros((1, 2)), *size, TIP, pit)
    beyond = x[:, 0] > 0.0
    np.testing.assert_allclose(groove[0, beyond], pit[0, beyond], atol=1e-18)
    assert (pit[0, beyond] < 0.0).sum() > 50
    # before its end it is as wide as it is
    inside = ~beyond & (np.abs(y[:, 0]) < 0.5 * width)
    assert groove[0, inside].max() < 0.0 and not groove[0, ~beyond & ~inside].any()


def test_a_pit_is_shallower_where_its_wall_is_straight() -> None:
    half, depth = 1.2e-3, 1e-3
    u, z = np.linspace(-4e-3, 4e-3, 801), np.linspace(-4e-3, 4e-3, 801)
    cut = np.where(np.hypot(u[:, None], z) < half, -depth, 0.0)
    turn = np.radians(np.repeat([0.0, 90.0], 9))
    away = np.tile(np.linspace(0.2e-3, 1.0e-3, 9), 2)
    x, y = away * np.cos(turn), away * np.sin(turn)
    true = felt(u, z, cut, (x, y))
    out = np.empty((1, len(x)))
    pit_heights(x[:, None], y[:, None], np.array([1 / WALL, 0.0]), np.zeros((1, 2)), np.array([2 * half]),
                np.array([depth]), TIP, out)  # fmt: skip
    # the rim of the facets is jagged by their size, 10 um, on a slope of 0.25
    np.testing.assert_allclose(out[0], true, atol=3e-6)


def test_an_edge_along_the_axis_falls_with_the_wall() -> None:
    height = 0.3e-3
    u = knots([0.0])
    z = np.linspace(-6e-3, 6e-3, 13)
    true_at = np.linspace(-2e-3, 0.5e-3, 51)
    true = felt(u, z, np.repeat(np.where(u > 0.0, height, 0.0)[:, None], 13, axis=1), (true_at, np.zeros(51)))
    out = np.empty((1, 51))
    lateral = WALL * np.sin(true_at / WALL)[:, None]
    straight = np.zeros((2, 0, 51, 1)), np.full((51, 1), 1 / WALL), np.zeros((1, 0))
    step_heights(lateral, *straight, np.array([height]), np.zeros(1), 1.0, TIP, out)
    np.testing.assert_allclose(out[0], true, atol=5e-6)


@pytest.mark.parametrize("lengthwise", [True, False], ids=["along the axis", "round the axis"])
def test_a_bar_ends_as_its_own_direction_is_bent(lengthwise: bool) -> None:
    half, height, end = 1.0e-3, 0.3e-3, 2e-3
    u, z = (knots([-half, half]), knots([-end, end])) if lengthwise else (knots([-end, end]), knots([-half, half]))
    limits = (half, end) if lengthwise else (end, half)
    raised = np.where(inside(u, limits[0])[:, None] & inside(z, limits[1]), height, 0.0)
    s, aside = (each.ravel() for each in np.meshgrid(np.linspace(1.5e-3, 3.8e-3, 24), np.linspace(0.0, 2.5e-3, 9)))
    true = felt(u, z, raised, (aside, s) if lengthwise else (s, aside))
    bends = [np.full((len(s), 1), each) for each in ((1 / WALL, 0.0) if lengthwise else (0.0, 1 / WALL))]
    out = np.empty((1, len(s)))
    across, up = np.array([[half, half + 1e-9]]), np.array([[height, 0.0]])
    places, nothing = (s[:, None], aside[:, None]), np.zeros((2, 0, len(s), 1))
    section_heights(
        *places,
        nothing,
        *bends,
        np.zeros((1, 0)),
        np.array([[-end, end]]),
        np.zeros(1),
        across,
        up,
        np.zeros(1),
        TIP,
        out,
    )
    np.testing.assert_allclose(out[0], true, atol=6e-6)
