"""Empirical null: how far the filters' outputs scatter where nothing is, against what the fitted noise says.

A fitted law of noise is one law for all sweeps and places. Real noise changes its level from sweep to sweep and along
a sweep, has a colour that no simple law has, drifts and is rough. Whatever it is, it shows on the quiet path: in the
differences of neighbouring bins, which tell the local level, and in the outputs of the matched filters themselves,
which under the fitted law have unit variance. What sampling alone would do is shrunk away, so that noise as fitted
costs nothing. (Efron, Large-scale simultaneous hypothesis testing: the choice of a null hypothesis, JASA 99, 2004;
cells along the path are the reference windows of CFAR, Rohling 1983; shrinkage: Efron and Morris, JASA 70, 1975.)

The quiet path is what is not clearly a feature under the scale known so far, which grows from the fitted one: clear
features never enter the scale, and noise that was taken for such does so step by step, until nothing changes.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.base import SweepHeights
from mapping.detection.filters import Bank
from mapping.detection.local_level import LOG_VARIANCE_PER_BIN, excess, local_levels
from mapping.instrument import MAD_TO_SD, Noise, robust_sd, running_mean, running_means

# The scale of unit outputs is read from their median absolute value, which what is no noise in less than half of a cell
# shifts little. Variance of the logarithm of the variance so read in a cell of one half-width; simulated with white and
# correlated noise and with and without a drift: 2.6 to 4.5, the largest for white noise.
LOG_VARIANCE_PER_WIDTH = 4.2
# Half-widths in a cell: the fewest over which the median's own bias stays below 0.03 in the logarithm of the variance.
CELL_WIDTHS = 12.0
# A sweep that is shorter than this many half-widths of a filter says nothing of its own about that filter's level.
LEAST_SWEEP_WIDTHS = 2 * CELL_WIDTHS
# Filters between one that is measured and the next: neighbours on the ladder see nearly the same.
STRIDE = 3
# Places of a profile that tell how loud it is along it, and groups that places of like loudness are put into: a group
# holds a twentieth of the path, which is what a limit of 95 % is about.
PLACES_A_PROFILE, LOUDNESS_GROUPS = 64, 20
# Standard deviations within which 95 % of a normal variable's values are, from below
CERTAIN = 1.6448536
# Correlation lengths among which that of the effective noise is chosen: a quarter of an octave apart or less.
CORRELATION_LENGTHS = 40
# Samples come unevenly where the variance that the narrowest filter sees differs by more than this share: less is the
# binning's own.
ALIKE_SAMPLED = 0.1
# Share of a filter's width from which features may have been taken out: its output loses that share of its variance.
MISSING_SHARE = 0.1
# Core standard deviations between which outputs are counted, and Student's degrees of freedom among which those of
# their tails are chosen, a tenth apart.
TAIL_EDGES = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0])
TAIL_DEGREES = np.geomspace(3.0, 100.0, 37)


@dataclass(frozen=True, eq=False)
class NullScale:
    """Measured over fitted standard deviation of the filters' outputs along one profile.

    Args:
        pooled: (F,) for each filter of the bank, over all sweeps.
        own: (F, C) by which this profile's cells differ from that.
        sampled: (n,) variance of the bins over the fitted one for how many samples they have.
        local: (n,) variance of the bins over that.
        doubt: (F,) by which a Gaussian threshold must rise for these being uncertain, and for heavier tails.
        tails: (F,) by which it must rise for the tails alone.
        spacing: width of a profile bin, m.
        widths: (F,) half-widths of the filters, m.
        least: (F,) what rounding alone leaves: no path is quieter.
    """

    pooled: FloatArray
    own: FloatArray
    sampled: FloatArray
    local: FloatArray
    doubt: FloatArray
    tails: FloatArray
    spacing: float
    widths: FloatArray
    least: FloatArray

    @property
    def as_fitted(self) -> bool:
        """True if the outputs scatter as the fitted noise says of so many samples, everywhere."""
        return all(bool((each == 1.0).all()) for each in (self.pooled, self.own, self.local, self.doubt))

    @property
    def sampled_alike(self) -> bool:
        """True if all bins have as many samples, or nearly."""
        return bool((self.sampled == 1.0).all())

    @cached_property
    def _middles(self) -> FloatArray:
        cells = self.own.shape[1]
        return np.asarray((np.arange(cells) + 0.5) * len(self.local) / cells)

    def level(self, k: int) -> FloatArray:
        """(n,) of the k-th filter in each bin, as it is likeliest, were all bins sampled alike."""
        own = np.full(len(self.local), self.pooled[k] * self.own[k, 0])
        if self.own.shape[1] > 1:
            own = self.pooled[k] * np.exp(np.interp(np.arange(len(own)), self._middles, np.log(self.own[k])))
        return np.asarray(np.maximum(own * seen(self.local, self.widths[k] / self.spacing), self.least[k]))

    def along(self, k: int) -> FloatArray:
        """(n,) of the k-th filter in each bin, doubt and sampling included: what the threshold is a multiple of."""
        return np.asarray(self.doubt[k] * self.level(k) * seen(self.sampled, self.widths[k] / self.spacing))

    def at(self, half_width: float, place: float) -> float:
        """Of the filter nearest to a half-width, m, at a bin."""
        return float(np.interp(place, np.arange(len(self.local)), self.along(self.nearest(half_width))))

    def nearest(self, half_width: float) -> int:
        """Number of the filter nearest to a half-width, m."""
        return int(np.abs(np.log(self.widths / half_width)).argmin())

    def doubt_at(self, half_width: float) -> float:
        """Factor of a threshold for the filter nearest to a half-width, m; beyond all filters that of the last."""
        return float(self.doubt[self.nearest(min(half_width, float(self.widths[-1])))])


def null_scales(
    profiles: Sequence[SweepHeights],
    heights: Sequence[FloatArray],
    quiet: Sequence[BoolArray],
    bank: Bank,
    threshold: float,
    rounding: float,
    tails: FloatArray | None = None,
) -> list[NullScale]:
    """The scale of each profile.

    Args:
        profiles: with bins of the bank's width.
        heights: (n,) of each, m, without what exceeds the threshold.
        quiet: (n,) of each: False where something was taken out.
        bank: filters for the fitted noise.
        threshold: signal-to-noise ratio at which the scale must serve.
        rounding: standard deviation that every sample has at least, m.
        tails: (F,) factors for heavier tails, from where nothing exceeds the threshold; None: measured here.

    Method:
        log variance of an output in cell c of sweep j = a_k + level_j(s) + b_j + w_jc: the level from differences of
        bins, a Gaussian process along the sweeps; the rest, of the filter's own outputs, shrunk by the share of its
        variance that sampling does not explain (empirical Bayes, moments); a_k is zero unless the outputs contradict
        that (Schwarz 1978).
    """
    widths = np.array([f.half_width for f in bank.filters])
    levels = local_levels(profiles, heights, quiet, bank)
    local = levels.variance
    told_of = [sampling(p, bank) for p in profiles]
    sampled = [np.ones(len(h)) if told is None else told for h, told in zip(heights, told_of, strict=True)]
    both = [one * other for one, other in zip(local, sampled, strict=True)]
    least = np.array([_output_variance(bank, k, Noise(rounding)) / f.sd**2 for k, f in enumerate(bank.filters)]) ** 0.5
    pooled, doubt, heavier = (np.ones(len(widths)) for _ in range(3))
    own = [np.ones((len(widths), _cells(p, widths[0]))) for p in profiles]
    inherited, variance = [np.zeros(each.shape[1]) for each in own], 0.0
    measured = [*range(0, len(widths), STRIDE)]
    for k in measured:
        outputs = [_outputs(h, q, v, bank, k, float(least[k])) for h, q, v in zip(heights, quiet, both, strict=True)]
        together = np.concatenate([each[np.isfinite(each)] for each in outputs])
        length = len(together) * bank.filters[k].coarse * bank.spacing
        if length < CELL_WIDTHS * widths[k]:
            for factor in (pooled, doubt, heavier):
                factor[k:] = factor[k - STRIDE] if k else 1.0
            for each in own:
                each[k:] = each[[k - STRIDE]] if k else 1.0
            break
        told = [_cell_levels(z, len(i), bank, k) for z, i in zip(outputs, inherited, strict=True)]
        if all(p.length >= LEAST_SWEEP_WIDTHS * widths[k] for p in profiles):
            inherited, variance = _deviations(told)
        error = LOG_VARIANCE_PER_WIDTH * widths[k] / length + _spread(inherited)
        unsure = variance + levels.doubt_over(2 * widths[k] / bank.spacing)
        if bank.noise.further:
            unsure = unsure + error
        heavier[k] = _heavier_tail(together, length / widths[k], threshold) if tails is None else tails[k]
        # an uncertain level makes such tails, too
        doubt[k] = max(_doubt(0.5 * np.sqrt(unsure), threshold), heavier[k])
        level = 2 * np.log(max(robust_sd(together), 1e-12))
        if bank.noise.further:
            # a sum of processes stands in for a law that is none: its ripple is measured, not doubted
            pooled[k] = np.exp(0.5 * level)
        else:
            pooled[k] = _likely_scale(level, error, length / widths[k], len(measured))
        if not any(deviation.any() for deviation in inherited):
            # one level everywhere: the fitted one is not undercut, for many a law has lighter middles than tails
            pooled[k] = max(1.0, pooled[k])
        for each, deviation in zip(own, inherited, strict=True):
            each[k] = np.exp(0.5 * deviation)
    pooled, doubt, heavier = (_between(each, measured) for each in (pooled, doubt, heavier))
    own = [_between(each, measured) for each in own]
    return [
        NullScale(pooled, each, known, v, doubt, heavier, bank.spacing, widths, least)
        for each, known, v in zip(own, sampled, local, strict=True)
    ]


def limit_along(bank: Bank, scales: Sequence[NullScale], threshold: float, tip_radius: float) -> float:
    """Height of a sharp crest that is found with 95 % probability at a place by chance along all profiles, m.

    Where the noise is louder less is found: at each place the probability is Phi of the signal-to-noise ratio, which
    grows as the 5/4th power of the height, less the threshold (theory equation 6.13), and its mean over the path is
    what is promised. Places are put together by how loud they are.
    """
    from scipy.optimize import brentq
    from scipy.special import ndtr

    filters = range(len(bank.filters))
    parts = []
    for scale in scales:
        places = np.arange(0, len(scale.local), max(1, len(scale.local) // PLACES_A_PROFILE))
        parts.append(np.array([scale.along(k)[places] for k in filters]))
    levels = np.concatenate(parts, axis=1)
    usual = bank.scaled(np.median(levels, axis=1)).detection_limit(threshold, tip_radius)
    if not np.isfinite(usual):
        return usual
    widths = np.array([f.half_width for f in bank.filters])
    at = int(np.abs(np.log(widths / np.sqrt(2 * tip_radius * usual))).argmin())
    groups = np.array_split(np.argsort(levels[at], kind="stable"), min(LOUDNESS_GROUPS, levels.shape[1]))
    told = [bank.scaled(levels[:, group].mean(axis=1)).detection_limit(threshold, tip_radius) for group in groups]
    shares = np.array([len(group) for group in groups]) / levels.shape[1]
    found = float(ndtr(CERTAIN))

    def excess(logarithm: float) -> float:
        signal = (threshold + CERTAIN) * (np.exp(logarithm) / np.array(told)) ** 1.25
        return float(shares @ ndtr(signal - threshold)) - found

    low, high = np.log(min(told)), np.log(max(told))
    if not np.isfinite(high) or excess(low) >= 0 or excess(high) <= 0:
        return max(told)
    return float(np.exp(brentq(excess, low, high, xtol=1e-4)))


def effective_noise(bank: Bank, scales: Sequence[NullScale]) -> Noise:
    """The noise under which the filters' outputs scatter as measured, for all who need one law.

    The variance of a filter's output is linear in the variances of all parts: white noise, one process whose length is
    chosen from a ladder, and the fitted further terms, with the least relative errors over the filters and over the
    white level of single samples, each weighed by how well a path of that length tells it: single bins tell the level,
    and a wide filter sees few places.
    """
    from scipy.optimize import nnls

    numbers = range(0, len(bank.filters), STRIDE)
    measured = [np.mean([np.mean(scale.level(k) ** 2) for scale in scales]) for k in numbers]
    target = np.array([bank.filters[k].sd ** 2 * m for k, m in zip(numbers, measured, strict=True)])
    level = float(np.mean([scale.local.mean() for scale in scales])) * bank.noise.white**2
    bins = sum(len(scale.local) for scale in scales)
    seen = np.array([bins * bank.spacing / bank.filters[k].half_width for k in numbers]) / LOG_VARIANCE_PER_WIDTH
    weights = np.sqrt(np.append(seen, bins / LOG_VARIANCE_PER_BIN))

    def shape(noise: Noise) -> FloatArray:
        own = [_output_variance(bank, k, noise) for k in numbers] / target
        return np.asarray(np.append(own, noise.white**2 / level) * weights)

    kept = [shape(Noise(1.0)), *(shape(Noise(0.0, 0.0, 1.0, (replace(t, sd=1.0),))) for t in bank.noise.further)]
    best, noise = np.inf, bank.noise
    for length in np.geomspace(2 * bank.spacing, bank.filters[-1].half_width, CORRELATION_LENGTHS):
        shapes = np.column_stack([*kept, shape(Noise(0.0, 1.0, float(length)))])
        levels, misfit = nnls(shapes, weights)
        if misfit < best:
            white, *further, correlated = np.sqrt(levels).tolist()
            terms = (replace(t, sd=sd) for t, sd in zip(bank.noise.further, further, strict=True) if sd > 0)
            best, noise = misfit, Noise(white, correlated, float(length), tuple(terms))
    return noise


def _output_variance(bank: Bank, k: int, noise: Noise) -> float:
    """Variance of what the weights of the k-th filter make of another noise, m^2."""
    f = bank.filters[k]
    covariance = noise.block_covariances(len(f.weights), f.coarse * bank.spacing, f.coarse * bank.samples)
    return float(f.weights @ np.convolve(f.weights, np.concatenate([covariance[:0:-1], covariance]), mode="valid"))


def _between(values: FloatArray, measured: Sequence[int]) -> FloatArray:
    """(F, ...) values of all filters from those of the measured ones, by the logarithm; the last one's beyond."""
    out = values.copy()
    for low, high in itertools.pairwise(measured):
        for k in range(low + 1, high):
            share = (k - low) / (high - low)
            out[k] = values[low] ** (1 - share) * values[high] ** share
    out[measured[-1] :] = values[measured[-1]]
    return out


