"""States of a noise against dense linear algebra: several processes, oscillators, gaps, runs, bins of many sizes."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.errors import NoiseError
from mapping.instrument import Noise, Term, mean_steps

SEVERAL = Noise(0.1, 0.5, 0.05, (Term(0.3, 0.5), Term(0.2, 0.3, 0.11), Term(0.1, 20.0, 0.3)))


def test_several_terms_are_whitened_as_by_the_inverse_covariance():
    rng = np.random.default_rng(0)
    s = np.sort(rng.random(120))
    columns = rng.standard_normal((120, 3))
    white, logdet = SEVERAL.whiten(columns, s)
    covariance = SEVERAL.covariance(s)
    np.testing.assert_allclose(white.T @ white, columns.T @ np.linalg.solve(covariance, columns), rtol=1e-9)
    np.testing.assert_allclose(logdet, np.linalg.slogdet(covariance)[1], rtol=1e-11)


@pytest.mark.parametrize("step", [3e-2, 1e-3, 1e-6, 5.0])
def test_means_of_a_process_are_as_likely_as_their_covariance_says_also_with_gaps_and_runs(step):
    rng = np.random.default_rng(1)
    count, samples = 40, 5.0
    index = np.arange(count)
    keep = (index < 10) | (index > 16)
    own = SEVERAL.block_covariances(count, step, samples)[np.abs(index[:, None] - index)]
    values = rng.standard_normal(2 * count)
    expected = 0.0
    for run in (values[:count], values[count:]):
        dense, seen = own[np.ix_(keep, keep)], run[keep]
        expected += seen @ np.linalg.solve(dense, seen) + np.linalg.slogdet(dense)[1]
    steps = mean_steps(SEVERAL.terms, np.array([step]), np.array([SEVERAL.white**2 / samples]))
    filter_ = steps.filter(np.zeros(2 * count, dtype=np.int64), np.tile(index == 0, 2), np.tile(keep, 2))
    white = filter_.whiten(values[None])[0]
    assert not white[np.tile(~keep, 2)].any()
    np.testing.assert_allclose(white @ white + filter_.logdet, expected, rtol=1e-6)


@pytest.mark.parametrize("differ", ["nowhere", "step", "gap", "longer"])
def test_a_run_that_is_like_the_first_for_a_while_has_the_gains_it_has_alone(differ):
    steps = mean_steps(SEVERAL.terms, np.array([0.01, 0.02]), np.full(2, 2e-3))
    lengths = (3000, 3500 if differ == "longer" else 3000)
    begins = np.isin(np.arange(sum(lengths)), [0, lengths[0]])
    # beyond what is remembered of the first run, and within
    for place in (2500, 40):
        kind, known = np.zeros(len(begins), dtype=np.int64), np.ones(len(begins), dtype=bool)
        kind[lengths[0] + place] = differ == "step"
        known[lengths[0] + place : lengths[0] + place + 3] = differ != "gap"
        both = steps.filter(kind, begins, known)
        second = slice(lengths[0], None)
        alone = steps.filter(kind[second], begins[second], known[second])
        np.testing.assert_array_equal(both.gain[second], alone.gain)
        np.testing.assert_array_equal(both.scale[second], alone.scale)


@pytest.mark.parametrize("scale", [1.0, 1e-4, 1e-8])
def test_means_over_samples_are_white_whatever_their_number(scale):
    counts = np.array([20.0, 20, 7, 1, 33, 20, 20])
    s = np.arange(int(counts.sum())) * 6e-3 * scale
    mean = np.repeat(np.eye(len(counts)), counts.astype(int), axis=1) / counts[:, None]
    steps = mean_steps(SEVERAL.terms, counts * 6e-3 * scale, SEVERAL.white**2 / counts, counts)
    filter_ = steps.filter(np.arange(7), np.arange(7) == 0, np.ones(7, dtype=bool))
    rows = filter_.whiten(np.eye(7)).T
    np.testing.assert_allclose(rows @ mean @ SEVERAL.covariance(s) @ mean.T @ rows.T, np.eye(7), atol=1e-8)


def test_the_density_is_the_transform_of_the_covariance():
    spacing, frequency = 1e-3, np.array([0.0, 5.0, 2 * np.pi / 0.11, 90.0])
    s = spacing * np.arange(400_000)
    first = sum(t.sd**2 * np.exp(-t.rate * s).real for t in SEVERAL.terms)
    expected = [2 * spacing * (np.cos(w * s) @ first - 0.5 * first[0]) + SEVERAL.white**2 * spacing for w in frequency]
    np.testing.assert_allclose(SEVERAL.density(frequency, spacing), expected, rtol=1e-3)


def test_what_scales_is_one_noise_in_other_units():
    scaled = SEVERAL.scaled(1e-3, 10.0)
    s = np.linspace(0.0, 1.0, 9)
    np.testing.assert_allclose(scaled.covariance(10.0 * s), 1e-6 * SEVERAL.covariance(s), rtol=1e-12)
    passes = SEVERAL.of_passes(4)
    np.testing.assert_allclose(passes.covariance(s)[0, 1:], SEVERAL.covariance(s)[0, 1:] / 4, rtol=1e-12)
    assert passes.white == SEVERAL.white
    assert Noise.of_terms(SEVERAL.white, SEVERAL.terms).covariance(s) == pytest.approx(SEVERAL.covariance(s))


def test_a_term_of_no_level_or_length_is_refused_by_name():
    for values in ((0.0, 1.0), (1.0, 0.0), (1.0, np.inf), (1.0, 1.0, 0.0)):
        with pytest.raises(NoiseError, match="positive"):
            Term(*values)


@pytest.mark.parametrize("count", [3, 4, 8, 11, 17])
def test_series_that_are_whitened_together_are_as_each_alone_to_the_last_digit(count):
    rng = np.random.default_rng(2)
    bins, steps = 60, mean_steps(SEVERAL.terms, np.array([0.01, 0.03]), np.full(2, 2e-3))
    kind, known = rng.integers(0, 2, bins), rng.random(bins) > 0.1
    filter_ = steps.filter(kind, np.arange(bins) % 25 == 0, known)
    values = rng.standard_normal((count, bins))
    together = filter_.whiten(values)
    np.testing.assert_array_equal(together, np.concatenate([filter_.whiten(each[None]) for each in values]))
    assert not together[:, ~known].any()
