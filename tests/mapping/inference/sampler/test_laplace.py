"""Searches for optima: those that will not be of use are given up, and no other."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from mapping import FloatArray
from mapping.inference.sampler.laplace import find_optima, shortest_solution

# Of chi-square this much is left wherever a search goes
LEFT = 900.0


class BentValley:
    """A density along a bent valley (Rosenbrock's), which takes a search a dozen steps; the optimum is at (1, 1)."""

    def __init__(self) -> None:
        self.low, self.high = np.full(2, -5.0), np.full(2, 5.0)
        self.shape = SimpleNamespace(step=np.full(2, 0.01))
        self.asked = 0

    def residuals(self, theta: FloatArray) -> FloatArray:
        self.asked += len(theta)
        x, y = theta.T
        return np.stack([10.0 * (y - x**2), 10.0 * (1.0 - x), np.full(len(x), LEFT**0.5)], axis=1)

    def log_density(self, theta: FloatArray) -> FloatArray:
        return np.asarray(-0.5 * (self.residuals(theta) ** 2).sum(axis=1))


def test_a_search_that_promises_too_little_is_given_up_and_one_within_reach_is_not() -> None:
    whole: Any = BentValley()
    whole_way = find_optima(whole, np.array([[-4.0, 0.0]]))
    np.testing.assert_allclose(whole_way[0], 1.0, atol=1e-3)
    hopeless: Any = BentValley()
    assert find_optima(hopeless, np.array([[-4.0, 0.0]]), most=0.5 * LEFT) == []
    assert hopeless.asked < whole.asked
    within: Any = BentValley()
    np.testing.assert_array_equal(find_optima(within, np.array([[-4.0, 0.0]]), most=LEFT + 1.0), whole_way)


def test_of_two_searches_both_optima_are_kept_where_they_are_equally_good() -> None:
    class TwoValleys(BentValley):
        def residuals(self, theta: FloatArray) -> FloatArray:
            self.asked += len(theta)
            x, y = theta.T
            return np.stack([10.0 * (y - x**2), 10.0 * (1.0 - x**2), np.full(len(x), LEFT**0.5)], axis=1)

    valleys: Any = TwoValleys()
    found = find_optima(valleys, np.array([[-2.0, 4.0], [2.0, 4.0]]))
    assert sorted(round(float(x), 2) for x, _ in found) == [-1.0, 1.0]


def test_where_one_start_is_of_use_no_other_is_given_up() -> None:
    class Cliff(BentValley):
        """What is left of chi-square falls to nothing beyond x = 0."""

        def residuals(self, theta: FloatArray) -> FloatArray:
            rest = super().residuals(theta) * [1.0, 0.3, 1.0]
            rest[:, 2] *= theta[:, 0] < 0.0
            return np.asarray(rest)

    far, near = [-4.0, 0.0], [2.0, 4.0]
    alone: Any = Cliff()
    assert find_optima(alone, np.array([far]), most=10.0) == []
    both: Any = Cliff()
    unhurried: Any = Cliff()
    found = find_optima(both, np.array([far, near]), most=10.0)
    np.testing.assert_array_equal(found, find_optima(unhurried, np.array([far, near])))
    assert both.asked > unhurried.asked


def test_two_shapes_that_lie_one_on_the_other_share_what_they_explain() -> None:
    sharp = 1e18 * np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1e-30]])  # singular, and one hardly felt
    np.testing.assert_allclose(shortest_solution(sharp, np.array([1e18, 1e18, 3e-12])), [0.5, 0.5, 3.0], rtol=1e-9)
    plain = np.array([[4.0, 1.0], [1.0, 3.0]])
    np.testing.assert_allclose(plain @ shortest_solution(plain, np.array([1.0, 2.0])), [1.0, 2.0], rtol=1e-12)