def _cells(profile: SweepHeights, width: float) -> int:
    """Cells of a profile for its narrowest filter."""
    return max(1, int(profile.length / (CELL_WIDTHS * width)))


def sampling(profile: SweepHeights, bank: Bank) -> FloatArray | None:
    """(n,) variance of the bins' noise over the bank's for how many samples each has; None where they come evenly."""
    white = bank.noise.white**2 / bank.samples
    share = white / max(white + bank.noise.correlated_sd**2, np.finfo(float).tiny)
    variance = 1.0 + share * (bank.samples * profile.white_variance - 1.0)
    narrowest = seen(variance, bank.filters[0].half_width / bank.spacing)
    return variance if np.abs(narrowest**2 - 1.0).max() > ALIKE_SAMPLED else None


def seen(local: FloatArray, bins: float) -> FloatArray:
    """(n,) by which the sd of a filter of so many bins' half-width differs where bins have these variances (n,)."""
    return np.asarray(seen_by_each(local, np.array([bins]))[0])


def seen_by_each(local: FloatArray, bins: FloatArray) -> FloatArray:
    """(F, n) the same for filters of half-widths (F,)."""
    if (local == local[0]).all():
        return np.full((len(bins), len(local)), np.sqrt(local[0]))
    return np.sqrt(running_means(local, np.maximum(0.5 * bins, 1.0).astype(np.int64)))


