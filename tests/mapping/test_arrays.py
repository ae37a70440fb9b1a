"""What the house says of rows of three is what numpy says, sooner."""

from timeit import repeat

import numpy as np

from mapping import dots, lengths, sides_of_box


def test_lengths_are_those_of_numpy_to_the_last_bit():
    rng = np.random.default_rng(3)
    for shape in ((1, 3), (5, 2), (4000, 3), (30, 7, 3)):
        vectors = rng.normal(size=shape) * 10.0 ** rng.integers(-9, 9, shape)
        assert np.array_equal(lengths(vectors), np.linalg.norm(vectors, axis=-1))
        assert np.array_equal(lengths(np.asfortranarray(vectors)), np.linalg.norm(vectors, axis=-1))
    assert lengths(np.zeros((0, 3))).shape == (0,)


def test_scalar_products_are_those_of_numpy_to_the_last_bit():
    first, second = np.random.default_rng(6).normal(size=(2, 1000, 3))
    assert np.array_equal(dots(first, second), (first * second).sum(axis=1))


def test_sides_of_a_box_are_those_of_numpy():
    points = np.random.default_rng(4).normal(size=(1000, 3))
    assert np.array_equal(sides_of_box(points), np.ptp(points, axis=0))


def test_many_rows_of_three_take_less_than_half_of_numpys_time():
    points = np.random.default_rng(5).normal(size=(100_000, 3))
    for own, numpys, axis in ((lengths, np.linalg.norm, 1), (sides_of_box, np.ptp, 0)):
        took = min(repeat(lambda f=own: f(points), number=1))
        assert took < 0.5 * min(repeat(lambda f=numpys, k=axis: f(points, axis=k), number=1))
