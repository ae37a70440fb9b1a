"""Importance weights with known tails."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.inference.sampler.psis import effective_size, resample, smooth_weights


@pytest.mark.parametrize("shape", [0.2, 0.5, 0.9])
def test_k_hat_finds_the_shape_of_a_pareto_tail(shape):
    found = []
    for seed in range(20):
        ratios = -shape * np.log(np.random.default_rng(seed).random(8000))
        found.append(smooth_weights(ratios)[1])
    assert np.mean(found) == pytest.approx(shape, abs=0.1)


def test_smoothed_weights_estimate_a_mean_better_than_raw_ones():
    # target N(0, 1), proposal N(0, 0.6^2): weights without variance; the truth of E x^2 is 1
    raw, smooth = [], []
    for seed in range(200):
        x = 0.6 * np.random.default_rng(seed).standard_normal(500)
        ratios = -0.5 * x**2 + 0.5 * (x / 0.6) ** 2
        plain = np.exp(ratios - ratios.max())
        raw.append((plain / plain.sum()) @ x**2)
        smooth.append(smooth_weights(ratios)[0] @ x**2)
    assert np.std(smooth) < np.std(raw)


def test_equal_weights_are_left_alone():
    weights, k_hat = smooth_weights(np.zeros(1000))
    np.testing.assert_allclose(weights, 1e-3)
    assert k_hat == -np.inf and effective_size(weights) == pytest.approx(1000)


def test_one_draw_that_outweighs_all_others_is_told_and_no_number_overflows():
    ratios = -np.linspace(530.0, 560.0, 4000)
    ratios[[0, 1]] = [0.0, -2.8]
    weights, k_hat = smooth_weights(ratios)
    assert k_hat > 0.7 and effective_size(weights) < 3 and weights.sum() == pytest.approx(1.0)


def test_resampling_keeps_the_weights():
    weights = np.array([0.1, 0.2, 0.7])
    counts = np.bincount(resample(np.random.default_rng(0), weights, 1000))
    np.testing.assert_allclose(counts / 1000, weights, atol=2e-3)


def test_draws_that_all_miss_the_support_are_even_and_not_trusted() -> None:
    weights, k_hat = smooth_weights(np.full(40, -np.inf))
    assert np.allclose(weights, 1.0 / 40)
    assert k_hat == np.inf


def test_a_tail_of_all_magnitudes_is_not_trusted_and_does_not_overflow() -> None:
    weights, k_hat = smooth_weights(np.append(np.full(900, -707.0), np.linspace(-706.0, 0.0, 100)))
    assert np.isfinite(weights).all() and weights.sum() == pytest.approx(1.0)
    assert k_hat > 1.0