def _outputs(height: FloatArray, quiet: BoolArray, local: FloatArray, bank: Bank, k: int, least: float) -> FloatArray:
    """Outputs of a filter over their sd, one a coarse bin; NaN where it sees not all quiet path, or noise below the
    rounding, `least`, whose level is known."""
    f = bank.filters[k]
    if len(height) < 2 * f.coarse:
        return np.full(0, np.nan)
    crest, sd = f.heights(bank.levelled(height))
    z, bins, places = crest / sd, f.half_width / bank.spacing, slice(None, len(crest) * f.coarse, f.coarse)
    if not (local == 1.0).all():
        scale = seen(local, bins)[places]
        z /= np.maximum(scale, least)
        z[scale < least] = np.nan
    if not quiet.all():
        z[running_mean((~quiet).astype(np.float64), max(1, int(bins)))[places] > MISSING_SHARE] = np.nan
    return np.asarray(z)


def _cell_levels(z: FloatArray, cells: int, bank: Bank, k: int) -> tuple[FloatArray, FloatArray]:
    """(cells,) logarithm of the variance in each cell, NaN where unknown, and its sampling variance."""
    edges = np.linspace(0, len(z), cells + 1).astype(np.int64)
    level, variance = np.full(cells, np.nan), np.full(cells, np.inf)
    step = bank.filters[k].coarse * bank.spacing
    known = np.isfinite(z)
    ends = np.concatenate([[0], np.cumsum(known)])[edges]
    counts, values = np.diff(ends), z[known]
    for count in np.unique(counts):  # cells with as many values at once: there are thousands of cells
        width = count * step / bank.filters[k].half_width
        if width >= 1.0:
            alike = counts == count
            rows = values[ends[:-1][alike, None] + np.arange(count)]
            level[alike] = 2 * np.log(np.maximum(MAD_TO_SD * np.median(np.abs(rows), axis=1), 1e-12))
            variance[alike] = LOG_VARIANCE_PER_WIDTH / width
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
    within = excess(cells, sampled)
    # the mean of a sweep's cells scatters with them
    eb = eb + within / np.array([max(1, int(np.isfinite(y).sum())) for y, _ in told])
    centre = float(np.average(b[known], weights=1 / eb[known]))
    between = excess(b[known] - centre, eb[known])
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


