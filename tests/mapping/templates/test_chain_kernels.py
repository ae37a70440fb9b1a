"""Compiled chains against the plain closed forms, and square ends against the distance to a cut cylinder."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.geometry.templates.shapes import cap_height, chain_height

TIP = 10e-3


def heights(feet, normals, chain, radius, rounding=1.0, half_bin=1e-15, tangents=None, looks_at=None):
    from mapping.geometry.templates.chain_kernels import chain_heights

    out = np.empty((1, len(feet)))
    low, high = (0, len(chain) - 1) if looks_at is None else looks_at
    first, last = np.full(len(feet), low, dtype=np.int64), np.full(len(feet), high, dtype=np.int64)
    tangents = np.zeros_like(feet) if tangents is None else tangents
    half = np.full(len(feet), half_bin)
    where = (feet, normals, tangents, half, first, last)
    chain_heights(*where, chain[None].copy(), np.array([radius]), np.array([rounding]), TIP, out)
    return out[0]


def scattered(seed, count=1500, tilt=0.03):
    rng = np.random.default_rng(seed)
    feet = np.column_stack([rng.uniform(-8e-3, 8e-3, (count, 2)), np.zeros(count)])
    normals = np.array([0, 0, 1.0]) + rng.normal(0, tilt, (count, 3))
    return feet, normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize("vertices", [1, 2, 6])
def test_round_ended_chains_equal_the_closed_form(vertices):
    feet, normals = scattered(1, tilt=0.2)
    chain = (np.random.default_rng(2).uniform(-4e-3, 4e-3, (6, 3)) * [1, 1, 0.1])[:vertices]
    expected = chain_height(feet, normals, chain, 1e-3, TIP)
    np.testing.assert_allclose(heights(feet, normals, chain, 1e-3), expected, atol=1e-16)
    assert (expected > 0).sum() > 100


def test_the_ball_touches_a_square_cut_cylinder():
    feet, normals = scattered(3)
    chain, radius = np.array([[-3e-3, 0, 0.2e-3], [4e-3, 1e-3, 0.4e-3]]), 0.5e-3
    t = heights(feet, normals, chain, radius, rounding=0.0)
    centers = feet + (TIP + t)[:, None] * normals
    axis = chain[1] - chain[0]
    length = np.linalg.norm(axis)
    place = (centers - chain[0]) @ axis / length
    aside = np.linalg.norm(centers - chain[0] - np.outer(place, axis / length), axis=1)
    beyond = np.maximum(np.maximum(-place, place - length), 0)
    distance = np.hypot(beyond, np.maximum(aside - radius, 0))
    assert ((t > 0) & (beyond > 0)).sum() > 100
    np.testing.assert_allclose(distance[t > 0], TIP, atol=1e-8)
    assert (distance[t == 0] > TIP - 1e-9).all()


def test_a_bin_holds_the_mean_of_the_trace_over_it():
    half, x0 = 60e-6, np.linspace(-4e-3, 4e-3, 200)
    chain, radius, crest = np.array([[0, -1, 0.325e-3], [0, 1, 0.325e-3]]), 0.325e-3, 0.65e-3
    fine = x0[:, None] + half * np.linspace(-1, 1, 2001)
    exact = cap_height(fine, crest, radius, TIP).mean(axis=1)
    feet = np.column_stack([x0, np.zeros((len(x0), 2))])
    up, along = np.tile([0, 0, 1.0], (len(x0), 1)), np.tile([1.0, 0, 0], (len(x0), 1))
    binned = heights(feet, up, chain, radius, half_bin=half, tangents=along)
    plain = heights(feet, up, chain, radius)
    assert np.abs(binned - exact).max() < 0.1e-6 < np.abs(plain - exact).max()


@pytest.mark.parametrize("rounding", [0.0, 0.3])
def test_where_a_chart_has_its_vertices_does_not_matter_to_the_ends_of_a_ridge(rounding):
    # a joint close to an end was felt as a sphere that sticks out of the cut: the length of a wire was 19 um short
    feet, normals = scattered(5, tilt=0.0)
    axis, radius = np.array([[-3e-3, 0, 0.2e-3], [4e-3, 1e-3, 0.2e-3]]), 0.5e-3
    plain = heights(feet, normals, axis, radius, rounding)
    for shares in ([1e-6], [0.02, 0.98], [0.01, 0.03, 0.5, 0.999]):
        joints = axis[0] + np.outer([0.0, *shares, 1.0], axis[1] - axis[0])
        np.testing.assert_allclose(heights(feet, normals, joints, radius, rounding), plain, atol=1e-12)
    assert (plain > 0).sum() > 100


def test_a_joint_counts_whole_where_the_leg_beside_it_is_not_looked_at():
    """A ridge with ends not quite round lost what stands beyond the legs that a bin looks at: 0.3 mm of its height."""
    feet, normals = scattered(7, tilt=0.2)
    chain = 1e-3 * np.array([[-6, 0, 0.2], [-2, 1, 0.2], [2, 1, 0.2], [6, 0, 0.2]])
    round_ends = heights(feet, normals, chain, 0.5e-3, looks_at=(1, 2))
    nearly = heights(feet, normals, chain, 0.5e-3, rounding=1.0 - 1e-12, looks_at=(1, 2))
    np.testing.assert_allclose(nearly, round_ends, atol=1e-12)
    assert (round_ends > 0).sum() > 100


def test_a_ridge_on_the_other_wall_of_an_inner_corner_lifts_nothing_before_it_is_met():
    """A ball on the floor was put on the wall's ridge, 8 mm above: the search for that ridge ended 1000 too low."""
    chain, radius = np.array([[0.2e-3, 0, 25e-3], [0.2e-3, 0, 20e-3], [0.2e-3, 0, 15e-3]]), 0.3e-3
    feet = np.column_stack([np.linspace(10e-3, 10.4e-3, 9), np.zeros((9, 2))])
    up = np.tile([0.0, 0.0, 1.0], (9, 1))
    assert (heights(feet, up, chain, radius) == 0.0).all() and (chain_height(feet, up, chain, radius, TIP) == 0.0).all()
    feet[:, 2] = 6e-3  # the floor is higher, and the ball stands in the ridge
    met = heights(feet, up, chain, radius)
    assert (met[:3] > 0.0).all()
    np.testing.assert_allclose(met, chain_height(feet, up, chain, radius, TIP), atol=1e-12)
