"""Inspection: which places of the base the sweeps passed over, and how high they found them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from mapping import FloatArray, IntArray, Trace, dots
from mapping.base import Base, LaidSweep, LaidTrace, SweepHeights
from mapping.detection import terraced
from mapping.instrument import Noise

# Sweeps that tell the typical distance between neighbours.
PROBED = 200
# Samples that a place without any, between others of its sweep, is worth.
FILLED = 0.25


@dataclass(frozen=True, eq=False)
class Inspection:
    """Mean heights at places along the sweeps.

    Args:
        points: (M, 3) places on the base, m.
        height: (M,) mean height there, m.
        sd: (M,) standard deviation of each mean, m: a slow sweep has more samples to a place than a fast one.
        sweep: (M,) number of the sweep.
        spacing: distance between neighbouring places of a sweep, m.
        normals: (M, 3) outward directions at the places; (0, 3) where they are not known.
        lowered: (M,) mean heights over the base's own level there, where it has several, m; (0,) if it has one.
        samples: (M,) samples behind each mean; (0,) where they are not known.
        jumped: (M,) standard deviation of what each mean is off where the height jumps between two samples (see
            `_jumped`), m; (0,) where it is not known.
    """

    points: FloatArray
    height: FloatArray
    sd: FloatArray
    sweep: IntArray
    spacing: float
    normals: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    lowered: FloatArray = field(default_factory=lambda: np.zeros(0))
    samples: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    jumped: FloatArray = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def over_terraces(self) -> Inspection:
        """The same places as what is fine sees them, which stands on whichever level: all but steps."""
        return replace(self, height=self.lowered) if len(self.lowered) else self

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    @cached_property
    def level(self) -> float:
        """Usual standard deviation of a place's mean, m."""
        return float(np.median(self.sd)) if len(self.sd) else 0.0

    @cached_property
    def pitch(self) -> float:
        """Typical distance from a place to the nearest other sweep, m; infinity for a single sweep."""
        numbers = sorted(self._places)
        if len(numbers) < 2:
            return float("inf")
        chosen = [numbers[k] for k in np.linspace(0, len(numbers) - 1, min(len(numbers), PROBED)).astype(int)]
        own = [self._places[number] for number in chosen]
        probes = np.concatenate([places[np.linspace(0, len(places) - 1, 7).astype(int)[1:-1]] for places in own])
        gaps = self._to_other_sweeps(probes).reshape(len(own), -1)
        return float(np.quantile(np.median(gaps, axis=1), 0.75))

    def _to_other_sweeps(self, places: IntArray) -> FloatArray:
        """Distance from each of the places (indices) to the nearest place of another sweep, m."""
        gap, left, count = np.full(len(places), np.inf), np.arange(len(places)), 32
        while len(left):
            count = min(2 * count, len(self.points))
            distance, index = self._tree.query(self.points[places[left]], count)
            other = np.where(self.sweep[index] != self.sweep[places[left], None], distance, np.inf).min(axis=1)
            gap[left] = other
            left = left[np.isinf(other)] if count < len(self.points) else left[:0]
        return gap

    @cached_property
    def _places(self) -> dict[int, IntArray]:
        order = np.argsort(self.sweep, kind="stable")
        cuts = np.flatnonzero(np.diff(self.sweep[order])) + 1
        return {int(self.sweep[own[0]]): own for own in np.split(order, cuts) if len(own)}

    def of_sweep(self, number: int) -> IntArray:
        """Indices of one sweep's places in the order in which it passed them."""
        return self._places.get(number, np.zeros(0, dtype=np.int64))

    def near(self, axis: FloatArray, reach: float) -> IntArray:
        """Indices, ascending, of all places within `reach` of a polyline (K, 3), and of a few more."""
        legs = np.linalg.norm(np.diff(axis, axis=0), axis=1)
        parts = np.maximum(np.ceil(legs / max(reach, np.finfo(float).tiny)).astype(int), 1)
        share = [k / n for n in parts for k in range(n)]
        path = np.vstack([np.repeat(axis[:-1], parts, axis=0), axis[-1:]])
        path[:-1] += np.array(share)[:, None] * np.repeat(np.diff(axis, axis=0), parts, axis=0) if share else 0.0
        found = self._tree.query_ball_point(path, 1.2 * reach)
        return np.unique(np.concatenate([np.asarray(some, dtype=np.int64) for some in found]))

    def denies(self, path: FloatArray, height: float, reach: float) -> bool:
        """True if a place within `reach` of the path (K, 3) was found clearly lower than half the height."""
        near = self._tree.query_ball_point(path, reach)
        places = list({place for some in near for place in some})
        if not places:
            return False
        return bool((np.sign(height) * self.height[places] + 3 * self.sd[places] < 0.5 * abs(height)).any())

    def nearest(self, points: FloatArray) -> IntArray:
        """(K,) index of the place nearest to each of the points (K, 3)."""
        return np.asarray(self._tree.query(points)[1], dtype=np.int64)

    def inspected(self, point: FloatArray, reach: float) -> bool:
        """True if a sweep passed within `reach` of the point."""
        return bool(self._tree.query(point)[0] <= reach)

    def of_sweeps(self, numbers: Collection[int]) -> Inspection:
        """The places of the sweeps with these numbers."""
        return self.of_places(np.flatnonzero(np.isin(self.sweep, list(numbers))))

    def of_places(self, keep: IntArray) -> Inspection:
        """The places with these indices alone."""
        normals = self.normals[keep] if len(self.normals) else self.normals
        lowered = self.lowered[keep] if len(self.lowered) else self.lowered
        samples = self.samples[keep] if len(self.samples) else self.samples
        jumped = self.jumped[keep] if len(self.jumped) else self.jumped
        columns = self.points[keep], self.height[keep], self.sd[keep], self.sweep[keep]
        return Inspection(*columns, self.spacing, normals, lowered, samples, jumped)


