"""Importance sampling from a proposal that learns: what it costs, and what it gives."""

from typing import Any

import numpy as np
import pytest

from mapping.inference.sampler.importance import TRUSTED_K_HAT, importance_sample
from mapping.inference.sampler.laplace import Laplace


class CutOff:
    """A normal density of so many parameters, the first few of them positive; counts what it is asked."""

    def __init__(self, parameters: int, positive: int) -> None:
        self.parameters, self.positive, self.asked = parameters, positive, 0

    @property
    def log_integral(self) -> float:
        return float(0.5 * self.parameters * np.log(2.0 * np.pi) - self.positive * np.log(2.0))

    def log_density(self, theta: np.ndarray) -> np.ndarray:
        self.asked += len(theta)
        inside = (theta[:, : self.positive] > 0.0).all(axis=1)
        return np.where(inside, -0.5 * (theta**2).sum(axis=1), -np.inf)


@pytest.mark.parametrize("seed", range(5))
def test_a_proposal_that_cannot_be_good_is_good_enough_in_a_few_rounds(seed: int) -> None:
    target: Any = CutOff(6, 3)
    start = Laplace(np.full(6, 0.3), np.eye(6), 0.0)
    found = importance_sample(target, [start], np.random.default_rng(seed))
    assert target.asked <= 5000
    assert found.k_hat < TRUSTED_K_HAT
    assert found.ess > 1000
    assert abs(found.log_evidence - target.log_integral) < 0.15
    mean = found.weights @ found.draws
    np.testing.assert_allclose(mean[:3], np.sqrt(2.0 / np.pi), atol=0.12)
    np.testing.assert_allclose(mean[3:], 0.0, atol=0.2)


@pytest.mark.parametrize("seed", range(10))
def test_a_density_is_given_up_as_soon_as_it_is_surely_too_light_and_never_else(seed: int) -> None:
    def sampled(above: float) -> Any:
        target: Any = CutOff(6, 3)
        start = Laplace(np.full(6, 0.3), np.eye(6), 0.0)
        return importance_sample(target, [start], np.random.default_rng(seed), target.log_integral + above)

    whole, early = sampled(-np.inf), sampled(3.0)
    np.testing.assert_array_equal(sampled(-0.2).draws, whole.draws)
    assert len(early.draws) < len(whole.draws) and early.k_hat < TRUSTED_K_HAT
    assert early.log_evidence == pytest.approx(whole.log_evidence, abs=0.5)


class Banana:
    """Two of eight parameters on a parabola: a proposal of ellipsoids never has its form."""

    asked = 0

    def log_density(self, theta: np.ndarray) -> np.ndarray:
        self.asked += len(theta)
        bent = theta.copy()
        bent[:, 1] -= 0.6 * (theta[:, 0] ** 2 - 1.0)
        return np.asarray(-0.5 * (bent**2).sum(axis=1))


def test_draws_of_all_rounds_together_are_trusted_where_those_of_the_last_are_not() -> None:
    """Of 100 seeds the last proposal's draws alone could not be trusted in 42 (7,785 asked for), these in 4 (6,890)."""
    trusted, errors = 0, []
    for seed in range(20):
        target: Any = Banana()
        start = Laplace(np.r_[0.0, -0.6, np.zeros(6)], np.eye(8), 0.0)
        found = importance_sample(target, [start], np.random.default_rng(seed))
        trusted += found.k_hat < TRUSTED_K_HAT
        errors.append(found.log_evidence - 4.0 * np.log(2.0 * np.pi))
        assert target.asked <= 16_000
    assert trusted >= 17
    assert np.mean(errors) == pytest.approx(-0.03, abs=0.03) and np.std(errors) < 0.04
