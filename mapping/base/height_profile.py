"""Height profile: one sweep's height over the base, averaged over equal bins of its path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapping import FloatArray, IntArray, Trace, lengths
from mapping.base.base import Base, Feet

# Blocks of a sweep are long enough once doubling them shortens its length by less than this: noise zigzags,
# the path does not.
LENGTH_TOLERANCE = 0.01
LARGEST_FIRST_BLOCK_COUNT = 2000
# Steps in time that exceed the mean by this factor hold samples that were left out.
UNEVEN = 1.5
# A gap of more than this many bins, and of more than this share of the tip radius, cuts a profile: nothing was
# touched there. A shorter one is a tip that was thrown off for a moment; the ball saw no detail that narrow.
LONGEST_BIN_GAP, NARROW = 2, 0.03
# Bins of fewer samples average heights: the mean of two centres on a curved path lies beside it, which shows without
# noise. Bins of more average centres first: the distance of a noisy centre from a kink is biased.
FEW_SAMPLES_PER_BIN = 4


# Of centres (n, 3) amid runs of samples that begin at (n,), the last one ending before a sample: points under them,
# directions from there, heights
Means = Callable[[FloatArray, IntArray, int], tuple[FloatArray, FloatArray, FloatArray]]


@dataclass(frozen=True, eq=False)
class SweepHeights:
    """Heights at equal steps of arclength along one sweep.

    Args:
        sweep: number of the sweep.
        start: arclength of the first bin's middle, m.
        spacing: width of the bins, m.
        height: (n,) mean height over the base in each bin, m.
        samples: samples per bin: white noise has one so many-th of its variance in half of the bins, or less.
        first: (n + 1,) index within the sweep of the first sample of each bin.
        t: (n,) mean times, s.
        centers: (n, 3) mean ball centres, m. Like heights and times they are those at the bins' middles.
        feet: (n, 3) points of the base under these, m; None where single samples were laid, not means.
        normals: (n, 3) unit directions from there to the centres; None likewise.
    """

    sweep: int
    start: float
    spacing: float
    height: FloatArray
    samples: float
    first: IntArray
    t: FloatArray
    centers: FloatArray
    feet: FloatArray | None = None
    normals: FloatArray | None = None

    @property
    def s(self) -> FloatArray:
        """(n,) arclength of the bins' middles, m."""
        return self.start + self.spacing * np.arange(len(self.height), dtype=np.float64)

    @cached_property
    def white_variance(self) -> FloatArray:
        """(n,) of white noise in each bin, over that of single samples, as what spans several bins sees it."""
        return _white_variance(np.diff(self.first))

    @property
    def length(self) -> float:
        """Length of path that the profile covers, m."""
        return self.spacing * len(self.height)

    def coarser(self) -> SweepHeights:
        """The same in bins twice as wide, without what stood under them; an odd last bin is left out."""
        count = len(self.height) // 2
        height, t, centers = (
            0.5 * (each[0 : 2 * count : 2] + each[1 : 2 * count : 2]) for each in (self.height, self.t, self.centers)
        )
        start, first = self.start + 0.5 * self.spacing, self.first[: 2 * count + 1 : 2]
        return SweepHeights(self.sweep, start, 2.0 * self.spacing, height, 2.0 * self.samples, first, t, centers)


