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
    assert target.asked < 8000  # 14,000 when half of the draws had to be effective
    assert found.k_hat < TRUSTED_K_HAT
    assert found.ess > 800
    assert abs(found.log_evidence - target.log_integral) < 0.15
    mean = found.weights @ found.draws
    np.testing.assert_allclose(mean[:3], np.sqrt(2.0 / np.pi), atol=0.12)
    np.testing.assert_allclose(mean[3:], 0.0, atol=0.2)
