"""Matched filters: the best linear detectors of a cap of any size at any place of a noisy profile."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from mapping import FloatArray
from mapping.instrument import Noise, Term

# Ratio of neighbouring half-widths: a cap between two templates loses less than 0.6 % of its signal-to-noise.
LADDER = 1.2
# Bins per half-width: averaging over a bin loses less than 1 %.
FILTER_BINS_PER_HALF_WIDTH = 12


@dataclass(frozen=True, eq=False)
class MatchedFilter:
    """Best linear unbiased estimate of a cap's height from profile bins around a place.

    Args:
        half_width: of the cap 1 - (x/w)^2, m.
        coarse: number of profile bins averaged into one bin of the filter.
        weights: (2 M + 1,) of the filter's bins; applied to heights they give the cap's height.
        edge: (M, 2 M + 1) weights where only i bins exist before the centre; rows i = 0 to M - 1.
        sd: standard deviation of the estimate, m.
        edge_sd: (M,) the same near the ends.
    """

    half_width: float
    coarse: int
    weights: FloatArray
    edge: FloatArray
    sd: float
    edge_sd: FloatArray

    def heights(self, profile: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Estimated height of a cap centred at each coarse bin of a profile (n,), and its standard deviation."""
        from mapping.detection.filters.filter_kernels import filtered

        whole = len(profile) // self.coarse * self.coarse
        bins = profile[:whole].reshape(-1, self.coarse).sum(axis=1) / self.coarse if self.coarse > 1 else profile
        heights, sd = np.empty(len(bins)), np.full(len(bins), self.sd)
        filtered(bins, self.weights, self.edge, heights)
        count = min(len(self.edge), len(bins))
        sd[:count] = self.edge_sd[:count]
        sd[len(bins) - count :] = np.maximum(sd[len(bins) - count :], self.edge_sd[:count][::-1])
        return heights, sd