def _heavier_tail(outputs: FloatArray, count: float, threshold: float) -> float:
    """Factor by which a Gaussian threshold rises for outputs (M,) whose tails are heavier than Gaussian ones.

    Counts of outputs between TAIL_EDGES of their core's sd are Student's t's, its degrees of freedom the likeliest of
    a ladder, if that is likelier than Gaussian by Schwarz' criterion. Of both signs the smaller count stands for both:
    what is too weak to be found makes one of them larger.

    Args:
        count: so many of the outputs are independent.
        threshold: in standard deviations; outputs beyond may have been taken out.
    """
    core = robust_sd(outputs)
    edges = TAIL_EDGES[threshold - 0.25 > TAIL_EDGES]
    if core <= 0.0 or len(edges) < 3:
        return 1.0
    both = [
        np.diff(np.searchsorted(np.sort(side[side >= 0.0]), core * edges), prepend=0) for side in (outputs, -outputs)
    ]
    return _student_factor(2.0 * np.minimum(*both) * (count / len(outputs)), edges, threshold)


def _student_factor(counts: FloatArray, edges: FloatArray, threshold: float) -> float:
    """The same from counts (E,) of independent outputs below each of the edges (E,) and above the one before."""
    from scipy.special import ndtr, stdtr, stdtrit

    def likelihood(below: FloatArray) -> float:
        shares = np.diff(2.0 * below - 1.0, prepend=0.0)
        return float(counts @ np.log(shares / shares.sum()))

    # the same core for all: half of the outputs are below its median
    medians = stdtrit(TAIL_DEGREES, 0.75)
    told = [likelihood(stdtr(n, edges * m * MAD_TO_SD)) for n, m in zip(TAIL_DEGREES, medians, strict=True)]
    best = int(np.argmax(told))
    if 2.0 * (told[best] - likelihood(ndtr(edges))) <= np.log(max(counts.sum(), 2.0)) + 2.0 * np.log(len(TAIL_DEGREES)):
        return 1.0
    quantile = -stdtrit(TAIL_DEGREES[best], float(ndtr(-threshold)))
    return float(max(1.0, quantile / (medians[best] * MAD_TO_SD) / threshold))


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
