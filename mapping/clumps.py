"""Clumps: how many outputs of a bank of matched filters exceed a threshold together, where noise makes one do so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.matched_filter import Bank, MatchedFilter, best_linear, cap_bins, filter_reach, toeplitz

FloatArray = NDArray[np.float64]

DRAWS = 128
# A clump reaches over so many neighbouring widths, and over so many half-widths of path.
NEIGHBOURS = 8
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

    numbers: NDArray[np.int64]
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
    near = bank.filters[max(0, number - NEIGHBOURS) : number + NEIGHBOURS + 1]
    reach = max(filter_reach(f.half_width, bank.noise, step, bank.drift) for f in near)
    shift = int(np.ceil(CLUMP * own.half_width / step))
    count = 2 * (reach + shift) + 1
    correlation = bank.noise.block_covariances(count, step, bank.samples * own.coarse)
    covariance = toeplitz(correlation)
    # A fixed seed: these draws are the nodes of a quadrature, and the same bank has one threshold.
    rng = np.random.default_rng(0)
    root = np.linalg.cholesky(covariance + 1e-12 * covariance[0, 0] * np.eye(count))
    noise = root @ rng.standard_normal((count, DRAWS))
    rows = np.concatenate([_shifted(weights.of(f, own.coarse, correlation), count, shift) for f in near])
    middle = _shifted(weights.of(own, own.coarse, correlation), count, 0)[0]
    return Clumps(
        rows @ noise,
        rows @ (covariance @ middle),
        middle @ noise,
        np.repeat([own.coarse / f.coarse for f in near], 2 * shift + 1),
        rng.permutation((np.arange(DRAWS) + 0.5) / DRAWS),
    )


def _shifted(weights: FloatArray, count: int, shift: int) -> FloatArray:
    """(2 shift + 1, count) the weights in the middle of so many bins, and moved by up to `shift` bins either way."""
    rows = np.zeros((2 * shift + 1, count))
    first = (count - len(weights)) // 2
    for number, row in enumerate(rows):
        row[first + number - shift :][: len(weights)] = weights
    return rows
