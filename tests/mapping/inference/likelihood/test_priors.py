"""Priors are normalised, and least squares sees what their densities say."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.inference.likelihood import LogOfUniform, Normal, Prior, StudentT, Uniform


@pytest.mark.parametrize("prior", [LogOfUniform(-3.0, 1.5), Normal(0.3, 0.7), StudentT(0.3, 0.7), Uniform(-2.0, 1.0)])
def test_a_density_integrates_to_one_and_its_residual_is_its_root(prior: Prior) -> None:
    x = np.linspace(max(prior.low, -60.0), min(prior.high, 60.0), 400_001)
    density = np.exp(prior.log_density(x))
    assert np.trapezoid(density, x) == pytest.approx(1.0, abs=2e-3)
    off = prior.log_density(x) + 0.5 * prior.residual(x) ** 2
    assert np.ptp(off) < 1e-9


def test_the_exponentials_of_its_draws_are_equally_probable() -> None:
    draws = np.exp(LogOfUniform(np.log(2.0), np.log(4.0)).draw(np.random.default_rng(0), 20_000))
    np.testing.assert_allclose(np.quantile(draws, [0.1, 0.5, 0.9]), [2.2, 3.0, 3.8], atol=0.05)
