"""Normals of the traced surface at the points of its sweeps, from positions alone.

Along a sweep its own tangent tells; across the sweeps the slope comes from the neighbouring rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Trace, lengths
from mapping.estimate.sweeps.contact_row import ContactRow, contact_row
from mapping.estimate.sweeps.curve import SweepCurve
from mapping.estimate.sweeps.labels import TOUCHED
from mapping.estimate.sweeps.rows import parallel_rows, pitch, thinned
from mapping.estimate.sweeps.tangents import lagrange, unit
from mapping.geometry.curvature import TOLD_SIDE

# Samples in a neighbourhood: four for each of the six terms of the quadratic that is fitted to it
FITTED_NEIGHBOURS = 24
# Samples whose neighbourhoods are fitted together: their arms are 4096 * 24 vectors, 2.4 MB
SAMPLES_AT_ONCE = 4096
# Sweeps whose curves are held: those that a slope is taken across are nine, and more where passes over one line lie
# between them
CURVES_HELD = 32
# Distance along a sweep between the samples that are fitted, in distances between sweeps. A fit reaches over two and a
# half of these, and errs as the square of that: between two samples an eighth apart a straight line adds 1/400 of it
FITTED_APART = 1.0 / 8.0


class SurfaceNormals:
    """Contacts of the traced surface's sweeps with normals, one part after another.

    A single sweep knows its slope along itself only: its normals stay in the plane of tangent and outward
    direction, as of a profile. Parallel sweeps add the slope across; other arrangements take it from local fits.

    What is worked out for one part is let go of before the next but for its neighbours' curves: for all samples at
    once it would take five times the trace's own memory.

    Args:
        trace: each run of consecutive samples with one number is taken by itself, `parts` of it.
        outward: (N, 3) directions away from the body at its samples.
        slack: what noise moves a centre by at most, m. Sweeps whose balls would stand out between them by less than
            an eighth of it are passes over one line: they tell no slope across.
        open_kinks: False to take interference points for samples like others.
    """

    def __init__(self, trace: Trace, outward: FloatArray, slack: float = 0.0, open_kinks: bool = True) -> None:
        self.trace, self.outward = trace, outward
        self._least = float(np.sqrt(trace.tip_radius * slack))
        self.parts = [part for _, part in trace.sweeps()]
        self.starts = np.cumsum([0, *map(len, self.parts)])
        self._outwards = np.split(outward, self.starts[1:-1])
        numbers = [int(part.sweep[0]) for part in self.parts]
        self._lone = len({*numbers}) < 2
        rows = None if self._lone else parallel_rows(trace.centers, trace.sweep)
        places = {} if rows is None else {int(trace.sweep[row[0]]): j for j, row in enumerate(rows)}
        # the row that each sweep is a part of, from side to side, and the sweeps of each row
        self._row_of_part = [places.get(number, -1) for number in numbers]
        self._parts_of_row: list[list[int]] = [[] for _ in places]
        for k, row in enumerate(self._row_of_part):
            if row >= 0:
                self._parts_of_row[row].append(k)
        self._row, self._curve = _held_rows(self.parts, self._outwards, self._parts_of_row, open_kinks)

    def of(self, number: int) -> tuple[ContactRow, FloatArray, FloatArray, FloatArray]:
        """Contacts of one of the parts, whose sample numbers are its own, outward unit normals (M, 3), curvature across
        (M,), 1/m, and doubt of the slope (M,), rad."""
        row, trace, outward = self._row(number), self.parts[number], self._outwards[number]
        if self._lone:
            return row, row.normals, np.full(len(row.normals), np.nan), np.zeros(len(row.normals))
        along = np.zeros_like(trace.centers)
        felt = row.sample >= 0
        along[row.sample[felt]] = row.tangents[felt]
        if self._parts_of_row:
            before, after = self._beside(self._row_of_part[number])
            slope = cross_slope(trace.centers, along, outward, before, after, self._least)
        else:
            slope = CrossSlope(along.copy(), *np.full((2, len(trace)), np.nan))
        lost = np.flatnonzero(np.isnan(slope.doubt))
        if len(lost):
            slope.tangents[lost], slope.doubt[lost] = self._near.fitted(trace.centers[lost], along[lost], outward[lost])
        across = slope.tangents[row.nearest]
        ends, continued = at_kinks(trace, row, slope.tangents)
        across[ends] = continued
        turned = unit(np.cross(row.tangents, across))
        side = np.sign(np.einsum("ij,ij->i", turned, outward[row.nearest]))
        normals = np.where((side == 0)[:, None], row.normals, turned * side[:, None])
        return row, normals, slope.curvature[row.nearest], slope.doubt[row.nearest]

    def _beside(self, row: int) -> tuple[Iterator[SweepCurve], Iterator[SweepCurve]]:
        """The curves of the rows on either side, the nearest first."""
        return map(self._curve, range(row - 1, -1, -1)), map(self._curve, range(row + 1, len(self._parts_of_row)))

    @cached_property
    def _near(self) -> _Neighbourhood:
        return _Neighbourhood(self.trace, self.outward)


def _held_rows(
    parts: list[Trace], outwards: list[FloatArray], parts_of_row: list[list[int]], open_kinks: bool
) -> tuple[Callable[[int], ContactRow], Callable[[int], SweepCurve]]:
    """What gives the contacts of a part, and the curve of a row; the latest are held, the others laid out again."""

    @lru_cache(CURVES_HELD)
    def contacts(number: int) -> ContactRow:
        part = parts[number]
        return contact_row(part.centers, outwards[number], part.tip_radius, open_kinks)

    @lru_cache(CURVES_HELD)
    def curve(row: int) -> SweepCurve:
        return SweepCurve.of(ContactRow.joined([contacts(number) for number in parts_of_row[row]]))

    return contacts, curve


def at_kinks(trace: Trace, row: ContactRow, directions: FloatArray) -> tuple[IntArray, FloatArray]:
    """Unit directions (N, 3) of the samples continued to both sides of each interference point, from its own side.

    Returns:
        (K,) indices of the contacts at interference points, and (K, 3) directions there.
    """
    ends = np.flatnonzero((row.sample < 0) & (row.labels == TOUCHED))
    way = np.where(row.sample[ends - 1] >= 0, -1, 1)  # the first contact of a fan follows a sample
    samples = row.nearest[ends][:, None] + way[:, None] * np.arange(4)
    held = (samples >= 0) & (samples < len(trace))
    samples = np.asarray(np.clip(samples, 0, len(trace) - 1), dtype=np.int64)
    held &= trace.sweep[samples] == trace.sweep[samples[:, :1]]
    points = trace.centers[samples]
    s = np.cumsum(np.linalg.norm(np.diff(points, axis=1, prepend=points[:, :1]), axis=2), axis=1)
    before = -np.linalg.norm(row.centers[ends] - points[:, 0], axis=1)
    # A kink beside the kink leaves too few samples: then the nearest must do.
    straight = held.all(axis=1) & (np.abs(before) < 2 * s[:, 1]) & (np.diff(s, axis=1) > 0).all(axis=1)
    safe = np.where(straight[:, None], s, np.arange(4.0))
    weights = np.where(straight[:, None], lagrange(safe, before)[0], np.eye(4)[0])
    return np.asarray(ends, dtype=np.int64), unit(np.einsum("km,kmc->kc", weights, directions[samples]))


class _Neighbourhood:
    """The samples of a thinned trace that lie near others, on whatever sweep."""

    def __init__(self, trace: Trace, outward: FloatArray) -> None:
        from scipy.spatial import cKDTree

        self._apart = pitch(trace.centers, trace.sweep)
        kept = thinned(trace.centers, trace.sweep, self._apart)
        self._cloud, self._sides = trace.centers[kept], outward[kept]
        self._tree = cKDTree(self._cloud)

    def fitted(self, centers: FloatArray, along: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Tangents across a sweep (N, 3) at some of its samples, and their doubt, from quadratic fits to the nearest.

        The doubt is three times the residual over the width; it is a right angle where the neighbours lie on one line.
        Around a sharp edge, or behind a thin wall, the nearest samples are those of another side: they do not count.
        Samples that lie far closer together than the sweeps have slopes between those of some that are fitted.
        """
        count = min(FITTED_NEIGHBOURS, len(self._cloud))
        fitted = thinned(centers, np.zeros(len(centers), dtype=np.int64), FITTED_APART * self._apart)
        frames = _frames(along, outward)
        slopes, doubt = np.empty(len(fitted)), np.empty(len(fitted))
        for start in range(0, len(fitted), SAMPLES_AT_ONCE):
            part = slice(start, start + SAMPLES_AT_ONCE)
            own = fitted[part]
            distance, index = (np.asarray(found) for found in self._tree.query(centers[own], [*range(1, count + 1)]))
            arm = self._cloud[index] - centers[own, None]
            counts = np.einsum("nc,nkc->nk", outward[own], self._sides[index]) > TOLD_SIDE
            slopes[part], doubt[part] = _slopes(arm, distance, counts, *(axis[own] for axis in frames))
        _, across, up = frames
        s = np.cumsum(lengths(np.diff(centers, axis=0, prepend=centers[:1])))
        slope = np.interp(s, s[fitted], slopes)
        return unit(across + slope[:, None] * up), np.interp(s, s[fitted], doubt)


