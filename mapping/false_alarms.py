"""False alarms: how often a bank of matched filters is fooled by noise alone, and the threshold for a given rate.

Outputs above a threshold come in clumps: neighbouring places and widths see the same noise. The rate of clumps is
the rate of single exceedances, each counted by one over the size of its clump (Aldous, Probability Approximations
via the Poisson Clumping Heuristic, 1989). The size is averaged over noise drawn given that one output exceeds.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mapping.matched_filter import (
    LADDER,
    Bank,
    best_linear,
    build_bank,
    cap_bins,
    colour_in_bins,
    filter_reach,
    rung,
    toeplitz,
)
from mapping.noise import Noise

FloatArray = NDArray[np.float64]

DRAWS = 128
# A clump reaches over so many neighbouring widths, and over so many half-widths of path.
NEIGHBOURS = 8
CLUMP = 1.5
# Threshold at which clump sizes are measured; they change slowly with it.
TYPICAL_THRESHOLD = 5.0
# Thresholds this near have clumps of the same size, to one or two per cent: a thousandth of the threshold.
THRESHOLD_STEP = 0.125
# Steps an octave of the ladder of banks that thresholds are remembered for.
COARSE = 16
# Relative uncertainty of the noise that changes a threshold by less than one part in a thousand.
NEGLIGIBLE = 5e-3


def threshold_for(bank: Bank, false_alarms_per_metre: float, uncertainty: float = 0.0) -> float:
    """The signal-to-noise ratio that noise alone exceeds, in either sign, as often per metre as asked.

    The threshold changes by less than a thousandth where the bank changes by one per cent, so it is worked out
    for the nearest bank of a ladder of 4 % steps and remembered: sweep after sweep has the same one.

    Where the level of the noise itself is uncertain, signal over estimated noise is distributed as Student's t
    instead of normally, and noise alone exceeds a higher threshold as often.

    Args:
        bank: of filters.
        false_alarms_per_metre: 1/m.
        uncertainty: relative standard deviation of the filters' noise.
    """
    colour, _ = colour_in_bins(bank.noise, bank.spacing, bank.samples)
    sizes = (
        min(rung(colour.correlated, COARSE), 1.0),
        rung(colour.length, COARSE) if colour.correlated else 0.0,
        rung(bank.filters[0].half_width / bank.spacing, COARSE),
    )

    def solved(near: float) -> float:
        return _solve(_intensity(*sizes, len(bank.filters), bank.drift, near), false_alarms_per_metre * bank.spacing)

    normal = solved(round(solved(TYPICAL_THRESHOLD) / THRESHOLD_STEP) * THRESHOLD_STEP)
    if uncertainty < NEGLIGIBLE:
        return normal
    from scipy.special import ndtr, stdtrit

    # the square of an estimated level with n degrees of freedom has the relative variance 2 / n
    return float(-stdtrit(0.5 / uncertainty**2, float(ndtr(-normal))))


@lru_cache(maxsize=256)
def _intensity(correlated: float, length: float, smallest: float, count: int, drift: int, threshold: float) -> float:
    """`_intensities` of a bank in units of its bins and its noise, remembered."""
    noise = Noise(float(np.sqrt(1.0 - correlated**2)), correlated, length or 1.0)
    bank = build_bank(noise, 1.0, 1.0, smallest, smallest * LADDER ** (count - 1), drift)
    return _intensities(bank, threshold)


def false_alarm_rate(bank: Bank, threshold: float) -> float:
    """Expected number of clumps of exceedances per metre of path, 1/m."""
    from scipy.special import ndtr

    return float(2 * ndtr(-threshold) * _intensities(bank, threshold))


def _solve(intensity: float, rate: float) -> float:
    """u with 2 Q(u) intensity = rate; never under 1.5, where everything would be one clump."""
    from scipy.special import ndtri

    return float(max(-ndtri(min(rate / (2 * intensity), 0.5)), 1.5))


def _intensities(bank: Bank, threshold: float) -> float:
    """Outputs per metre of path, each weighted by one over the size of its clump, 1/m."""
    return sum(_inverse_clump_size(bank, k, threshold) / (f.coarse * bank.spacing) for k, f in enumerate(bank.filters))


def _inverse_clump_size(bank: Bank, index: int, threshold: float) -> float:
    """Mean of one over the number of outputs above the threshold around an output of one filter that is."""
    from scipy.special import ndtr, ndtri

    own = bank.filters[index]
    step = own.coarse * bank.spacing
    near = bank.filters[max(0, index - NEIGHBOURS) : index + NEIGHBOURS + 1]
    reaches = [filter_reach(f.half_width, bank.noise, step, bank.drift) for f in near]
    reach, shift = max(reaches), int(np.ceil(CLUMP * own.half_width / step))
    count = 2 * (reach + shift) + 1
    correlation = bank.noise.block_covariances(count, step, bank.samples * own.coarse)
    covariance = toeplitz(correlation)
    # A fixed seed: these draws are the nodes of a quadrature, and the same bank has one threshold.
    rng = np.random.default_rng(0)
    noise = np.linalg.cholesky(covariance + 1e-12 * covariance[0, 0] * np.eye(count)) @ rng.standard_normal(
        (count, DRAWS)
    )
    weights = {
        f.half_width: _on_grid(f.half_width, r, step, correlation, bank) for f, r in zip(near, reaches, strict=True)
    }
    centred = np.zeros(count)
    half = len(weights[own.half_width]) // 2
    centred[reach + shift - half : reach + shift + half + 1] = weights[own.half_width]
    exceeding = -ndtri(ndtr(-threshold) * rng.permutation((np.arange(DRAWS) + 0.5) / DRAWS))
    noise += np.outer(covariance @ centred, exceeding - centred @ noise)
    size = np.zeros(DRAWS)
    for f, r in zip(near, reaches, strict=True):
        seen = noise[reach - r : count - (reach - r)]
        outputs = np.lib.stride_tricks.sliding_window_view(seen, 2 * r + 1, axis=0) @ weights[f.half_width]
        size += (outputs > threshold).sum(axis=0) * own.coarse / f.coarse
    return float(np.mean(1 / np.maximum(size, 1.0)))


def _on_grid(half_width: float, reach: int, step: float, correlation: FloatArray, bank: Bank) -> FloatArray:
    """Weights, normalised to unit output noise, of the filter of a half-width in bins of the given step."""
    x = np.arange(-reach, reach + 1, dtype=np.float64) * step
    template = cap_bins(x, half_width, step)
    if not bank.drift and not correlation[1 : len(x)].any():
        return np.asarray(template / np.sqrt(template @ template * correlation[0]))
    nuisance = (x[:, None] / (reach * step)) ** np.arange(bank.drift, dtype=np.float64)
    weights, sd = best_linear(correlation[: len(x)], template, nuisance)
    return np.asarray(weights[0] / sd[0])
