"""The O(n) likelihood against dense covariance matrices."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from mapping.inference.likelihood.bin_filter import bin_filter
from mapping.inference.likelihood.gaussian import Nuisance, build_likelihood
from mapping.inference.likelihood.window import Window
from mapping.instrument.noise import Noise

SPACING = 6e-6


def window_of(counts, starts=(0,), heights=None):
    counts = np.array(counts)
    place, last = np.empty(len(counts)), np.empty(len(counts))
    bounds = [*starts, len(counts)]
    for a, b in itertools.pairwise(bounds):
        stop = np.cumsum(counts[a:b])
        last[a:b] = (stop - 1) * SPACING
        place[a:b] = (stop - counts[a:b] + (counts[a:b] - 1) / 2) * SPACING
    flat = np.zeros((len(counts), 3))
    heights = np.zeros(len(counts)) if heights is None else heights
    ends = np.array(bounds, dtype=np.int64)
    return Window(flat, flat, flat, heights, counts, place, last, counts * SPACING / 2, ends, int(counts.sum()))


def dense_covariance(counts, noise):
    """Of the bin means, from the covariance of every raw sample of one run."""
    s = np.arange(sum(counts)) * SPACING
    mean = np.zeros((len(counts), len(s)))
    at = 0
    for i, count in enumerate(counts):
        mean[i, at : at + count] = 1 / count
        at += count
    return mean @ noise.covariance(s) @ mean.T


@pytest.mark.parametrize("length", [20e-6, 0.3e-3, 3e-3, 10.0])
@pytest.mark.parametrize("white", [0.0, 1e-6, 0.2e-3])
def test_the_filter_whitens_bin_means_exactly(length, white):
    counts, noise = [20, 20, 7, 1, 33, 20, 20], Noise(white, 0.1e-3, length)
    whitener = bin_filter(window_of(counts), noise, floor=1e-12)
    rows = whitener.whiten(np.eye(len(counts))).T
    product = rows @ dense_covariance(counts, noise) @ rows.T
    np.testing.assert_allclose(product, np.eye(len(counts)), atol=1e-4)


def test_offset_slope_and_bend_are_marginalised_within_each_run():
    rng = np.random.default_rng(0)
    counts, starts = [20] * 30, (0, 12)
    noise, nuisance = Noise(0.1e-3, 0.1e-3, 0.5e-3), Nuisance(0.3e-3, 0.2e-3, 0.1e-3)
    data, templates = rng.normal(0, 1e-4, 30), rng.normal(0, 1e-4, (4, 30))
    window = window_of(counts, starts, data)
    likelihood = build_likelihood(window, noise, nuisance, 1e-12)
    covariance = np.zeros((30, 30))
    for a, b in ((0, 12), (12, 30)):
        x = (window.place[a:b] - window.place[a:b].mean()) / (0.5 * np.ptp(window.place[a:b]))
        basis = np.stack([0.3e-3 * np.ones(b - a), 0.2e-3 * x, 0.1e-3 * x**2])
        covariance[a:b, a:b] = dense_covariance(counts[a:b], noise) + basis.T @ basis
    residual = data - templates
    expected = -0.5 * np.einsum("wi,ij,wj->w", residual, np.linalg.inv(covariance), residual)
    np.testing.assert_allclose(likelihood.log_density(templates), expected, rtol=1e-6)
    np.testing.assert_allclose(-0.5 * (likelihood.residuals(templates) ** 2).sum(axis=1), expected, rtol=1e-6)


def test_an_offset_costs_almost_nothing():
    window = window_of([20] * 50, heights=np.full(50, 1e-4))
    likelihood = build_likelihood(window, Noise(1e-4), Nuisance(1e-2, 1e-2), 1e-12)
    far, near = likelihood.log_density(np.stack([np.zeros(50), np.full(50, 1e-4)]))
    assert abs(far - near) < 1e-3
