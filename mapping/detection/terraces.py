"""Terraces under a profile: heights over the level that a sweep runs on, and the edges between two levels.

A base that stands on several levels (mapping.base) is one of them; over the others every sweep stands off it for a
long way. What is fine on a terrace is sought over its own level, and an edge in a piece of its own, as on any plate.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from mapping import BoolArray, FloatArray, IntArray
from mapping.base import Base, SweepHeights
from mapping.detection.cap_fit import Disturbance, fit_cap
from mapping.instrument import CONTACT_ROUNDING, FEATURE_RESIDUAL_SDS, Noise, neighbour_scatter, running_mean

# A sweep runs on a level if it keeps to it for so many tip radii, the half-width of the widest detail that is sought:
# what is narrower is one on the level below. On either side of an edge as much is looked at, of which the arc about it
# is a quarter at most.
TERRACE = 4.0
# So many times as much is fitted at most, so that a bin of a cap's fit (CAP_FIT_BINS) is no wider than a radius,
# which the arc about a wall is. 8 does the same for 20 steps of `explore3d bench profiles`; with 30 one more has a
# wrong height
EDGE_TERRACES = 15
# Of the difference between two levels: what is nearer than that to one of them is not on its way to the other: half-
# way to their middle. Of 50 steps of 0.5 to 10 um on a rough profile 0.1 loses three, 0.2 to 0.45 none
CLIMB = 0.25
# Half of the stretch (tip radii) over which means tell the level: single bins of noise tell none, and the arc about an
# edge of a hundredth of the radius, sqrt(2 / 100) wide, is as wide as the stretch
MEAN = 0.1
# Bins of a terrace, at least: a scatter from second differences takes four values
TERRACE_BINS = 4


@dataclass(frozen=True, eq=False)
class Edge:
    """The two terraces about an edge: heights over the lower one, and the bins (first, past-last) that stand off it.

    Of a slanted edge the base tells where the climb begins and ends: `climb` are its bins (first, past-last).
    """

    piece: SweepHeights
    high: tuple[int, int]
    climb: tuple[int, int] | None = None

    def step(self, noise: Noise, tip_radius: float) -> Disturbance:
        """The higher terrace as a plateau, which goes on beyond the piece on its other side."""
        if self.climb is None:
            return fit_cap(self.piece.height, self.high, 1.0, self.piece, noise, 0, tip_radius)
        piece, (begin, end), count = self.piece, self.climb, len(self.piece.height)
        means = [float(piece.height[own].mean()) for own in (slice(0, begin), slice(end, count))]
        bins = np.array([begin, count - end])
        sds = [float(noise.block_covariances(1, n * piece.spacing, n * piece.samples)[0]) ** 0.5 for n in bins]
        height, sd, run = abs(means[1] - means[0]), float(np.hypot(*sds)), (end - begin) * piece.spacing
        # the plateau reaches as far beyond the piece as it does within
        up = means[1] > means[0]
        flat = piece.spacing * float(bins[1 if up else 0])
        return Disturbance(
            place=piece.start + piece.spacing * (count if up else 0),
            start=piece.start + piece.spacing * (begin if up else 0),
            stop=piece.start + piece.spacing * (count if up else end),
            height=height,
            height_sd=sd,
            place_sd=max(sd * run / height, piece.spacing) if height > 0.0 else run,
            half_width=flat + run,
            flat=flat,
            curvature=0.0,
            snr=height / max(sd, np.finfo(float).tiny),
        )


@dataclass(frozen=True, eq=False)
class Terraced:
    """A profile over its own terraces.

    Args:
        profile: heights over the level that the sweep runs on; where it goes from one to the other, those
            of the terrace behind, mirrored.
        edges: of each such place.
        level: (n,) of each bin, m, NaN on the way from one to another; None of a profile that is as it was.
    """

    profile: SweepHeights
    edges: tuple[Edge, ...] = ()
    level: FloatArray | None = None

    def lower(self, s: FloatArray, height: FloatArray) -> FloatArray:
        """Heights (N,) at arclengths s (N,) of the same sweep over the level there, NaN on the way between two, m."""
        if self.level is None:
            return height
        index = np.floor((s - self.profile.start) / self.profile.spacing + 0.5).astype(np.int64)
        inside = (index >= 0) & (index < len(self.level))
        return np.asarray(height - np.where(inside, self.level[np.clip(index, 0, len(self.level) - 1)], 0.0))


def terraced(profile: SweepHeights, base: Base, tip_radius: float) -> Terraced:
    """The profile over its terraces; as it is if the base has one level, or the sweep runs on none for long."""
    levels = base.levels
    if len(levels) < 2:
        return Terraced(profile)
    reach = int(TERRACE * tip_radius / profile.spacing)
    if reach < TERRACE_BINS:
        return Terraced(profile)
    # single bins of noise change no level: means over a stretch that an edge's arc is still wider than
    smooth = running_mean(profile.height, int(MEAN * tip_radius / profile.spacing))
    own = np.abs(smooth[:, None] - levels)
    # bins finer than the sampling are filled in: these scatter by nothing
    noise = max(neighbour_scatter(profile.height[np.diff(profile.first) > 0]), CONTACT_ROUNDING * tip_radius)
    on = FEATURE_RESIDUAL_SDS * noise
    # what is as near to a level on an arc of the ball, whose top it may be, and as far again as means reach
    passed = int((2.0 * np.sqrt(tip_radius * on) + 2.0 * MEAN * tip_radius) / profile.spacing)
    runs = _runs(own.argmin(axis=1), own.min(axis=1) < on, reach, max(passed, TERRACE_BINS))
    climbs = [_climb(profile, *climb) for climb in base.climbs]
    way_up = reach + max((end - begin for begin, end in climbs), default=0)
    runs = _up_to_edges(runs, way_up, smooth, levels)
    bounds = [np.sort(levels[[here, there]]) for (_, _, here), (_, _, there) in itertools.pairwise(runs)]
    upon = [
        _beyond(smooth, begin, last, between, on)
        for ((begin, _, _), (_, last, _)), between in zip(itertools.pairwise(runs), bounds, strict=True)
    ]
    # a longer way from one level to the next than the base has is no edge, and its levels are none of this sweep's
    bare = [
        onward - end - np.count_nonzero(stands[end:onward])
        for ((_, end, _), (onward, _, _)), stands in zip(itertools.pairwise(runs), upon, strict=True)
    ]
    if not runs or max(bare, default=0) > way_up:
        return Terraced(profile)
    # an arc is higher than the noise only so far from its end, and the means come a little nearer
    rounded = int((MEAN * tip_radius + np.sqrt(2 * tip_radius * on)) / profile.spacing) + 1
    height, edges = profile.height - levels[runs[0][2]], []
    level = np.full(len(height), levels[runs[-1][2]])
    for ((begin, end, here), (onward, last, there)), between, stands in zip(
        itertools.pairwise(runs), bounds, upon, strict=True
    ):
        height[onward:] += levels[here] - levels[there]
        # the way from one to the other is no path over a base: the terrace behind it stands in, with its noise; a part
        # of every terrace is left, however short it is, coarse the bins and strong the noise
        behind = onward + min(rounded, (last - onward) // 2)
        way = np.arange(end - min(rounded, (end - begin) // 2), behind)
        level[0 if begin == runs[0][0] else begin : end] = levels[here]
        level[way] = np.nan
        terrace = height[behind:last]
        calm = terrace[~stands[behind:last]]
        height[way] = np.pad(calm if len(calm) else terrace, (len(way), 0), mode="symmetric")[: len(way)]
        # details of the two terraces are none of the edge's, nor is what stands upon it: that is one of the nearer
        # level
        plain = profile.height.copy()
        plain[stands] = np.clip(plain[stands], *between)
        upon_edge = way[stands[way]]
        level[upon_edge] = plain[upon_edge]
        height[upon_edge] = profile.height[upon_edge] - plain[upon_edge]
        farther = slice(begin, max(begin, end - reach)), slice(min(onward + reach, last), last)
        for ground, detail in zip((here, there), farther, strict=True):
            stands_off = np.abs(plain[detail] - levels[ground]) >= FEATURE_RESIDUAL_SDS * noise
            plain[detail][stands_off] = levels[ground]
        start, stop = max(begin, end - EDGE_TERRACES * reach), min(last, onward + EDGE_TERRACES * reach)
        piece = _piece(replace(profile, height=plain - min(levels[here], levels[there])), start, stop)
        up = levels[there] > levels[here]
        climb = next(
            ((a - start, b - start) for a, b in climbs if start < a < b < stop and a < onward and end < b), None
        )
        edges.append(Edge(piece, (end - start, stop - start) if up else (0, onward - start), climb))
    return Terraced(replace(profile, height=height), tuple(edges), level)


def _climb(profile: SweepHeights, place: FloatArray, run: float) -> tuple[int, int]:
    """Bins (first, past-last) of a profile between which the base says that a slanted edge climbs."""
    middle = int(np.linalg.norm(profile.centers - place, axis=1).argmin())
    half = 0.5 * run / profile.spacing
    return int(np.floor(middle - half)), int(np.ceil(middle + half)) + 1


def _beyond(height: FloatArray, begin: int, end: int, bounds: FloatArray, noise: float) -> BoolArray:
    """Which of the heights (n,) from one bin to another are of what stands above both levels, or lies below both.

    No ball that rolls over an edge is higher than its upper level, or lower than its lower one. What is so by more than
    the noise (m) goes on to either side as far as the heights are beyond the levels at all.
    """
    off = height[begin:end] - np.clip(height[begin:end], *bounds)
    sides = np.concatenate([[0], np.cumsum(np.diff(np.sign(off)) != 0)])
    found = np.zeros(len(height), dtype=bool)
    found[begin:end] = np.isin(sides, sides[np.abs(off) > noise])
    return found


def _runs(level: IntArray, on: BoolArray, shortest: float, passed: int) -> list[tuple[int, int, int]]:
    """(first bin, past-last bin, level) of the stretches on one level; details interrupt none of them.

    What is no longer than `shortest` is a detail of the level on both its sides, unless these are two: then it is a
    stair, if it is longer than what is `passed` on the way from one to the other. So is what a sweep begins or ends on,
    of which there is no other side. Where nothing is longer, as on the teeth of a saw, all are stairs, or none is.
    """
    at = np.flatnonzero(on)
    if not len(at):
        return []
    cuts = np.flatnonzero(np.diff(level[at]) != 0) + 1
    bounds = zip([0, *cuts], [*cuts, len(at)], strict=True)
    pieces = [(int(at[b]), int(at[e - 1]) + 1, int(level[at[b]])) for b, e in bounds]
    runs: list[tuple[int, int, int]] = []
    for begin, end, own in (piece for piece in pieces if piece[1] - piece[0] > shortest):
        if runs and runs[-1][2] == own:
            runs[-1] = (runs[-1][0], end, own)
        else:
            runs.append((begin, end, own))
    if not runs:
        steady = [piece for piece in pieces if piece[1] - piece[0] > passed]
        return steady if all(one[2] != other[2] for one, other in zip(steady, steady[2:], strict=False)) else []
    stairs = [
        piece
        for (_, end, here), (onward, _, there) in itertools.pairwise(runs)
        for piece in pieces
        if end <= piece[0] and piece[1] <= onward and piece[1] - piece[0] > passed and piece[2] not in (here, there)
    ]
    # where it went on to another level soon after it began, or soon before it ended
    begun = [pieces[0]] if runs and pieces[0][1] <= runs[0][0] and pieces[0][2] != runs[0][2] else []
    ended = [pieces[-1]] if runs and runs[-1][1] <= pieces[-1][0] and pieces[-1][2] != runs[-1][2] else []
    stairs += [piece for piece in (*begun, *ended) if piece[1] - piece[0] > passed]
    return sorted([*runs, *stairs])


def _up_to_edges(
    runs: list[tuple[int, int, int]], reach: int, height: FloatArray, levels: FloatArray
) -> list[tuple[int, int, int]]:
    """The runs, where they end far from each other as far as no climb leads off: roughness leaves levels, too."""
    longer = list(runs)
    for k, ((_, end, here), (onward, last, there)) in enumerate(itertools.pairwise(runs)):
        if onward - end <= reach:
            continue
        near = CLIMB * abs(levels[there] - levels[here])
        left = np.abs(height[end:onward] - levels[here]) >= near
        back = np.abs(height[end:onward] - levels[there])[::-1] >= near
        end += int(left.argmax()) if left.any() else len(left)
        onward = max(onward - (int(back.argmax()) if back.any() else len(back)), end)
        longer[k], longer[k + 1] = (longer[k][0], end, here), (onward, last, there)
    return longer


def _piece(profile: SweepHeights, low: int, high: int) -> SweepHeights:
    own = slice(low, high)

    def cut(rows: FloatArray | None) -> FloatArray | None:
        return None if rows is None else rows[own]

    return replace(
        profile,
        start=profile.start + low * profile.spacing,
        height=profile.height[own],
        first=profile.first[low : high + 1],
        t=profile.t[own],
        centers=profile.centers[own],
        feet=cut(profile.feet),
        normals=cut(profile.normals),
    )
