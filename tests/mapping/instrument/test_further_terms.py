"""Terms by evidence: noise of many lengths and tones is described, simple noise stays simple."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.detection.filters.matched_filter import best_linear, cap_bins
from mapping.instrument import Blocks, Noise, Term, estimate_noise, fit_noise, perturbed

RUNS, LONG = 12, 550


def fitted(values: np.ndarray, samples: float = 1.0) -> Noise:
    """The law of RUNS runs of LONG values, a step of 1 apart."""
    steps = np.tile(np.concatenate([[-1.0], np.ones(LONG - 1)]), RUNS)
    places = np.concatenate([np.arange(LONG) + 1e5 * run for run in range(RUNS)])
    return fit_noise([Blocks(values, steps, samples)], estimate_noise(values, places)).noise


def coloured(exponent: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Noise whose power goes with 1 / frequency^exponent, of unit variance, and its autocovariance."""
    count = RUNS * LONG
    shape = np.concatenate([[0.0], np.arange(1.0, count // 2 + 1) ** (-0.5 * exponent)])
    shape /= np.sqrt(2 * (shape**2).sum())
    spectrum = shape * (rng.standard_normal(len(shape)) + 1j * rng.standard_normal(len(shape))) * np.sqrt(0.5)
    covariance = np.fft.irfft(shape**2, count) * count
    return np.fft.irfft(spectrum, count) * count, covariance


def test_a_beam_that_rings_with_three_blocks_to_a_wave_is_an_oscillator_and_no_process():
    from scipy.signal import lfilter

    rng = np.random.default_rng(4)
    turn = 2 * np.pi / 3.3
    keep = np.exp(-turn / 30.0)
    rung = lfilter([1.0], [1.0, -2 * keep * np.cos(turn), keep**2], rng.standard_normal((RUNS, LONG)))
    noise = fitted(rng.standard_normal(RUNS * LONG) + (rung / rung.std()).ravel())
    (beam,) = noise.terms
    assert beam.wavelength == pytest.approx(3.3, rel=1e-2)
    assert beam.length == pytest.approx(30.0 / turn, rel=0.5)
    # caps far wider than a wave hardly feel it
    assert noise.density(np.array([0.1]), 1.0)[0] == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.5])
def test_filters_for_the_fitted_law_of_coloured_noise_scatter_as_they_say_and_nearly_as_little_as_can_be(exponent):
    values, covariance = coloured(exponent, np.random.default_rng(1))
    values, covariance = values / values.std(), covariance / covariance[0]
    noise = fitted(values)
    assert noise.further
    for half_width in (4.0, 12.0, 36.0):
        reach = int(2.5 * half_width)
        x = np.arange(-reach, reach + 1, dtype=np.float64)
        cap = cap_bins(x, half_width, 1.0)
        no = np.zeros((len(x), 0))
        weights, told = best_linear(noise.block_covariances(len(x), 1.0, 1.0), cap, no)
        _, best = best_linear(covariance[: len(x)], cap, no)
        lags = np.abs(np.subtract.outer(np.arange(len(x)), np.arange(len(x))))
        true = np.sqrt(weights[0] @ covariance[lags] @ weights[0])
        # single samples' levels are known to a few per cent; six thousand of them, and the widest filter sees forty
        assert told[0] / true == pytest.approx(1.0, abs=0.15)
        assert true < 1.05 * best[0]


def test_white_noise_and_one_process_need_no_further_term_whatever_the_level_of_each_run():
    rng = np.random.default_rng(2)
    further = 0
    for trial in range(12):
        level = np.repeat(np.exp(0.5 * rng.standard_normal(RUNS)), LONG)
        white = rng.standard_normal(RUNS * LONG)
        kicks = rng.standard_normal((RUNS, LONG))
        slow = np.empty_like(kicks)
        slow[:, 0] = kicks[:, 0]
        for i in range(1, LONG):
            slow[:, i] = np.exp(-0.2) * slow[:, i - 1] + np.sqrt(1 - np.exp(-0.4)) * kicks[:, i]
        values = level * white if trial % 2 else 0.5 * white + slow.ravel()
        further += bool(fitted(values).further)
    assert further <= 1


def test_a_tone_is_found_at_its_wavelength_and_level_and_the_rest_stays_white():
    rng = np.random.default_rng(3)
    t = np.arange(RUNS * LONG)
    noise = fitted(rng.standard_normal(len(t)) + 0.6 * np.sin(2 * np.pi * t / 18.75 + 1.0))
    (tone,) = [term for term in noise.terms if term.turns]
    assert tone.wavelength == pytest.approx(18.75, rel=2e-3)
    assert tone.sd == pytest.approx(0.6 / np.sqrt(2), rel=0.3)
    assert noise.white == pytest.approx(1.0, rel=0.05)


def test_each_parameter_of_a_law_can_be_moved_alone():
    noise = Noise(1.0, 2.0, 3.0, (Term(4.0, 5.0), Term(6.0, 7.0, 8.0)))
    base = np.log([1.0, 4.0, 3.0, 16.0, 5.0, 36.0, 7.0, 8.0])
    for index in range(8):
        moved = perturbed(noise, index, 0.1)
        far, near = moved.further[1], moved.further[0]
        told = [moved.white**2, moved.correlated**2, moved.length, near.sd**2, near.length, far.sd**2, far.length]
        change = np.log([*told, far.wavelength]) - base
        np.testing.assert_allclose(change, 0.1 * (np.arange(8) == index), atol=1e-12)
