"""Empirical null: how far the filters' outputs scatter where nothing is, against what the fitted noise says.

A fitted law of noise is one law for all sweeps and places. Real noise changes its level from sweep to sweep and along
a sweep, has a colour that no simple law has, drifts and is rough. Whatever it is, it shows in the outputs of the
matched filters themselves: under the fitted law each has unit variance. Here their variance is measured, width by
width, sweep by sweep and along each sweep, and what sampling alone would do is shrunk away, so that noise as fitted
costs nothing. (Efron, Large-scale simultaneous hypothesis testing: the choice of a null hypothesis, JASA 99, 2004;
cells along the path are the reference windows of CFAR, Rohling 1983; shrinkage: Efron and Morris, JASA 70, 1975.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapping import FloatArray
from mapping.base import SweepHeights
from mapping.detection.matched_filter import Bank

# The variance of unit outputs is read from their median absolute value, 0.6745 standard deviations, which a feature
# in less than half of a cell shifts little.
MEDIAN_OF_UNIT_NORMAL = 0.6744897501960817
# Variance of the logarithm of that variance in a cell of one half-width; simulated with white and correlated noise and
# with and without a drift: 2.6 to 4.5, the largest for white noise.
LOG_VARIANCE_PER_WIDTH = 4.2
# Half-widths in a cell: the fewest over which the median's own bias stays below 0.03 in the logarithm of the variance.
CELL_WIDTHS = 12.0
# A sweep that is shorter than this many half-widths of a filter says nothing of its own about that filter's level.
LEAST_SWEEP_WIDTHS = 2 * CELL_WIDTHS
# Standard deviations of chi-square by which levels must differ more than sampling makes them: at nine degrees of
# freedom one in five hundred logs of one level has that; it is asked some ten times a log, of filters that see alike
CLEAR_EXCESS = 4.0


@dataclass(frozen=True, eq=False)
class NullScale:
    """Measured over fitted standard deviation of the filters' outputs along one profile.

    Args:
        pooled: (F,) for each filter of the bank, over all sweeps.
        own: (F, C) by which this profile's cells differ from that.
        spacing: width of a profile bin, m.
        count: bins of the profile.
        widths: (F,) half-widths of the filters, m.
    """

    pooled: FloatArray
    own: FloatArray
    spacing: float
    count: int
    widths: FloatArray

    @property
    def as_fitted(self) -> bool:
        """True if the outputs scatter as the fitted noise says, everywhere."""
        return bool((self.pooled == 1.0).all() and (self.own == 1.0).all())

    @cached_property
    def _middles(self) -> FloatArray:
        cells = self.own.shape[1]
        return np.asarray((np.arange(cells) + 0.5) * self.count / cells)

    def along(self, k: int) -> FloatArray:
        """(n,) of the k-th filter in each bin."""
        if self.own.shape[1] == 1:
            return np.full(self.count, self.pooled[k] * self.own[k, 0])
        return np.asarray(self.pooled[k] * np.exp(np.interp(np.arange(self.count), self._middles, np.log(self.own[k]))))

    def at(self, half_width: float, place: float) -> float:
        """Of the filter nearest to a half-width, m, at a bin."""
        k = int(np.abs(np.log(self.widths / half_width)).argmin())
        return float(np.interp(place, np.arange(self.count), self.along(k)))


def null_scales(
    profiles: Sequence[SweepHeights],
    heights: Sequence[FloatArray],
    quiet: Sequence[FloatArray],
    bank: Bank,
    threshold: float,
) -> list[NullScale]:
    """The scale of each profile.

    Args:
        profiles: with bins of the bank's width.
        heights: (n,) of each, m, without what is certainly a feature.
        quiet: (n,) of each: weights, 0 where a feature was taken out, else 1.
        bank: filters for the fitted noise.
        threshold: signal-to-noise ratio at which the scale must serve.

    Method:
        log variance of cell c of sweep j = a + b_j + w_jc, each shrunk by the share of its variance that sampling does
        not explain (empirical Bayes, moments); a is zero unless the outputs contradict that (Schwarz 1978).
    """
    widths = np.array([f.half_width for f in bank.filters])
    pooled = np.ones(len(widths))
    own = [np.ones((len(widths), _cells(p, widths[0]))) for p in profiles]
    inherited, doubt = [np.zeros(each.shape[1]) for each in own], 1.0
    for k in range(len(widths)):
        outputs = [_outputs(h, q, bank, k) for h, q in zip(heights, quiet, strict=True)]
        together = np.concatenate([each[np.isfinite(each)] for each in outputs])
        length = len(together) * bank.filters[k].coarse * bank.spacing
        if length < CELL_WIDTHS * widths[k]:
            pooled[k:] = pooled[k - 1] if k else 1.0
            for each in own:
                each[k:] = each[k - 1] if k else 1.0
            break
        level = 2 * np.log(max(float(np.median(together)), 1e-12) / MEDIAN_OF_UNIT_NORMAL)
        told = [_cell_levels(z, len(i), bank, k) for z, i in zip(outputs, inherited, strict=True)]
        if all(p.length >= LEAST_SWEEP_WIDTHS * widths[k] for p in profiles):
            inherited, variance = _deviations(told)
            doubt = _doubt(0.5 * np.sqrt(variance), threshold)
        error = LOG_VARIANCE_PER_WIDTH * widths[k] / length + _spread(inherited)
        pooled[k] = _likely_scale(level, error, length / widths[k], len(widths))
        if not any(deviation.any() for deviation in inherited):
            # one level everywhere: the fitted one is not undercut, for many a law has lighter middles than tails
            pooled[k] = max(1.0, pooled[k])
        for each, deviation in zip(own, inherited, strict=True):
            each[k] = np.exp(0.5 * deviation) * doubt
    return [NullScale(pooled, each, bank.spacing, len(p.height), widths) for each, p in zip(own, profiles, strict=True)]


def typical_scale(scales: Sequence[NullScale]) -> FloatArray:
    """(F,) for each filter, the median over all cells of all profiles."""
    return np.asarray(np.median(np.concatenate([each.pooled[:, None] * each.own for each in scales], axis=1), axis=1))


def _cells(profile: SweepHeights, width: float) -> int:
    """Cells of a profile for its narrowest filter."""
    return max(1, int(profile.length / (CELL_WIDTHS * width)))


def _outputs(height: FloatArray, quiet: FloatArray, bank: Bank, k: int) -> FloatArray:
    """Absolute outputs of a filter over their sd, one a coarse bin; NaN where a feature was taken out."""
    f = bank.filters[k]
    if len(height) < 2 * f.coarse:
        return np.full(0, np.nan)
    crest, sd = f.heights(height)
    z = np.abs(crest) / sd
    z[quiet[: len(z) * f.coarse : f.coarse][: len(z)] == 0] = np.nan
    return np.asarray(z)


def _cell_levels(z: FloatArray, cells: int, bank: Bank, k: int) -> tuple[FloatArray, FloatArray]:
    """(cells,) logarithm of the variance in each cell, NaN where unknown, and its sampling variance."""
    edges = np.linspace(0, len(z), cells + 1).astype(np.int64)
    level, variance = np.full(cells, np.nan), np.full(cells, np.inf)
    step = bank.filters[k].coarse * bank.spacing
    for c in range(cells):
        part = z[edges[c] : edges[c + 1]]
        part = part[np.isfinite(part)]
        width = len(part) * step / bank.filters[k].half_width
        if width >= 1.0:
            level[c] = 2 * np.log(max(float(np.median(part)), 1e-12) / MEDIAN_OF_UNIT_NORMAL)
            variance[c] = LOG_VARIANCE_PER_WIDTH / width
    return level, variance


def _deviations(told: Sequence[tuple[FloatArray, FloatArray]]) -> tuple[list[FloatArray], float]:
    """(cells,) of each sweep: the shrunk deviation of the logarithm of the variance from that of all, and its variance.

    Args:
        told: of each sweep (cells,) logarithms of the variance, and their sampling variances.
    """
    sweeps, errors = [], []
    for y, v in told:
        known = np.isfinite(y)
        weight = np.where(known, 1 / v, 0.0)
        sweeps.append(float(weight @ np.where(known, y, 0.0) / weight.sum()) if known.any() else np.nan)
        errors.append(1 / weight.sum() if known.any() else np.inf)
    b, eb = np.array(sweeps), np.array(errors)
    known = np.isfinite(b)
    if not known.any():
        return [np.zeros(len(y)) for y, _ in told], 0.0
    rest = [y - each for (y, _), each in zip(told, b, strict=True)]
    cells = np.concatenate([r[np.isfinite(r)] for r in rest])
    sampled = np.concatenate([v[np.isfinite(r)] for r, (_, v) in zip(rest, told, strict=True)])
    within = _excess(cells, sampled)
    # the mean of a sweep's cells scatters with them
    eb = eb + within / np.array([max(1, int(np.isfinite(y).sum())) for y, _ in told])
    centre = float(np.average(b[known], weights=1 / eb[known]))
    between = _excess(b[known] - centre, eb[known])
    out = []
    for r, (_, v), each, error in zip(rest, told, b, eb, strict=True):
        sweep = 0.0 if not np.isfinite(each) else (each - centre) * between / (between + error)
        out.append(sweep + np.where(np.isfinite(r), np.nan_to_num(r) * within / (within + np.minimum(v, 1e12)), 0.0))
    usual, of_sweep = float(np.median(sampled)), float(np.median(eb[known]))
    variance = within * usual / (within + usual) if within else 0.0
    return out, variance + (between * of_sweep / (between + of_sweep) if between else 0.0)


def _doubt(sd: float, threshold: float) -> float:
    """Factor on a scale whose logarithm is known to `sd`, so that noise exceeds the threshold as often as it should.

    The tail of a normal variable of uncertain level, averaged over the level (Gauss-Hermite), against the normal tail.
    """
    if sd == 0.0:
        return 1.0
    from scipy.special import ndtr, ndtri

    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    tail = float(weights @ ndtr(-threshold * np.exp(-sd * nodes)) / weights.sum())
    return float(max(1.0, threshold / -ndtri(tail)))


def _excess(values: FloatArray, errors: FloatArray) -> float:
    """Variance of values beyond what their errors explain; zero unless chi-square is CLEAR_EXCESS sds high."""
    if len(values) < 3:
        return 0.0
    weight = 1 / errors
    q = float(weight @ values**2)
    count = len(values) - 1
    if q < count + CLEAR_EXCESS * np.sqrt(2 * count):
        return 0.0
    return (q - count) / float(weight.sum() - weight @ weight / weight.sum())


def _spread(deviations: Sequence[FloatArray]) -> float:
    """Variance of the mean of all cells' deviations."""
    every = np.concatenate(list(deviations))
    return float(np.var(every) / len(every))


def _likely_scale(level: float, variance: float, count: float, filters: int) -> float:
    """exp(level / 2) if a scale of its own is likelier than the fitted one, else 1.

    Schwarz' criterion with the odds of choosing one of so many filters (Chen and Chen, Biometrika 95, 2008).
    """
    penalty = np.log(max(count, 2.0)) + 2.0 * np.log(filters)
    return float(np.exp(0.5 * level)) if level**2 / variance > penalty else 1.0