@dataclass(frozen=True, eq=False)
class Bank:
    """Matched filters of growing half-width.

    Args:
        filters: the filters.
        spacing: width of a profile bin, m.
        samples: samples in a profile bin.
        noise: of single samples.
        drift: number of polynomial terms of the base that each filter ignores (0: the base is known).
    """

    filters: tuple[MatchedFilter, ...]
    spacing: float
    samples: float
    noise: Noise
    drift: int = 0

    def peaks(
        self, profile: FloatArray, longest: float, threshold: float, sharpest: float, certainty: FloatArray | None
    ) -> FloatArray:
        """(P, 4) signal-to-noise ratio, bin, number of the filter and height (m) of local maxima over place.

        Args:
            profile: (n,) heights in bins, m.
            longest: half-width of the widest filter that is asked, m.
            threshold: signal-to-noise ratio that a maximum exceeds.
            sharpest: what is higher than the square of a filter's half-width times this, 1/m, is none of its maxima.
            certainty: (F, n) expected over actual sd of what each filter sees in each bin; None if it is 1.
        """
        from mapping.detection.filters.filter_kernels import peaks

        count, profile = self.fitting(len(profile), longest), self.levelled(profile)
        known = np.zeros((0, 0)) if certainty is None else certainty
        highest = sharpest * self.widths**2
        return np.asarray(peaks(profile, self._in_a_row[0][:count], *self._in_a_row[1:], threshold, highest, known))

    def seen(self, profile: FloatArray, place: int, k: int) -> float:
        """The largest height (m) of either sign that filter k estimates within two of its bins of a place of a profile
        (n,); the profile's ends are seen as ends only where the filter reaches them."""
        each = self.filters[k]
        centre, reach, count = place // each.coarse, len(each.edge) + 2, len(profile) // each.coarse
        low, high = max(0, centre - reach), min(count, centre + reach + 1)
        heights, _ = each.heights(self.levelled(profile[low * each.coarse : high * each.coarse]))
        near = heights[max(0, centre - low - 2) : centre - low + 3]
        return float(near[np.argmax(np.abs(near))])

    def levelled(self, profile: FloatArray) -> FloatArray:
        """Heights (n,) without what of the base no filter may see, by least squares.

        A window that exists, or ends on one side, does not see it anyway. One that both ends cut, of a sweep shorter
        than the filter reaches, knows what one of them takes away: over sweeps of 7 half-widths that stand off each
        other by three standard deviations of a sample that made ten false alarms a metre of one that was asked for.
        """
        if self.drift == 0 or len(profile) <= self.drift:
            return profile
        powers = np.linspace(-1.0, 1.0, len(profile))[:, None] ** np.arange(self.drift, dtype=np.float64)
        return np.asarray(profile - powers @ np.linalg.solve(powers.T @ powers, powers.T @ profile))

    def fitting(self, bins: int, longest: float) -> int:
        """How many filters, from the narrowest on, are not wider than `longest`, m, and see two of their bins at least
        in a profile of so many."""
        return int(((self.widths <= longest) & (2 * self._in_a_row[0] <= bins)).sum())

    @cached_property
    def widths(self) -> FloatArray:
        """(F,) half-widths of the filters, m."""
        return np.array([f.half_width for f in self.filters])

    @cached_property
    def _in_a_row(self) -> tuple[Any, ...]:
        """The filters as one row of numbers each, in the order in which `peaks` of the kernels takes them."""
        rows: list[Any] = [np.array([f.coarse for f in self.filters]), np.array([len(f.edge) for f in self.filters])]
        for parts in (
            [f.weights for f in self.filters],
            [f.edge.ravel() for f in self.filters],
            [f.edge_sd for f in self.filters],
        ):
            rows += [np.cumsum([0, *(len(part) for part in parts)]), np.concatenate(parts)]
        rows.insert(6, np.array([f.sd for f in self.filters]))
        return tuple(rows)

    def scaled(self, scale: FloatArray) -> Bank:
        """The bank where the outputs of each filter (F,) scatter so many times as much as the noise says."""
        filters = (
            replace(f, sd=f.sd * each, edge_sd=f.edge_sd * each) for f, each in zip(self.filters, scale, strict=True)
        )
        return replace(self, filters=tuple(filters))

    def detection_limit(self, threshold: float, tip_radius: float) -> float:
        """Smallest height of a sharp crest under this tip that is detected with 95 % probability, m.

        A crest of height D disturbs sqrt(2 r D) on either side; 1.645 is the 95 % quantile of the noise.
        """
        widths = self.widths
        needed = np.array([f.sd for f in self.filters]) * (threshold + 1.6448536)
        available = widths**2 / (2 * tip_radius)
        enough = available >= needed
        if not enough.any():
            return float(needed[-1])
        first = int(enough.argmax())
        if first == 0:
            return self._between_samples(float(needed[0]), tip_radius)
        excess = np.log(available / needed)[first - 1 : first + 1]
        return float(np.exp(np.interp(0.0, excess, np.log(available)[first - 1 : first + 1])))

    def _between_samples(self, needed: float, tip_radius: float) -> float:
        """Smallest height of a sharp crest that is seen though it is narrower than the narrowest filter, m.

        That is 1.5 bins: the crest may lie on one bin, whose neighbours then hardly feel it, or between two, which then
        feel the ball's arc beside it. The filter's estimate of its height must reach what is needed at the worse of the
        two. Infinite where bins are wider than the ball: between two of them it may feel nothing.

        Args:
            needed: estimate that is above the threshold with 95 % probability, m.
        """
        widest = float(self.filters[0].half_width)
        heights = np.geomspace(needed, 2 * needed + tip_radius, 400)
        worst = np.full(len(heights), np.inf)
        for phase in (0.0, 0.5):
            away2 = ((np.arange(-2, 3) + phase) * self.spacing) ** 2
            template = np.maximum(1 - away2 / widest**2, 0.0)
            below = tip_radius - np.sqrt(np.maximum(tip_radius**2 - away2, 0.0))
            felt = np.where(away2 < tip_radius**2, np.maximum(heights[:, None] - below, 0.0), 0.0)
            worst = np.minimum(worst, felt @ template / (template @ template))
        return float(np.min(heights, where=worst >= needed, initial=np.inf))