def arclength(trace: Trace, base: Base, means: Means | None = None) -> FloatArray:
    """(N,) arclength along the base's trace under one sweep, m, free of the zigzag that noise adds.

    The length of the polyline through block means, with blocks so long that longer ones change it little, each
    lowered onto the base's own trace: foot points would stand still at an edge of the base and jump over a hollow.

    Args:
        trace: the samples of the sweep.
        base: the global model.
        means: gives where means of runs of samples stand, if that is known (see LaidSweep.feet_of_means).
    """
    count = len(trace)
    if count < 2:
        return np.zeros(count)
    size = max(1, count // LARGEST_FIRST_BLOCK_COUNT)
    middle = _block_means(trace.centers, size)
    while count // (2 * size) >= 4:
        longer = _block_means(middle, 2)
        if _length(middle) <= (1 + LENGTH_TOLERANCE) * _length(longer):
            break
        middle, size = longer, 2 * size
    if len(middle) < 2:
        middle, size, means = trace.centers[[0, -1]], count - 1, None
    laid = means or _laid_on(base, trace.tip_radius)
    under, up, _ = laid(middle, size * np.arange(len(middle)), min(size * len(middle), count))
    lowered = under + trace.tip_radius * up
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lowered, axis=0), axis=1))])
    place, middles = _progress(trace, size, len(knots))
    inner = np.interp(place, middles, knots)
    before, after = np.diff(knots[[0, 1, -2, -1]])[::2] / np.diff(middles[[0, 1, -2, -1]])[::2]
    inner += np.minimum(place - middles[0], 0.0) * before + np.maximum(place - middles[-1], 0.0) * after
    return np.asarray(inner - inner[0])


def _progress(trace: Trace, size: int, blocks: int) -> tuple[FloatArray, FloatArray]:
    """(N,) how far each sample is along its sweep, and the means of that over so many blocks.

    The samples' count, as they come evenly; their times where many were left out between some of them.
    """
    steps = np.diff(trace.t)
    even = steps.min() <= 0 or steps.max() <= UNEVEN * steps.mean()
    place = np.arange(len(trace), dtype=np.float64) if even else trace.t - trace.t[0]
    if blocks * size > len(trace):  # two blocks of a sample each: its ends
        return place, place[[0, -1]]
    return place, place[: blocks * size].reshape(blocks, size).mean(axis=1)


def height_profiles(
    sweep: int,
    trace: Trace,
    s: FloatArray,
    base: Base,
    spacing: float,
    feet: Callable[[], Feet] | None = None,
    means: Means | None = None,
) -> tuple[SweepHeights, ...]:
    """The sweep's heights in bins of the given width; more than one profile where contact was lost in between.

    Args:
        trace: the samples of one sweep.
        s: (N,) their arclengths, m (see `arclength`), not decreasing.
        base: the global model.
        spacing: width of the bins, m.
        feet: gives where the samples stand over the base, if that is kept somewhere.
        means: gives where the bins' mean centres stand, likewise (see LaidSweep.feet_of_means).
    """
    # half a step off: evenly spaced samples would sit on the bins' borders, where rounding decides
    step = (s[-1] - s[0]) / max(len(s) - 1, 1)
    bins = np.floor((s - s[0] + 0.5 * step) / spacing).astype(np.int64)
    first = np.flatnonzero(np.diff(bins, prepend=-1) > 0)
    occupied = bins[first]
    counts = np.diff(np.append(first, len(s)))
    place = (np.add.reduceat(s, first) / counts - s[0] + 0.5 * step) / spacing - 0.5
    centers = _at_middles(np.add.reduceat(trace.centers, first, axis=0) / counts[:, None], occupied, place)
    times = _at_middles(np.add.reduceat(trace.t, first) / counts, occupied, place)
    under = up = None
    if counts.mean() < FEW_SAMPLES_PER_BIN:
        laid = base.foot(trace.centers, trace.tip_radius) if feet is None else feet()
        height = _at_middles(np.add.reduceat(laid.height, first) / counts, occupied, place)
    else:
        under, up, height = (means or _laid_on(base, trace.tip_radius))(centers, first, len(s))
    longest = max(LONGEST_BIN_GAP, int(NARROW * trace.tip_radius / spacing))
    cuts = np.flatnonzero(np.diff(occupied) > longest + 1) + 1
    profiles = []
    for begin, end in zip([0, *cuts], [*cuts, len(occupied)], strict=True):
        # a bin that the sweep only begins or ends in is as noisy as its few samples
        enough = 0.5 * np.median(counts[begin:end])
        if end - begin > 2:
            begin, end = begin + (counts[begin] < enough), end - (counts[end - 1] < enough)
        wanted = np.arange(occupied[begin], occupied[end - 1] + 1)
        have = occupied[begin:end]
        edges = np.append(first, len(s))[np.searchsorted(occupied, np.append(wanted, wanted[-1] + 1))]
        middles = np.column_stack([np.interp(wanted, have, centers[begin:end, k]) for k in range(3)])
        profiles.append(
            SweepHeights(
                sweep,
                float(s[0] + (wanted[0] + 0.5) * spacing - 0.5 * step),
                spacing,
                np.interp(wanted, have, height[begin:end]),
                float(1.0 / np.median(_white_variance(np.diff(edges)))),
                edges,
                np.interp(wanted, have, times[begin:end]),
                middles,
                *_filled(under, up, slice(begin, end), have - wanted[0], middles, base, trace.tip_radius),
            )
        )
    return tuple(profiles)


