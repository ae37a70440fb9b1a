"""What is stated of the noise helps a fit of few samples, and gives way where it is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.errors import NoiseError
from mapping.instrument.noise import Noise, estimate_noise
from mapping.instrument.noise_fit import Blocks, NoiseFit, fit_noise
from mapping.instrument.stated import StatedNoise

TRUTH, STEP, COUNT = Noise(0.0, 2e-4, 1e-3), 2e-5, 3000


def fitted(seed: int, stated: StatedNoise | None) -> NoiseFit:
    """Fit to 60 mm, sixty correlation lengths, of the true noise."""
    from scipy.signal import lfilter

    rng, decay = np.random.default_rng(seed), np.exp(-STEP / TRUTH.length)
    kicks = rng.standard_normal(COUNT)
    kicks[1:] *= np.sqrt(1 - decay**2)
    height = TRUTH.correlated * lfilter([1.0], [1.0, -decay], kicks)
    steps = np.full(COUNT, STEP)
    steps[0] = -STEP
    return fit_noise([Blocks(height, steps, 1.0)], estimate_noise(height, STEP * np.arange(COUNT)), stated)


def off(fit: NoiseFit) -> np.ndarray:
    """Errors of the logarithms of correlated^2 and length."""
    noise = fit.noise
    return np.log([noise.correlated**2 / TRUTH.correlated**2, noise.length / TRUTH.length])


def test_a_true_statement_narrows_the_fit_and_its_stated_uncertainty():
    alone = [fitted(seed, None) for seed in range(15)]
    told = [fitted(seed, StatedNoise(TRUTH)) for seed in range(15)]
    spread = [np.sqrt(np.mean(np.square([off(fit) for fit in fits]), axis=0)) for fits in (alone, told)]
    assert (spread[1] < 0.6 * spread[0]).all()
    stated = [np.mean([np.sqrt(np.diag(fit.covariance))[1:] for fit in fits], axis=0) for fits in (alone, told)]
    assert (stated[1] < 0.6 * stated[0]).all()


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_a_statement_that_the_samples_contradict_gives_way(factor):
    wrong = StatedNoise(Noise(0.0, factor * TRUTH.correlated, factor * TRUTH.length))
    for seed in range(5):
        alone, told = fitted(seed, None), fitted(seed, wrong)
        own = np.sqrt(np.diag(alone.covariance))[1:]
        assert (np.abs(off(told) - off(alone)) < 1.5 * own).all()


def mostly_white(seed: int, correlated: float, count: int) -> NoiseFit:
    """Fit to white noise of 0.03 mm with so much that is correlated over 1 mm, m, of which a sixth is stated."""
    from scipy.signal import lfilter

    rng, step, white = np.random.default_rng(seed), 75e-6, 3e-5
    decay = np.exp(-step / 1e-3)
    kicks = rng.standard_normal(count) * np.sqrt(1 - decay**2)
    height = correlated * lfilter([1.0], [1.0, -decay], kicks) + white * rng.standard_normal(count)
    steps = np.full(count, step)
    steps[0] = -step
    stated = StatedNoise(Noise(white, white / 6.0, 1e-3))
    return fit_noise([Blocks(height, steps, 1.0)], estimate_noise(height, step * np.arange(count)), stated)


def test_what_is_stated_is_kept_where_the_path_is_too_short_to_show_it():
    """It decides how much a filter as wide as a crest lets through: 1.2 times as much as without."""
    fits = [mostly_white(seed, 5e-6, 2400) for seed in range(12)]
    widths, truth = np.array([1e-3, 2e-3, 4e-3]), Noise(3e-5, 5e-6, 1e-3)
    ratio = np.array([fit.noise.cap_sd(widths, 75e-6) for fit in fits]) / truth.cap_sd(widths, 75e-6)
    assert (np.abs(ratio - 1.0) < 0.1).all()


def test_what_is_stated_is_given_up_where_the_path_would_show_it():
    assert all(mostly_white(seed, 0.0, 100_000).noise.correlated < 1e-6 for seed in range(3))


def test_what_is_not_stated_is_measured():
    alone = fitted(0, None)
    told = fitted(0, StatedNoise(Noise(0.0)))
    assert told.noise == alone.noise


@pytest.mark.parametrize("doubt", [0.0, -0.1, np.nan, np.inf])
def test_no_statement_is_certain(doubt):
    with pytest.raises(NoiseError, match="doubt"):
        StatedNoise(TRUTH, doubt)
