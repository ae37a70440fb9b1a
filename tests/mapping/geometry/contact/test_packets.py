"""Packets: queries that share a search of the tree are answered as each would be by itself."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bodies import BODIES, bump

from mapping.geometry.contact.first_contact import BallContact, Contacts
from mapping.geometry.contact.query_order import BITS, morton_order

ROW = 400


def one_by_one(ball: BallContact, origins: np.ndarray, directions: np.ndarray) -> Contacts:
    """The contacts of queries that nobody shares anything with."""
    single = [ball.first_contact(o[None], d[None]) for o, d in zip(origins, directions, strict=True)]
    return Contacts(**{name: np.concatenate([getattr(one, name) for one in single]) for name in vars(single[0])})


def assert_same(found: Contacts, expected: Contacts, size: float) -> None:
    np.testing.assert_array_equal(found.overlap, expected.overlap)
    np.testing.assert_array_equal(found.count, expected.count)
    np.testing.assert_array_equal(found.feature, expected.feature)
    for name in ("centers", "points", "distance"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=0, atol=1e-13 * size)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("ratio", [0.01, 0.3, 3.0])
@pytest.mark.parametrize("turn", [0.0, 0.05, 0.5])
def test_a_row_of_balls_that_turn_on_the_way_comes_to_rest_as_each_alone(name: str, ratio: float, turn: float) -> None:
    body = BODIES[name]()
    radius, size = ratio * body.size, body.size
    low, high = body.bounds
    share = np.linspace(-0.1, 1.1, ROW)[:, None]
    # some begin within the body, and the ends of the row pass it by
    origins = low + share * (high - low) + np.array([0.0, 0.0, 1.0]) * (0.9 * (high - low)[2] + radius)
    angle = turn * np.sin(6.0 * share[:, 0])
    directions = np.column_stack([np.sin(angle), np.zeros(ROW), -np.cos(angle)])
    ball = BallContact(body, radius)
    found = ball.first_contact(origins, directions)
    assert (found.count > 0).any()
    assert_same(found, one_by_one(ball, origins, directions), size + radius)


@pytest.mark.parametrize("spacing", [1e-6, 1e-4, 2e-3])
def test_a_path_finer_than_the_mesh_is_followed_across_edges_and_vertices(spacing: float) -> None:
    body = bump(15.0)
    ball, start = BallContact(body, 0.1), np.array([-0.31, -0.27, 2.0])
    origins = start + spacing * np.arange(ROW)[:, None] * np.array([0.8, 0.6, 0.0])
    directions = np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    found = ball.first_contact(origins, directions[0])
    assert found.count.min() >= 1
    assert_same(found, one_by_one(ball, origins, directions), 1.0)


def test_scattered_points_are_taken_along_a_morton_curve() -> None:
    points = np.random.default_rng(4).uniform(-3.0, 5.0, (5000, 3))
    cells = np.minimum((points - points.min(axis=0)) * (2**BITS / np.ptp(points, axis=0).max()), 2**BITS - 1)
    bits = (cells.astype(np.int64)[:, None, :] >> np.arange(BITS)[None, :, None]) & 1
    codes = (bits << (3 * np.arange(BITS)[:, None] + np.arange(3))[None]).sum(axis=(1, 2))
    np.testing.assert_array_equal(morton_order(points), np.argsort(codes, kind="stable"))


def test_a_grid_is_taken_row_by_row() -> None:
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 60), np.linspace(0.0, 1.0, 50), indexing="ij")
    assert len(morton_order(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]))) == 0