def build_bank(noise: Noise, spacing: float, samples: float, smallest: float, largest: float, drift: int = 0) -> Bank:
    """A bank of filters from the smallest half-width to the largest at least, m, LADDER between neighbours.

    Filters know lengths in bins and heights in noise: one bank, remembered, serves every sweep whose noise has the
    same colour, to within the rungs of a ladder of 0.3 %.

    Args:
        noise: of single samples.
        spacing: width of a profile bin, m.
        samples: samples in a profile bin.
        drift: 0 if the base is known; 2 if its offset and slope near a feature are not, 3 with its curvature.
    """
    colour, level = colour_in_bins(noise, spacing, samples)
    count = 1 + max(0, int(np.ceil(np.log(largest / smallest) / np.log(LADDER) - 1e-9)))
    unit = _unit_filters(on_rungs(colour), rung(smallest / spacing), count, drift)
    filters = tuple(
        replace(f, half_width=f.half_width * spacing, sd=f.sd * level, edge_sd=f.edge_sd * level) for f in unit
    )
    return Bank(filters, spacing, samples, noise, drift)


def colour_in_bins(noise: Noise, spacing: float, samples: float) -> tuple[Noise, float]:
    """The noise with bins for length and its level in a bin's mean for height, and that level, m."""
    level = float(np.hypot(noise.white / np.sqrt(samples), noise.correlated_sd))
    level = level if level > 0 else 1.0
    return noise.scaled(1 / level, 1 / spacing, float(samples) ** -0.5), level


def on_rungs(colour: Noise, octave: int = 256) -> Noise:
    """A noise of unit variance with its levels and lengths on the steps of a ladder: near ones become one."""
    correlated, length = rung(colour.correlated, octave), rung(colour.length, octave) if colour.correlated else 0.0
    further = tuple(
        Term(rung(t.sd, octave), rung(t.length, octave), rung(t.wavelength, octave) if t.turns else np.inf)
        for t in colour.further
    )
    # a process shorter than any filter's bin is white noise; no length is needed without a process
    stepped = Noise(0.0, correlated, length or 1.0, further)
    left = 1.0 - stepped.correlated_sd**2
    return replace(stepped, white=left**0.5) if left > 0 else stepped.scaled(1.0 / stepped.correlated_sd)


def rung(size: float, octave: int = 256) -> float:
    """The nearest step of a ladder with so many steps an octave; a power of two times a step is a step."""
    return float(2.0 ** (np.round(octave * np.log2(size)) / octave)) if size > 0 else 0.0


@lru_cache(maxsize=64)
def _unit_filters(noise: Noise, smallest: float, count: int, drift: int) -> tuple[MatchedFilter, ...]:
    """Filters for bins of unit width whose noise has unit variance."""
    return tuple(_build_filter(smallest * LADDER**k, noise, 1.0, 1.0, drift) for k in range(count))


def smallest_half_width(noise: Noise, spacing: float, samples: float, tip_radius: float, threshold: float) -> float:
    """Half-width of the smallest sharp crest that stands out of the noise, m; never under 1.5 bins.

    A crest of half-width w is w^2 / (2 r) high; its estimate has the sd of the matched filter.
    """
    widths = np.geomspace(1.5 * spacing, 4 * tip_radius + 3 * spacing, 40)
    visible = widths**2 / (2 * tip_radius) > threshold * noise.cap_sd(widths, spacing / samples)
    return float(widths[visible.argmax()] if visible.any() else widths[-1])


