"""Local level: how the noise of single bins changes its level by sweep and along the sweeps.

The differences of neighbouring bins tell the level in cells along each sweep, however the path wanders below. What
sampling does not explain of it is a level of each sweep and a process along it, whose variances and length are the
likeliest of a ladder; each cell's expected level follows, shrunk by what is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.base import SweepHeights
from mapping.detection.filters import FILTER_BINS_PER_HALF_WIDTH, Bank

# Share of the absolute differences of neighbouring bins, the smaller ones, whose mean tells the level of a cell: what
# is no noise in less than a quarter of it shifts that little, and positions in steps of the noise's own size, half of
# whose differences may be zero, still tell it, which their median does not. That mean for a Gaussian law, over its sd:
# sqrt(2 / pi) (1 - exp(-q^2 / 2)) / 0.75 with q = 1.1503, the quantile.
SMALLER_SHARE, MEAN_OF_SMALLER = 0.75, 0.51489
# Variance of the logarithm of the variance so told, for one bin; simulated: 5.3 in white noise, 4.1 in correlated noise
# (the median absolute difference: 6.6); by second differences 6.4 and 5.3.
LOG_VARIANCE_PER_BIN, LOG_VARIANCE_BY_BENDS = 5.3, 6.4
# Bins in a cell of the local level: three half-widths of the narrowest filter, which sees the level's mean over two.
LEVEL_BINS = 3 * FILTER_BINS_PER_HALF_WIDTH
# Standard deviations of chi-square by which levels must differ more than sampling makes them: at nine degrees of
# freedom one in five hundred logs of one level has that; it is asked some ten times a log, of filters that see alike
CLEAR_EXCESS = 4.0
# Twice the log-likelihood that a level of its own by sweep and along the sweeps must bring; in 1,600 simulated logs of
# one level (1 to 24 sweeps, 10 to 300 cells each) the likeliest of the ladder brought 11.2 at most; in 600 of 40 to 400
# sweeps (10 and 40 cells each) 7.7 at most.
LEVEL_GAIN = 12.0
# Variances of the logarithm of the variance, and lengths in cells, among which the likeliest are chosen; and sweeps
# that are asked, evenly chosen by how loud they are.
LEVEL_VARIANCES, LEVEL_LENGTHS, ASKED_SWEEPS = (0.0, 0.03, 0.1, 0.3, 1.0, 3.0), (2.0, 4.0, 8.0, 16.0, 32.0), 24


@dataclass(frozen=True, eq=False)
class LocalLevels:
    """How the noise of single bins changes its level.

    Args:
        variance: (n,) of each profile: variance of the bins over the fitted one.
        doubt: variance of its logarithm that remains in a usual cell.
        shared: bins over which that error is shared.
    """

    variance: list[FloatArray]
    doubt: float = 0.0
    shared: float = 1.0

    def doubt_over(self, bins: float) -> float:
        """Variance of the logarithm of the mean level over so many bins."""
        return self.doubt * min(1.0, self.shared / bins)


def local_levels(
    profiles: Sequence[SweepHeights], heights: Sequence[FloatArray], quiet: Sequence[BoolArray], bank: Bank
) -> LocalLevels:
    """The level along each profile, by differences of neighbouring quiet bins, for the samples that these have.

    Where nothing of a profile is quiet, its noise may be what was taken for details: all of its bins tell the level, by
    their second differences. Details leave little of these, for they are many bins wide: a crest of height H one
    72nd of H.

    Args:
        profiles: with bins of the bank's width.
        heights: (n,) of each, m, without what is clearly no noise.
        quiet: (n,) of each: False where something was taken out.
        bank: filters for the fitted noise.
    """
    told = [_told(profile, height, keep, bank) for profile, height, keep in zip(profiles, heights, quiet, strict=True)]
    ones = [np.ones(len(h)) for h in heights]
    y = np.concatenate([each for each, _ in told])
    v = np.concatenate([each for _, each in told])
    known = np.isfinite(v)
    if known.sum() < 3:
        return LocalLevels(ones)
    centre = float(np.average(y[known], weights=1 / v[known]))
    told = [(np.where(np.isfinite(v), y - centre, 0.0), v) for y, v in told]
    prior = _level_prior(told)
    if prior is None:
        return LocalLevels(ones)
    from mapping.detection.level_kernels import expected_level

    levels = [expected_level(y, v, *prior) for y, v in told]
    variance = [np.exp(centre + _at_bins(level[:, 0], len(h))) for level, h in zip(levels, heights, strict=True)]
    doubt = float(np.median(np.concatenate([level[:, 1] for level in levels])))
    # so many cells say it together, and err together
    cells = float(np.median(v[known])) / max(doubt, np.finfo(float).tiny)
    return LocalLevels(variance, doubt, LEVEL_BINS * max(1.0, cells))


def _at_bins(level: FloatArray, bins: int) -> FloatArray:
    """(bins,) of the levels (C,) in the cells that they are divided into."""
    return np.interp(np.arange(bins), (np.arange(len(level)) + 0.5) * bins / len(level), level)


def _told(profile: SweepHeights, height: FloatArray, quiet: BoolArray, bank: Bank) -> tuple[FloatArray, FloatArray]:
    """(C,) logarithm of the variance over the fitted one in each cell of a profile, and its sampling variance, infinite
    where nothing is known."""
    counts = np.diff(profile.first)
    lags = bank.noise.block_covariances(3, bank.spacing, bank.samples)
    share = bank.noise.white**2 / np.maximum(counts, 1)
    correlated, felt = lags - [bank.noise.white**2 / bank.samples, 0.0, 0.0], counts > 0

    def relative(differences: FloatArray, variance: FloatArray, known: BoolArray) -> FloatArray:
        sd = np.sqrt(np.maximum(variance, np.finfo(float).tiny))
        return np.where(known, np.abs(differences) / sd, np.nan)

    keep = quiet & felt  # an empty bin lies between its neighbours
    variance = share[1:] + share[:-1] + max(2 * (correlated[0] - correlated[1]), 0.0)
    told = _by_cells(relative(np.diff(height), variance, keep[1:] & keep[:-1]), LOG_VARIANCE_PER_BIN)
    if np.isfinite(told[1]).any() or len(counts) < 3:
        return told
    variance = share[2:] + 4 * share[1:-1] + share[:-2] + max(float(correlated @ [6.0, -8.0, 2.0]), 0.0)
    known = felt[2:] & felt[1:-1] & felt[:-2]
    return _by_cells(relative(np.diff(profile.height, 2), variance, known), LOG_VARIANCE_BY_BENDS)


def _by_cells(step: FloatArray, variance_per_bin: float) -> tuple[FloatArray, FloatArray]:
    """(C,) logarithm of the mean square of differences (n,) over their sd in each cell, and its sampling variance;
    differences that are not known are NaN."""
    cells = max(1, len(step) // LEVEL_BINS)
    edges = np.linspace(0, len(step), cells + 1).astype(np.int64)
    y, v = np.zeros(cells), np.full(cells, np.inf)
    for c in range(cells):
        part = step[edges[c] : edges[c + 1]]
        part = part[np.isfinite(part)]
        if len(part) >= FILTER_BINS_PER_HALF_WIDTH:
            smaller = np.partition(part, int(SMALLER_SHARE * len(part)))[: int(SMALLER_SHARE * len(part))]
            y[c] = 2 * np.log(max(float(smaller.mean()) / MEAN_OF_SMALLER, 1e-12))
            v[c] = variance_per_bin / len(part)
    return y, v


def _level_prior(told: Sequence[tuple[FloatArray, FloatArray]]) -> tuple[float, float, float] | None:
    """Variances by sweep and along the sweeps and length in cells that are likeliest; None if none is needed."""
    told = [(y, v) for y, v in told if np.isfinite(v).any()]
    errors = np.array([1 / float(np.sum(1 / v)) for _, v in told])
    of_sweep = errors * np.array([float(y @ (1 / v)) for y, v in told])
    between = excess(of_sweep, errors)
    y, v = np.concatenate([y for y, _ in told]), np.concatenate([v for _, v in told])
    if between == 0.0 and excess(y[np.isfinite(v)], v[np.isfinite(v)]) == 0.0:
        return None
    from mapping.detection.level_kernels import level_likelihood

    # a few sweeps of another level may have any numbers: all levels must be among those that are asked
    ranks = np.unique(np.linspace(0, len(told) - 1, ASKED_SWEEPS).astype(np.int64))
    chosen = [told[i] for i in np.argsort(of_sweep, kind="stable")[ranks]]

    def likelihood(prior: tuple[float, float, float]) -> float:
        return float(sum(level_likelihood(y, v, *prior) for y, v in chosen))

    lengths = {along: LEVEL_LENGTHS if along else LEVEL_LENGTHS[:1] for along in LEVEL_VARIANCES}
    priors = [(b, along, length) for b in LEVEL_VARIANCES for along in LEVEL_VARIANCES for length in lengths[along]]
    nothing, *others = [likelihood(prior) for prior in priors]
    best = int(np.argmax(others))
    return priors[best + 1] if 2 * (others[best] - nothing) > LEVEL_GAIN else None


def excess(values: FloatArray, errors: FloatArray) -> float:
    """Variance of values beyond what their errors explain; zero unless chi-square is CLEAR_EXCESS sds high."""
    if len(values) < 3:
        return 0.0
    weight = 1 / errors
    q = float(weight @ values**2)
    count = len(values) - 1
    if q < count + CLEAR_EXCESS * np.sqrt(2 * count):
        return 0.0
    return (q - count) / float(weight.sum() - weight @ weight / weight.sum())
