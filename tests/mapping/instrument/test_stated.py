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


def test_what_is_not_stated_is_measured():
    alone = fitted(0, None)
    told = fitted(0, StatedNoise(Noise(0.0)))
    assert told.noise == alone.noise


@pytest.mark.parametrize("doubt", [0.0, -0.1, np.nan, np.inf])
def test_no_statement_is_certain(doubt):
    with pytest.raises(NoiseError, match="doubt"):
        StatedNoise(TRUTH, doubt)