def cap_bins(positions: FloatArray, half_width: float, spacing: float) -> FloatArray:
    """Means of a cap of unit height over bins whose middles (n,) are `spacing` apart, m; its crest is at 0."""
    from mapping.detection.filters.cap_kernels import caps

    crest = np.zeros(1)
    return np.asarray(caps(positions[0], spacing, len(positions), crest, np.array([half_width]), crest)[0])


def toeplitz(first: FloatArray) -> FloatArray:
    """(n, n) symmetric matrix of a stationary covariance from its first row."""
    index = np.arange(len(first))
    return np.asarray(first[np.abs(np.subtract.outer(index, index))])


def filter_reach(half_width: float, noise: Noise, step: float, drift: int) -> int:
    """Bins that a filter needs on either side: the cap, a stretch to know the drift by, and what noise it shares."""
    reach = int(np.ceil((3.5 if drift else 1.0) * half_width / step))
    if noise.terms:
        reach += int(min(np.ceil(2 * noise.longest / step) + 1, 1.5 * half_width / step + 1))
    return reach


def filter_sd(half_width: float, noise: Noise, spacing: float, samples: float, drift: int) -> float:
    """Standard deviation of the height that the filter of a half-width estimates, m."""
    coarse = max(1, int(half_width / (FILTER_BINS_PER_HALF_WIDTH * spacing)))
    step = coarse * spacing
    reach = filter_reach(half_width, noise, step, drift)
    x = np.arange(-reach, reach + 1, dtype=np.float64) * step
    covariance = noise.block_covariances(2 * reach + 1, step, samples * coarse)
    nuisance = (x[:, None] / (reach * step)) ** np.arange(drift, dtype=np.float64)
    return float(best_linear(covariance, cap_bins(x, half_width, step), nuisance)[1][0])


def _build_filter(half_width: float, noise: Noise, spacing: float, samples: float, drift: int) -> MatchedFilter:
    coarse = max(1, int(half_width / (FILTER_BINS_PER_HALF_WIDTH * spacing)))
    step = coarse * spacing
    reach = filter_reach(half_width, noise, step, drift)
    x = np.arange(-reach, reach + 1, dtype=np.float64) * step
    template = cap_bins(x, half_width, step)
    covariance = noise.block_covariances(2 * reach + 1, step, samples * coarse)
    nuisance = (x[:, None] / (reach * step)) ** np.arange(drift, dtype=np.float64)
    # counted from the far side, what exists of a window that begins i bins before its middle is a leading block
    all_weights, all_sd = best_linear(covariance, template[::-1], nuisance[::-1], reach + 1)
    return MatchedFilter(half_width, coarse, all_weights[-1, ::-1], all_weights[:-1, ::-1], all_sd[-1], all_sd[:-1])


def best_linear(
    covariance: FloatArray, template: FloatArray, nuisance: FloatArray, smallest: int | None = None
) -> tuple[FloatArray, FloatArray]:
    """Weights of the best linear unbiased estimates of the template's amplitude, and their standard deviations.

    Args:
        covariance: (n,) autocovariance of the noise, at lags 0 to n - 1 bins.
        template: (n,).
        nuisance: (n, Q) shapes of the base that the estimate must not see.
        smallest: estimate from the first k bins alone for every k = smallest to n; None: from all n only.

    Returns:
        (n + 1 - smallest, n) weights, zero beyond k, and (n + 1 - smallest,) standard deviations.
    """
    from mapping.detection.filters.toeplitz_kernels import leading_solutions

    columns = np.column_stack([template, nuisance])
    solved = leading_solutions(covariance, columns, len(template) if smallest is None else smallest)
    information = np.einsum("ip,kiq->kpq", columns, solved)
    if nuisance.shape[1] == 0:
        return solved[..., 0] / information[..., 0], 1 / np.sqrt(information[:, 0, 0])
    inverse = np.linalg.pinv(information, hermitian=True)
    return np.einsum("kip,kp->ki", solved, inverse[..., 0]), np.sqrt(np.maximum(inverse[:, 0, 0], 0.0))
