"""False alarms: how often noise alone passes a threshold of a bank of matched filters, and the threshold for a rate.

Outputs above a threshold come in clumps: neighbouring places and widths see the same noise. The rate of clumps is
the rate of single exceedances, each counted by one over the size of its clump, and that size is simulated (Aldous,
Probability Approximations via the Poisson Clumping Heuristic, 1989).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mapping import FloatArray, IntArray
from mapping.detection.filters.matched_filter import (
    LADDER,
    Bank,
    MatchedFilter,
    best_linear,
    build_bank,
    cap_bins,
    colour_in_bins,
    filter_reach,
    on_rungs,
    rung,
    toeplitz,
)
from mapping.instrument import Noise

# Threshold at which clump sizes are measured; they change slowly with it.
TYPICAL_THRESHOLD = 5.0
# Thresholds this near have clumps of the same size, to one or two per cent: a thousandth of the threshold.
THRESHOLD_STEP = 0.125
# Steps an octave of the ladder of banks that thresholds are remembered for.
STEPS_PER_OCTAVE = 16
# Relative uncertainty of the noise that changes a threshold by less than one part in a thousand.
NEGLIGIBLE_UNCERTAINTY = 5e-3


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
    rung_of_bank = _rung_of(bank)

    def solved(near: float) -> float:
        return _solve(_intensity(*rung_of_bank, near), false_alarms_per_metre * bank.spacing)

    normal = solved(round(solved(TYPICAL_THRESHOLD) / THRESHOLD_STEP) * THRESHOLD_STEP)
    if uncertainty < NEGLIGIBLE_UNCERTAINTY:
        return normal
    from scipy.special import ndtr, stdtrit

    # the square of an estimated level with n degrees of freedom has the relative variance 2 / n
    return float(-stdtrit(0.5 / uncertainty**2, float(ndtr(-normal))))


def false_alarms_over(bank: Bank, thresholds: FloatArray) -> FloatArray:
    """(T,) how often per metre noise alone exceeds thresholds (T,), in either sign, 1/m.

    Of the bank of the ladder whose threshold for a rate `threshold_for` remembers, its clumps as large as at
    TYPICAL_THRESHOLD.
    """
    from scipy.special import ndtr

    return np.asarray(2.0 * ndtr(-thresholds) * _intensity(*_rung_of(bank), TYPICAL_THRESHOLD) / bank.spacing)


def _rung_of(bank: Bank) -> tuple[Noise, float, int, int]:
    """The nearest bank of the ladder: its noise and narrowest half-width in bins, filters and drift."""
    colour, _ = colour_in_bins(bank.noise, bank.spacing, bank.samples)
    smallest = rung(bank.filters[0].half_width / bank.spacing, STEPS_PER_OCTAVE)
    return on_rungs(colour, STEPS_PER_OCTAVE), smallest, len(bank.filters), bank.drift


@lru_cache(maxsize=256)
def _intensity(noise: Noise, smallest: float, count: int, drift: int, threshold: float) -> float:
    """Intensity of the clumps of a bank in units of its bins and its noise, remembered."""
    return _clumps(noise, smallest, count, drift).intensity(threshold)


@lru_cache(maxsize=1)
def _clumps(noise: Noise, smallest: float, count: int, drift: int) -> BankClumps:
    """The clumps of a bank in such units: one threshold is asked for after another."""
    return clumps_of(build_bank(noise, 1.0, 1.0, smallest, smallest * LADDER ** (count - 1), drift))


def false_alarm_rate(bank: Bank, threshold: float) -> float:
    """Expected number of clumps of exceedances per metre of path, 1/m."""
    from scipy.special import ndtr

    return float(2 * ndtr(-threshold) * clumps_of(bank).intensity(threshold))


def _solve(intensity: float, rate: float) -> float:
    """u with 2 Q(u) intensity = rate; never under 1.5, where everything would be one clump."""
    from scipy.special import ndtri

    return float(max(-ndtri(min(rate / (2 * intensity), 0.5)), 1.5))


NOISE_DRAWS = 128
# A clump reaches over so many neighbouring widths, and over so many half-widths of path.
NEIGHBOURING_WIDTHS = 8
CLUMP = 1.5
# Every so many-th filter is looked at.
EVERY = 3


@dataclass(frozen=True, eq=False)
class Clumps:
    """Outputs around one output of a filter, in draws of the noise, as they depend on that output's own value.

    Args:
        outputs: (M, D) around the output, in standard deviations, in D draws of the noise.
        response: (M,) by which they change with the output itself.
        own: (D,) the output itself in these draws.
        share: (M,) outputs of the filter's own spacing that each stands for.
        level: (D,) evenly spread over 0 to 1 in an order by chance: quantiles of the output's excess.
    """

    outputs: FloatArray
    response: FloatArray
    own: FloatArray
    share: FloatArray
    level: FloatArray

    def inverse_size(self, threshold: float) -> float:
        """Mean of one over the number of outputs above the threshold, given that the output itself is."""
        from scipy.special import ndtr, ndtri

        exceeding = -ndtri(ndtr(-threshold) * self.level)
        above = self.outputs + self.response[:, None] * (exceeding - self.own) > threshold
        return float(np.mean(1 / np.maximum(self.share @ above, 1.0)))


@dataclass(frozen=True, eq=False)
class BankClumps:
    """Clumps around the outputs of some filters of a bank; those of the filters between them are interpolated.

    Args:
        numbers: (K,) of these filters.
        clumps: around an output of each.
        per_metre: (F,) outputs of every filter per metre of path, 1/m.
    """

    numbers: IntArray
    clumps: list[Clumps]
    per_metre: FloatArray

    def intensity(self, threshold: float) -> float:
        """Outputs per metre of path, each weighted by one over the size of its clump, 1/m."""
        inverse = [each.inverse_size(threshold) for each in self.clumps]
        return float(np.interp(np.arange(len(self.per_metre)), self.numbers, inverse) @ self.per_metre)


def clumps_of(bank: Bank) -> BankClumps:
    """The clumps of a bank: neighbouring filters have nearly the same, but for the outermost ones."""
    weights, last = _Weights(bank), len(bank.filters) - 1
    numbers = np.unique(np.clip([*range(0, last, EVERY), 1, 2, last - 2, last - 1, last], 0, last))
    per_metre = np.array([1.0 / (f.coarse * bank.spacing) for f in bank.filters])
    return BankClumps(numbers, [_clumps_of(bank, int(number), weights) for number in numbers], per_metre)


class _Weights:
    """Weights of a bank's filters in bins of any step, normalised to unit output noise, each worked out once."""

    def __init__(self, bank: Bank) -> None:
        self.bank = bank
        self.known: dict[tuple[float, int], FloatArray] = {}

    def of(self, filter_: MatchedFilter, coarse: int, correlation: FloatArray) -> FloatArray:
        """(2 reach + 1,) weights; `correlation` is the noise's autocovariance in bins of `coarse` of the bank's."""
        key = filter_.half_width, coarse
        if key not in self.known:
            step = coarse * self.bank.spacing
            reach = filter_reach(filter_.half_width, self.bank.noise, step, self.bank.drift)
            x = np.arange(-reach, reach + 1, dtype=np.float64) * step
            template = cap_bins(x, filter_.half_width, step)
            nuisance = (x[:, None] / (reach * step)) ** np.arange(self.bank.drift, dtype=np.float64)
            values, sd = best_linear(correlation[: len(x)], template, nuisance)
            self.known[key] = values[0] / sd[0]
        return self.known[key]


