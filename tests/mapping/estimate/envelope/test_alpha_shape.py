"""The envelope of unorganised balls: every corner is allowed by all balls, and none is missing."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from mesh_borders import border_loops
from scipy.spatial import cKDTree

from mapping.estimate.envelope.alpha_shape import alpha_facets
from mapping.estimate.envelope.envelope import EXTRAPOLATED, EnvelopeError, estimate_surface
from mapping.estimate.envelope.sweep_mesh import mesh_sweeps
from mapping.geometry.contact.first_contact import BallContact
from mapping.surface import Surface
from mapping.trace import Trace

UP = np.array([0.0, 0.0, 1.0])


def cloud(centers, r):
    return Trace(np.arange(len(centers)), centers, np.arange(len(centers)), r)


def test_the_corners_are_those_of_every_triple_of_balls():
    rng = np.random.default_rng(3)
    centers = np.column_stack([rng.uniform(-1, 1, (24, 2)), 0.3 * rng.random(24)])
    found = alpha_facets(centers, np.tile(UP, (24, 1)), 1.5)[1]
    expected = []
    for i, j, k in itertools.combinations(range(24), 3):
        a, u, v = centers[i], centers[j] - centers[i], centers[k] - centers[i]
        n = np.cross(u, v)
        arm = np.cross((u @ u) * v - (v @ v) * u, n) / (2 * n @ n)
        if arm @ arm < 1.5**2:
            down = -np.sign(n[2]) * n / np.linalg.norm(n)
            p = a + arm + np.sqrt(1.5**2 - arm @ arm) * down
            if np.linalg.norm(centers - p, axis=1).min() >= 1.5 * (1 - 1e-9):
                expected.append(p)
    assert len(found) == len(expected) > 10
    assert cKDTree(found).query(np.array(expected))[0].max() < 1e-9


def test_a_cloud_over_a_plane_bounds_the_plane():
    xy = np.random.default_rng(0).uniform(-1, 1, (2000, 2))
    estimate = estimate_surface(cloud(np.column_stack([xy, np.ones(2000)]), 1.0), "alpha")
    inner = (np.abs(estimate.points[:, :2]) < 0.7).all(axis=1)
    assert inner.sum() > 1000
    assert (estimate.points[:, 2] >= 0).all()
    assert estimate.points[inner, 2].max() < 0.02
    assert (estimate.labels == EXTRAPOLATED).all()


@pytest.mark.parametrize("scale", [2.0**-30, 1.0])
def test_a_cloud_all_round_a_sphere_bounds_it_from_outside(scale):
    rng = np.random.default_rng(1)
    arm = rng.standard_normal((1000, 3))
    arm /= np.linalg.norm(arm, axis=1, keepdims=True)
    estimate = estimate_surface(cloud(1.5 * scale * arm, 0.5 * scale), "alpha", outward=arm)
    distance = np.linalg.norm(estimate.points, axis=1) / scale
    assert distance.min() >= 1 - 1e-12
    assert distance.max() < 1.1  # the largest gap between the centres
    assert np.linalg.norm(estimate.points[:, None] - 1.5 * scale * arm[None], axis=2).min() >= 0.5 * scale * (1 - 1e-9)
    assert estimate.surface is not None and border_loops(estimate.surface) == 0


def test_over_a_slot_the_cloud_bounds_the_body_as_far_as_the_ball_sinks_in():
    width = 0.3
    x = np.array([-4, -width / 2, -width / 2, width / 2, width / 2, 4])
    z = np.array([0, 0, -0.5, -0.5, 0, 0])
    k = np.arange(5)
    plate = Surface(
        np.vstack([np.column_stack([x, np.full(6, y), z]) for y in (-4.0, 4.0)]),
        np.vstack([np.column_stack([k, k + 1, k + 7]), np.column_stack([k, k + 7, k + 6])]),
    )
    start = np.column_stack([np.random.default_rng(2).uniform(-0.8, 0.8, (3000, 2)), np.full(3000, 3.0)])
    centers = BallContact(plate, 1.0).first_contact(start, -UP).centers
    points = estimate_surface(cloud(centers, 1.0), "alpha").points
    inner = (np.abs(points[:, :2]) < 0.6).all(axis=1)
    sag = 1 - np.sqrt(1 - width**2 / 4)
    inside = np.abs(points[:, 0]) < width / 2
    assert (inner & inside).any()
    assert points[:, 2].min() >= -sag - 1e-9
    assert points[inner & ~inside, 2].min() >= -1e-9
    assert points[inner, 2].max() < 0.01


def test_a_cloud_that_bounds_nothing_is_refused():
    with pytest.raises(EnvelopeError, match="on one line"):
        estimate_surface(cloud(np.column_stack([np.zeros(5), np.zeros(5), np.arange(5.0)]), 1.0), "alpha")
    with pytest.raises(EnvelopeError, match="too far apart"):
        estimate_surface(cloud(100 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.1]]), 1.0), "alpha")


def test_a_cloud_over_a_torus_is_meshed_by_ball_pivoting():
    u, v = np.meshgrid(np.arange(80) * 2 * np.pi / 80, np.arange(32) * 2 * np.pi / 32, indexing="ij")
    u, v = u.ravel() + np.pi / 80 * (np.arange(u.size) % 2), v.ravel()
    normals = np.column_stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)])
    centers = 0.4 * normals + np.column_stack([np.cos(u), np.sin(u), 0 * u])
    mesh = mesh_sweeps(cloud(centers, 0.1), outward=normals, spacing=0.0)
    area = 4 * np.pi**2 * 0.4
    assert abs(mesh.face_areas.sum() / area - 1) < 0.05
    assert (np.einsum("ij,ij->i", mesh.face_normals, normals[mesh.faces[:, 0]]) > 0.5).mean() > 0.99
