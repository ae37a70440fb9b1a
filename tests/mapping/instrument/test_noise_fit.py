"""The likelihood of block means against dense linear algebra; the fit against noise of known level."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.detection.filters.toeplitz_kernels import leading_solutions
from mapping.instrument.block_likelihood import Blocks, relative_sd
from mapping.instrument.noise import Noise, estimate_noise
from mapping.instrument.noise_fit import fit_noise
from mapping.instrument.noise_kernels import block_likelihood


def drawn(noise: Noise, count: int, spacing: float, rng: np.random.Generator) -> np.ndarray:
    from scipy.signal import lfilter

    decay = np.exp(-spacing / noise.length)
    kicks = noise.correlated * np.sqrt(1 - decay**2) * rng.standard_normal(count)
    kicks[0] = noise.correlated * rng.standard_normal()
    return lfilter([1.0], [1.0, -decay], kicks) + noise.white * rng.standard_normal(count)


def blocks_of(values: np.ndarray, step: float, samples: float = 1.0) -> Blocks:
    return Blocks(values, np.concatenate([[-step], np.full(len(values) - 1, step)]), samples)


@pytest.mark.parametrize("step", [3e-4, 1e-6, 5e-3])
def test_the_likelihood_of_block_means_is_that_of_their_covariance_also_with_gaps(step):
    rng = np.random.default_rng(0)
    noise, count, samples = Noise(0.5e-4, 2e-4, 1e-3), 40, 5.0
    index = np.arange(count)
    covariance = noise.block_covariances(count, step, samples)[np.abs(index[:, None] - index)]
    values = 1e-4 * rng.standard_normal(count)
    keep = (index < 10) | (index > 16)
    dense = covariance[np.ix_(keep, keep)]
    expected = values[keep] @ np.linalg.solve(dense, values[keep]) + np.linalg.slogdet(dense)[1]
    blocks = blocks_of(np.where(keep, values, np.nan), step)
    found = block_likelihood(blocks.values, blocks.steps, samples, noise.white, noise.correlated, noise.length)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_two_runs_are_as_likely_as_each_alone():
    rng = np.random.default_rng(1)
    values, noise = rng.standard_normal(60), (0.5, 1.0, 3.0)
    both = blocks_of(values, 1.0)
    both.steps[25] = -1.0
    parts = [blocks_of(values[:25], 1.0), blocks_of(values[25:], 1.0)]
    alone = [block_likelihood(p.values, p.steps, 1.0, *noise) for p in parts]
    np.testing.assert_allclose(block_likelihood(both.values, both.steps, 1.0, *noise), sum(alone), rtol=1e-12)


@pytest.mark.parametrize(("white", "correlated", "length"), [(1e-4, 5e-5, 1e-3), (1e-4, 2e-4, 2e-3)])
def test_the_fit_scatters_about_the_truth_as_it_says(white, correlated, length):
    truth, spacing = Noise(white, correlated, length), 2e-5
    rng = np.random.default_rng(2)
    errors, stated = [], []
    for _ in range(40):
        height = drawn(truth, 5000, spacing, rng)
        fit = fit_noise([blocks_of(height, spacing)], estimate_noise(height, spacing * np.arange(5000)))
        if fit.noise.correlated == 0 or fit.noise.further:
            continue
        found = np.array([fit.noise.white**2, fit.noise.correlated**2, fit.noise.length])
        errors.append(np.log(found / [white**2, correlated**2, length]))
        stated.append(np.sqrt(np.diag(fit.covariance)))
        assert relative_sd(fit, np.array([0.5, 0, 0])) == pytest.approx(0.5 * stated[-1][0])
    assert len(errors) >= 36
    ratio = np.sqrt(np.mean(np.square(errors), axis=0)) / np.mean(stated, axis=0)
    # 40 draws know a standard deviation to 11 %
    assert (ratio > 0.65).all() and (ratio < 1.4).all()


def test_white_noise_is_not_taken_for_correlated():
    rng = np.random.default_rng(3)
    found = []
    for _ in range(30):
        height = 2e-4 * rng.standard_normal(4000)
        found.append(fit_noise([blocks_of(height, 2e-5)], estimate_noise(height, 2e-5 * np.arange(4000))).noise)
    assert sum(noise.correlated > 0 for noise in found) <= 2
    np.testing.assert_allclose([noise.white for noise in found if not noise.correlated], 2e-4, rtol=0.05)


def test_every_leading_block_of_a_toeplitz_system_is_solved():
    rng = np.random.default_rng(4)
    count, smallest = 50, 20
    first = np.exp(-np.arange(count) / 7.0) + 0.3 * (np.arange(count) == 0)
    columns = rng.standard_normal((count, 3))
    solved = leading_solutions(first, columns, smallest)
    dense = first[np.abs(np.subtract.outer(np.arange(count), np.arange(count)))]
    for k in (smallest, 37, count):
        expected = np.linalg.solve(dense[:k, :k], columns[:k])
        np.testing.assert_allclose(solved[k - smallest, :k], expected, rtol=1e-10, atol=1e-12)
        assert (solved[k - smallest, k:] == 0).all()


def test_the_fit_has_the_same_digits_at_every_power_of_two():
    rng = np.random.default_rng(5)
    height, step = drawn(Noise(1.0, 2.0, 0.1), 2000, 0.01, rng), 0.01
    start = Noise(1.1, 1.5, 0.2)
    plain = fit_noise([blocks_of(height, step)], start).noise
    for scale in (2.0**-40, 2.0**30):
        scaled = Noise(start.white * scale, start.correlated * scale, start.length * scale)
        found = fit_noise([blocks_of(height * scale, step * scale)], scaled).noise
        assert (found.white, found.correlated, found.length) == (
            plain.white * scale,
            plain.correlated * scale,
            plain.length * scale,
        )