class Inspections:
    """The inspections that one model needs, by their spacing: those of a trace, or of some of its sweeps.

    Args:
        each: by spacing, m.
    """

    def __init__(self, each: Mapping[float, Inspection]) -> None:
        self._each = dict(each)

    @classmethod
    def of(cls, trace: Trace, base: Base, noise: Noise, spacings: Collection[float]) -> Inspections:
        """Those of all sweeps of a trace, at all spacings in one pass."""
        return cls(inspect(trace, base, noise, spacings))

    def at(self, spacing: float) -> Inspection:
        """The one of a spacing that it was made for, m."""
        return self._each[spacing]

    def of_sweeps(self, numbers: Collection[int]) -> Inspections:
        """Those of the sweeps with these numbers alone."""
        return Inspections({spacing: whole.of_sweeps(numbers) for spacing, whole in self._each.items()})


def inspect(trace: Trace, base: Base, noise: Noise, spacings: Collection[float]) -> dict[float, Inspection]:
    """Mean heights over stretches of the given lengths (m) along every sweep of the trace, which is passed once."""
    profiles: dict[float, list[SweepHeights]] = {spacing: [] for spacing in spacings}
    lowered: dict[float, list[FloatArray]] = {spacing: [] for spacing in spacings}
    passed: dict[float, list[FloatArray]] = {spacing: [] for spacing in spacings}
    for own in LaidTrace.of(trace, base).laid_sweeps:
        if len(own.trace) > 1 and own.arclength[-1] > 0:
            for spacing, found in profiles.items():
                pieces = own.heights(spacing)
                found.extend(pieces)
                passed[spacing] += [own.trace.centers[piece.first[0] : piece.first[-1]] for piece in pieces]
                if len(base.levels) > 1:
                    lowered[spacing] += _over_terraces(own, pieces, base, trace.tip_radius)
    return {
        spacing: _joined(found, lowered[spacing], passed[spacing], base, noise, trace.tip_radius, spacing)
        for spacing, found in profiles.items()
    }