def _clumps_of(bank: Bank, number: int, weights: _Weights) -> Clumps:
    own = bank.filters[number]
    step = own.coarse * bank.spacing
    near = bank.filters[max(0, number - NEIGHBOURING_WIDTHS) : number + NEIGHBOURING_WIDTHS + 1]
    reach = max(filter_reach(f.half_width, bank.noise, step, bank.drift) for f in near)
    shift = int(np.ceil(CLUMP * own.half_width / step))
    count = 2 * (reach + shift) + 1
    correlation = bank.noise.block_covariances(count, step, bank.samples * own.coarse)
    covariance = toeplitz(correlation)
    # A fixed seed: these draws are the nodes of a quadrature, and the same bank has one threshold.
    rng = np.random.default_rng(0)
    root = np.linalg.cholesky(covariance + 1e-12 * covariance[0, 0] * np.eye(count))
    noise = root @ rng.standard_normal((count, NOISE_DRAWS))
    rows = np.concatenate([_shifted(weights.of(f, own.coarse, correlation), count, shift) for f in near])
    middle = _shifted(weights.of(own, own.coarse, correlation), count, 0)[0]
    return Clumps(
        rows @ noise,
        rows @ (covariance @ middle),
        middle @ noise,
        np.repeat([own.coarse / f.coarse for f in near], 2 * shift + 1),
        rng.permutation((np.arange(NOISE_DRAWS) + 0.5) / NOISE_DRAWS),
    )


def _shifted(weights: FloatArray, count: int, shift: int) -> FloatArray:
    """(2 shift + 1, count) the weights in the middle of so many bins, and moved by up to `shift` bins either way."""
    rows = np.zeros((2 * shift + 1, count))
    first = (count - len(weights)) // 2
    for number, row in enumerate(rows):
        row[first + number - shift :][: len(weights)] = weights
    return rows