def _white_variance(counts: IntArray) -> FloatArray:
    """(n,) variance of white noise in bins of so many samples (n,), over that of one sample, as long waves see it.

    A bin of n samples has one n-th. One without any lies on the line between those beside it, whose samples stand for
    it as well: where those of one bin stand for w bins, each of these has w / n.
    """
    occupied = np.flatnonzero(counts)
    stands_for = np.ones(len(occupied))
    empty = np.diff(occupied) - 1
    stands_for[:-1] += 0.5 * empty
    stands_for[1:] += 0.5 * empty
    return np.interp(np.arange(len(counts)), occupied, stands_for / counts[occupied])


def _at_middles(means: FloatArray, occupied: IntArray, place: FloatArray) -> FloatArray:
    """(n, ...) values in the middles of bins, from means over their samples, which lie up to half a step beside.

    Bins are as wide for all sweeps, and of most a width is no whole number of steps: on a flank of slope 0.3 steps of
    40 um put heights off by up to 6 um, now here, now there, which moves what is found in little noise. Along the slope
    between both neighbours, a share a of a bin away, white noise is larger by a^2 / 2 alone, and what spans many bins
    keeps its own: the values between two means would be smoother. The slope is no more than twice that on either side,
    and none where these differ in sign (van Leer, Journal of Computational Physics 23, 1977): the bottom of a scratch
    stays where it is.

    Args:
        means: (n, ...) of bins.
        occupied: (n,) their numbers, ascending.
        place: (n,) numbers of bins at whose middles these means are.
    """
    from mapping.instrument import at_middles

    rows = np.ascontiguousarray(means).reshape(len(means), -1)
    return np.asarray(at_middles(rows, occupied, place)).reshape(means.shape)


def _laid_on(base: Base, tip_radius: float) -> Means:
    """Means laid on the base, each of them."""

    def laid(centers: FloatArray, first: IntArray, stop: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        feet = base.foot(centers, tip_radius)
        return feet.points, feet.normals, feet.height

    return laid


def _filled(
    under: FloatArray | None,
    up: FloatArray | None,
    own: slice,
    have: IntArray,
    centers: FloatArray,
    base: Base,
    tip_radius: float,
) -> tuple[FloatArray | None, FloatArray | None]:
    """(n, 3) feet of the bins' centres and directions from there: those of the bins `have`, and of the empty ones."""
    if under is None or up is None:
        return None, None
    if len(have) == len(centers):
        return under[own], up[own]
    points, normals = np.empty_like(centers), np.empty_like(centers)
    points[have], normals[have] = under[own], up[own]
    empty = np.setdiff1d(np.arange(len(centers)), have)
    between = base.foot(centers[empty], tip_radius)
    points[empty], normals[empty] = between.points, between.normals
    return points, normals


def _block_means(points: FloatArray, size: int) -> FloatArray:
    whole = len(points) // size * size
    return np.asarray(np.add.reduceat(points[:whole], np.arange(0, whole, size), axis=0) / size)


def _length(points: FloatArray) -> float:
    return float(lengths(np.diff(points, axis=0)).sum())
