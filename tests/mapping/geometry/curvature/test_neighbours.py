"""Neighbours against all distances sorted: surfaces, clusters of any density, points on one place, too few points."""

import numpy as np
import pytest

from mapping.geometry.curvature.neighbours import Neighbours


def by_hand(points, places, count):
    square = ((points[None] - places[:, None]) ** 2).sum(axis=2)
    order = np.argsort(square, axis=1, kind="stable")[:, :count]
    return np.pad(order, ((0, 0), (0, count - order.shape[1])), constant_values=len(points))


@pytest.fixture
def surface():
    place = np.random.default_rng(1).uniform(-1.0, 1.0, (1500, 2))
    return np.column_stack([place, 0.3 * np.sin(3.0 * place[:, 0])])


@pytest.mark.parametrize("count", [1, 13, 137, 547])
def test_the_nearest_points_of_a_surface_come_in_the_order_of_their_distance(surface, count):
    np.testing.assert_array_equal(Neighbours(surface).query(surface, count), by_hand(surface, surface, count))


def test_places_need_not_be_points(surface):
    places = np.random.default_rng(2).uniform(-3.0, 3.0, (200, 3))
    np.testing.assert_array_equal(Neighbours(surface).query(places, 20), by_hand(surface, places, 20))


def test_from_a_dense_cluster_to_a_sparse_one_and_back():
    rng = np.random.default_rng(3)
    points = np.concatenate([1e-6 * rng.normal(size=(800, 3)), 10.0 * rng.normal(size=(400, 3))])
    rng.shuffle(points)
    np.testing.assert_array_equal(Neighbours(points).query(points, 37), by_hand(points, points, 37))


def test_of_equally_near_points_the_lower_number_comes_first():
    grid = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0), [0.0]), axis=-1).reshape(-1, 3)
    np.testing.assert_array_equal(Neighbours(grid).query(grid, 33), by_hand(grid, grid, 33))
    many = np.concatenate([np.zeros((500, 3)), grid])
    np.testing.assert_array_equal(Neighbours(many).query(many, 13), by_hand(many, many, 13))


def test_where_there_are_too_few_points_their_number_fills_up(surface):
    few = surface[:5]
    np.testing.assert_array_equal(Neighbours(few).query(few, 8), by_hand(few, few, 8))
    assert (Neighbours(few[:1]).query(few[:1], 3) == [[0, 1, 1]]).all()


def test_units_that_are_powers_of_two_change_nothing(surface):
    plain = Neighbours(surface).query(surface, 49)
    for power in (-60, 60):
        np.testing.assert_array_equal(Neighbours(surface * 2.0**power).query(surface * 2.0**power, 49), plain)