def _over_terraces(sweep: LaidSweep, pieces: Sequence[SweepHeights], base: Base, tip_radius: float) -> list[FloatArray]:
    """Heights of each piece over the base's levels that the sweep runs on there, m."""
    sampled = float(sweep.arclength[-1]) / (len(sweep.trace) - 1)
    if all(piece.spacing >= sampled for piece in pieces):
        return [terraced(piece, base, tip_radius).profile.height for piece in pieces]
    # bins finer than the sampling are pieces of one bin each: the samples themselves tell the levels
    over = [terraced(whole, base, tip_radius) for whole in sweep.heights(sampled)]
    lowered = []
    for piece in pieces:
        height = piece.height
        for each in over:
            inside = (piece.s >= each.profile.s[0]) & (piece.s <= each.profile.s[-1])
            low = each.lower(piece.s, piece.height)
            between = np.interp(piece.s, each.profile.s, each.profile.height)
            height = np.where(inside, np.where(np.isnan(low), between, low), height)
        lowered.append(height)
    return lowered


def _joined(
    profiles: Sequence[SweepHeights],
    lowered: Sequence[FloatArray],
    passed: Sequence[FloatArray],
    base: Base,
    noise: Noise,
    tip_radius: float,
    spacing: float,
) -> Inspection:
    """The inspection of some profiles in bins of one width, of which the samples' centres (N, 3) each are known."""
    if not profiles:
        return Inspection(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64), spacing)
    points, normals = [], []
    for profile in profiles:
        under, up = profile.feet, profile.normals
        if under is None or up is None:
            feet = base.foot(profile.centers, tip_radius)
            under, up = feet.points, feet.normals
        points.append(under)
        normals.append(up)
    height = np.concatenate([profile.height for profile in profiles])
    samples = np.concatenate([np.diff(profile.first) for profile in profiles])
    sd = _sd_of_means(noise, spacing, samples)
    sweep = np.repeat([profile.sweep for profile in profiles], [len(profile.height) for profile in profiles])
    if noise.levels is not None:
        sd *= noise.levels.at(sweep, np.concatenate([profile.t for profile in profiles]))
    over = np.concatenate(lowered) if lowered else np.zeros(0)
    off = np.concatenate([
        _jumped(centers, np.diff(profile.first), up, noise.white)
        for centers, profile, up in zip(passed, profiles, normals, strict=True)
    ])  # fmt: skip
    return Inspection(
        np.concatenate(points), height, np.hypot(sd, off), sweep, spacing, np.concatenate(normals), over, samples, off
    )


def _jumped(centers: FloatArray, count: IntArray, up: FloatArray, white: float) -> FloatArray:
    """(n,) standard deviation of what the means of bins in a row are off by where the height jumps, m.

    A ball at a wall that is higher than its radius rises from one sample to the next, and where between them is not
    known: the mean of n samples is off by J / n times what is uniform over one step, J / (n sqrt(12)). A jump is what a
    step rises by more than both steps beside it, which a slope or a bend do not. One that moves a mean by less than the
    noise does is left to that, and a single sample is no mean.

    Args:
        centers: (N, 3) centres of the samples, m.
        count: (n,) samples in each bin, N in all.
        up: (n, 3) directions off the base.
        white: standard deviation of the white noise of a sample, m.
    """
    jumped, bins = np.zeros(len(count)), np.repeat(np.arange(len(count)), count)
    if len(centers) < 4 or count.max() < 2:
        return jumped
    rise = dots(np.diff(centers, axis=0), up[bins[:-1]])
    behind, ahead = rise[1:-1] - rise[:-2], rise[1:-1] - rise[2:]
    jump = np.where(behind * ahead > 0.0, np.minimum(np.abs(behind), np.abs(ahead)), 0.0)
    for own in (bins[1:-2], bins[2:-1]):  # those of the samples before it and behind it
        moves = np.flatnonzero((count[own] > 1) & (jump**2 > 12.0 * count[own] * white**2))
        np.maximum.at(jumped, own[moves], jump[moves] / (np.sqrt(12.0) * count[own[moves]]))
    return jumped


def _sd_of_means(noise: Noise, spacing: float, count: IntArray) -> FloatArray:
    """(M,) standard deviations of means over so many samples each, m; what is only filled in says little."""
    counts, index = np.unique(count, return_inverse=True)
    worth = np.where(counts > 0, counts, FILLED)
    return np.sqrt([noise.block_covariances(1, spacing, float(samples))[0] for samples in worth])[index]
