"""Closed-form traces against geometry computed another way."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.ndimage import grey_dilation

from mapping.errors import ShapeError
from mapping.geometry.templates.shapes import (
    cap_height,
    chain_height,
    contact_half_width,
    groove_height,
    kink_angle,
    rim_height,
    sphere_height,
    step_height,
    untouched_run,
)

TIP = 10e-3
D = 0.65e-3


def plane(x, y):
    feet = np.column_stack([x, y, np.zeros_like(x)])
    return feet, np.tile([0.0, 0.0, 1.0], (len(feet), 1))


def test_the_papers_wire_has_its_kink_and_angle():
    assert contact_half_width(D, D / 2, TIP) == pytest.approx(3.606e-3, abs=1e-6)
    assert np.rad2deg(kink_angle(D, D / 2, TIP)) == pytest.approx(20.44, abs=5e-3)
    assert kink_angle(D, D / 2, TIP) == pytest.approx(2 * np.arctan(np.sqrt(D / 2 / TIP)), rel=1e-12)


def test_a_cap_equals_the_circle_about_its_centre():
    x = np.linspace(-6e-3, 6e-3, 501)
    radius, height = 2e-3, 0.4e-3
    center = height - radius
    ball = center + np.sqrt((radius + TIP) ** 2 - x**2) - TIP
    np.testing.assert_allclose(cap_height(x, height, radius, TIP), np.maximum(ball, 0), atol=1e-17)


def test_a_nanometre_on_a_metre_keeps_its_digits():
    x_c = contact_half_width(1e-9, 1e-3, 1.0)
    assert cap_height(x_c / 2, 1e-9, 1e-3, 1.0) == pytest.approx(0.75e-9, rel=1e-6)


def test_a_chain_of_one_long_segment_is_a_wire():
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-6e-3, 6e-3, 200), rng.uniform(-10e-3, 10e-3, 200)
    axis = np.array([[0, -0.1, D / 2], [0, 0.1, D / 2]])
    np.testing.assert_allclose(chain_height(*plane(x, y), axis, D / 2, TIP), cap_height(x, D, D / 2, TIP), atol=1e-15)


def test_splitting_a_segment_changes_nothing():
    rng = np.random.default_rng(2)
    feet, normals = plane(rng.uniform(-8e-3, 8e-3, 300), rng.uniform(-8e-3, 8e-3, 300))
    normals = normals + rng.normal(0, 0.1, normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ends = np.array([[-2e-3, -1e-3, 0.1e-3], [3e-3, 2e-3, 0.3e-3]])
    split = np.linspace(ends[0], ends[1], 7)
    np.testing.assert_allclose(
        chain_height(feet, normals, ends, D / 2, TIP), chain_height(feet, normals, split, D / 2, TIP), atol=1e-15
    )


def test_the_ball_touches_the_chain_exactly_and_never_cuts_it():
    rng = np.random.default_rng(3)
    feet, normals = plane(rng.uniform(-8e-3, 8e-3, 400), rng.uniform(-8e-3, 8e-3, 400))
    normals = normals + rng.normal(0, 0.2, normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    axis = rng.uniform(-4e-3, 4e-3, (5, 3)) * [1, 1, 0.1]
    t = chain_height(feet, normals, axis, 1e-3, TIP)
    centers = feet + (TIP + t)[:, None] * normals
    dense = np.concatenate([np.linspace(a, b, 4001) for a, b in itertools.pairwise(axis)])
    distance = np.array([np.linalg.norm(dense - c, axis=1).min() for c in centers])
    touching = t > 0
    assert touching.sum() > 100 and (~touching).sum() > 10
    np.testing.assert_allclose(distance[touching], TIP + 1e-3, atol=1e-9)
    assert (distance[~touching] >= TIP + 1e-3 - 1e-12).all()


def test_a_chain_of_one_vertex_is_a_sphere():
    rng = np.random.default_rng(4)
    feet, normals = plane(rng.uniform(-4e-3, 4e-3, 100), rng.uniform(-4e-3, 4e-3, 100))
    center = np.array([0.3e-3, 0, -1e-3])
    expected = cap_height(np.hypot(feet[:, 0] - 0.3e-3, feet[:, 1]), 0.5e-3, 1.5e-3, TIP)
    np.testing.assert_allclose(sphere_height(feet, normals, center, 1.5e-3, TIP), expected, atol=1e-15)
    np.testing.assert_allclose(chain_height(feet, normals, center, 1.5e-3, TIP), expected, atol=1e-15)


def test_a_groove_dips_by_b_squared_over_8r_and_stops_at_its_bottom():
    assert groove_height(0.0, 1e-3, TIP) == pytest.approx(-0.0125e-3, rel=1e-3)
    assert groove_height(0.0, 1e-3, TIP) == pytest.approx(-(TIP - np.sqrt(TIP**2 - 0.25e-6)), rel=1e-9)
    assert groove_height(0.0, 1e-3, TIP, depth=5e-6) == -5e-6
    assert groove_height(0.51e-3, 1e-3, TIP) == 0.0
    assert rim_height(11e-3, TIP, depth=3e-3) == -3e-3


def test_a_groove_along_a_cylinder_is_deeper_by_the_cylinders_sag():
    bend, half = 0.05, 1e-3
    angle = half / bend
    edge = bend * np.array([np.sin(angle), np.cos(angle)])
    center = edge[1] + np.sqrt(TIP**2 - edge[0] ** 2)
    exact = center - bend - TIP
    assert groove_height(0.0, 2 * half, TIP, base_curvature=1 / bend) == pytest.approx(exact, rel=1e-3)


def test_a_step_kinks_where_theory_says():
    h = 0.5e-3
    kink = np.sqrt(2 * TIP * h - h**2)
    x = np.array([-kink * 1.001, -kink * 0.999, -1e-9, 0.0, 5e-3])
    s = step_height(x, h, TIP)
    assert s[0] == 0.0 and 0 < s[1] < 2e-6
    np.testing.assert_allclose(s[2:], h, rtol=1e-9)


@pytest.mark.parametrize(("height", "run"), [(0.3e-3, 2e-3), (0.3e-3, 0.4e-3), (0.7e-3, 0.5e-3), (0.05e-3, 4e-3)])
def test_a_slanted_step_is_the_dilation_of_its_flank(height, run):
    tip, fine = 0.5e-3, 1e-6
    x = fine * np.arange(-4000, 4001)
    ball = np.sqrt(tip**2 - (fine * np.arange(-499, 500)) ** 2) - tip
    felt = grey_dilation(height * np.clip(x / run + 0.5, 0.0, 1.0), structure=ball, mode="nearest")
    inner = np.abs(x) < 3e-3
    # on a flank of slope s places a micrometre apart leave s^2 / 8 r of it: nanometres; on a wall a step of them
    steep = height / run
    np.testing.assert_allclose(step_height(x, height, tip, run)[inner], felt[inner], atol=2e-9 + steep * fine)


def test_a_flank_that_is_never_touched_leaves_an_upright_step():
    tip, height, x = 0.5e-3, 0.2e-3, np.linspace(-2e-3, 2e-3, 4001)
    run = float(untouched_run(height, tip))
    upright = step_height(x, height, tip)
    np.testing.assert_allclose(step_height(x + 0.5 * run, height, tip, run), upright, atol=1e-12)
    assert np.abs(step_height(x + 0.75 * run, height, tip, 1.5 * run) - upright).max() > 1e-6
    assert untouched_run(2.0 * tip, tip) == 0.0


def test_scaling_by_a_power_of_two_is_bit_exact():
    x = np.linspace(-5e-3, 5e-3, 101)
    np.testing.assert_array_equal(
        cap_height(x * 1024, D * 1024, D * 512, TIP * 1024), 1024 * cap_height(x, D, D / 2, TIP)
    )


def test_a_tip_without_radius_is_refused():
    with pytest.raises(ShapeError, match="positive radius"):
        cap_height(0.0, D, D / 2, 0.0)