def _frames(along: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit directions (N, 3) along the sweeps, across them, and up."""
    across = unit(np.cross(outward, along))
    up = unit(np.cross(along, across))
    up *= np.where(np.einsum("ij,ij->i", up, outward) < 0, -1.0, 1.0)[:, None]
    return along, across, up


def _slopes(
    arm: FloatArray, distance: FloatArray, counts: BoolArray, along: FloatArray, across: FloatArray, up: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Slopes across and their doubt, rad, from the ways (N, K, 3) to the neighbours of each sample, their lengths
    (N, K), and which of them count (N, K), in frames of three (N, 3)."""
    from mapping.estimate.sweeps.tangent_kernels import slopes_across

    scale = np.maximum(distance[:, -1:], 1e-300)
    arm = arm / scale[..., None]
    u, v, w = (np.einsum("nkc,nc->nk", arm, axis) for axis in (along, across, up))
    weight = np.exp(-2.0 * (distance / scale) ** 2) * counts
    slope, residual, determined = slopes_across(u, v, w, weight)
    rest = np.flatnonzero(~determined)
    if len(rest):
        slope[rest], residual[rest] = _least_slopes(u[rest], v[rest], w[rest], weight[rest, :, None])
    width = np.sqrt((weight * v**2).mean(axis=1))
    doubt = np.where(width > 1e-3, 3 * residual / np.maximum(width, 1e-3), np.pi / 2)
    return slope, doubt


def _least_slopes(u: FloatArray, v: FloatArray, w: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """As `slopes_across` where the neighbours do not determine all terms: the smallest coefficients that fit."""
    columns = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    fit = np.linalg.pinv(columns * weight, rcond=1e-9) @ (w[..., None] * weight)
    residual = np.sqrt((weight * (w[..., None] - columns @ fit) ** 2).mean(axis=(1, 2)))
    return fit[:, 2, 0], residual


# Rows to either side that are looked at.
ROWS_EITHER_SIDE = 4
# A one-sided polynomial must be smoother than the others by this factor.
ONE_SIDED_PENALTY = 1.25
# A higher term must be smaller than the curvature by this factor, or it speaks of a kink.
HIGHER_TERM_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class CrossSlope:
    """The traced surface across its sweeps.

    Args:
        tangents: (N, 3) unit tangents across the sweeps; meaningless where `doubt` is NaN.
        curvature: (N,) curvature across, 1/m, positive where it bulges out; NaN where unknown.
        doubt: (N,) how far the slope may be off, rad; NaN where the neighbours do not tell.
    """

    tangents: FloatArray
    curvature: FloatArray
    doubt: FloatArray


def cross_slope(
    points: FloatArray,
    along: FloatArray,
    outward: FloatArray,
    before: Iterable[SweepCurve],
    after: Iterable[SweepCurve],
    least: float = 0.0,
) -> CrossSlope:
    """Slope across a sweep among parallel ones at its samples (N, 3) with unit tangents `along` (N, 3).

    The surface is cut at each sample by the plane perpendicular to the sweep, which the neighbouring rows cross
    in a few points; their interpolant gives the slope, its last term the doubt.

    Args:
        before, after: the rows to its sides, the nearest first; no more are asked for than are needed.
        least: rows usually nearer than that, m, to the row itself or to one that was taken already are passed over.
    """
    across = unit(np.cross(outward, along))
    up = np.cross(along, across)
    up *= np.sign(np.einsum("ij,ij->i", up, outward))[:, None]
    v, w = np.full((2, len(points), 2 * ROWS_EITHER_SIDE + 1), np.nan)
    v[:, ROWS_EITHER_SIDE] = w[:, ROWS_EITHER_SIDE] = 0.0
    for side, others in ((-1, before), (1, after)):
        taken, beside = 0, np.zeros(len(points))
        for other in others:
            arm = other.crossings(points, along) - points
            away = np.einsum("ij,ij->i", arm, across)
            if _usual(np.abs(away - beside)) < least:
                continue
            taken, beside = taken + 1, away
            v[:, ROWS_EITHER_SIDE + side * taken] = away
            w[:, ROWS_EITHER_SIDE + side * taken] = np.einsum("ij,ij->i", arm, up)
            if taken == ROWS_EITHER_SIDE:
                break
    slope, bend, told = smooth_slope(v, w)
    # Beside an outermost sweep nothing shows whether the surface goes on as it came.
    alone = np.isnan(v[:, ROWS_EITHER_SIDE - 1]) | np.isnan(v[:, ROWS_EITHER_SIDE + 1])
    doubt = shared(np.where(alone & ~np.isnan(told), np.pi / 2, told))
    return CrossSlope(unit(across + slope[:, None] * up), -bend / (1 + slope**2) ** 1.5, doubt)


def _usual(distances: FloatArray) -> float:
    """Their median, infinite where none is known."""
    known = distances[np.isfinite(distances)]
    return float(np.median(known)) if len(known) else np.inf


def shared(doubt: FloatArray, reach: int = 2) -> FloatArray:
    """Largest doubt (N,) of a few neighbours along a sweep: among the doubtful, one may agree with itself by chance."""
    padded = np.pad(doubt, reach, constant_values=np.nan)
    largest = np.fmax.reduce(np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1), axis=1)
    return np.asarray(np.where(np.isnan(doubt), doubt, largest))


def smooth_slope(v: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Slope, second derivative and doubt of the slope at the middle column of w(v), (N, 2 k + 1), NaN where missing.

    Essentially non-oscillatory (ENO III, Harten et al. 1987): of all quartics, cubics and parabolas through the
    middle and its neighbours, the one of highest degree whose last term is small beside its curvature. A kink that
    runs along the sweeps therefore stays outside, even where it mimics a curvature in three rows.
    """
    from mapping.estimate.sweeps.tangent_kernels import smooth_slopes

    slope, bend, doubt = np.empty((3, len(v)))
    smooth_slopes(v, w, ONE_SIDED_PENALTY, HIGHER_TERM_SHARE, slope, bend, doubt)
    return slope, bend, doubt
