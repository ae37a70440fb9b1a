"""Line features: ridges and grooves, with their ends and junctions, from the crossings of one group."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mapping import Feature, FloatArray, Interval
from mapping.assembly.linking import (
    FELT_REACH,
    LONGEST_LINK,
    ONE_PLACE,
    Branch,
    Inspection,
    between,
    branches,
    closes,
    ended_length,
    joined,
    line_end,
    rejoined,
    rested_on,
    strokes,
)
from mapping.assembly.points import body_width, evidence
from mapping.assembly.runs import RunPoint
from mapping.base import Base
from mapping.detection import Crossing, Detections
from mapping.geometry.mesh import arclengths, distances
from mapping.geometry.templates import crest_trace, robust_cost

# A crossing lower than this share of a neighbour, or of one within a half-width, passed beside an end;
# so did the last crossing of a line if it is lower than this share of the one before.
FULL_HEIGHT, CLOSE_HEIGHT = 0.85, 0.93
END_HEIGHT = 0.95
# Crossings nearer to each other than this share of the half-width are one point of the axis.
ONE_POINT = 0.5
# A disturbance wider than so many of the narrow ones was crossed at a slant.
SLANTED_WIDTH_RATIO = 2.0
# A link over a place that felt no crest is as good as one so many times as long.
DENIED = 3.0

# Whether an axis (K, 3) of a height and a half-width (m) returns to its beginning
Closes = Callable[[FloatArray, float, float], bool]


@dataclass(frozen=True, eq=False)
class Around:
    """What a group of crossings is judged by: heights everywhere, the base, all detections, the tip's radius (m)."""

    inspection: Inspection
    base: Base
    detections: Detections
    tip_radius: float


def line_features(members: list[Crossing], kind: str, around: Around) -> list[Feature]:
    """The smooth lines through a group's crossings; none if the crossings are all in one place."""
    top = float(np.quantile([abs(c.height) for c in members], 0.8))
    half_width = float(np.sqrt(2 * around.tip_radius * top))
    full = _squarely_first(_full_height(members, half_width, around.inspection), half_width, around.inspection)
    clusters = merged(full, ONE_POINT * half_width)
    if len(clusters) < 2:
        return []
    points = np.array([mean_point(cluster) for cluster in clusters])
    links = _links(points, members[0].height, half_width, around)
    lines = branches(points, half_width, links)
    lines = rejoined(lines, half_width, partial(_denied, members[0].height, half_width, around))
    return _features_along(lines, [], members, kind, around, partial(closes, inspection=around.inspection))


def rested_lines(members: list[Crossing], kind: str, around: Around) -> list[tuple[list[Feature], list[Feature]]]:
    """The smooth lines through all places about a group's crossings that a ball may have rested on, and the straight
    strokes that each may be instead, none of most.

    What tells a place from one beside it is finer than a disturbance, by which lines are told where single sweeps
    alone say where they are.
    """
    top = float(np.quantile([abs(c.height) for c in members], 0.8))
    half_width = float(np.sqrt(2 * around.tip_radius * top))
    apart = ONE_PLACE * half_width
    places = around.inspection.near(np.array([c.point for c in members]), half_width)
    points = rested_on(places, around.inspection, around.tip_radius, half_width)
    if len(points) < 2:
        return []
    lines = _uncut(branches(points, apart), 3.0 * apart)
    told = []
    for line in lines:
        beside = [other for other in lines if other is not line]
        bent, straight = (
            _features_along(own, beside, members, kind, around, _known_to_return, apart)
            for own in ([line], strokes(line, 0.5 * apart, half_width))
        )
        told.append((bent, straight))
    return told


def _known_to_return(axis: FloatArray, height: float, half_width: float) -> bool:
    """False: what is closed is known to be beforehand."""
    return False


def _uncut(lines: list[Branch], gap: float) -> list[Branch]:
    """The lines without the cuts of a tree, which has no rings: free ends that are no farther apart than places of one
    course that have none between them, m: two, and half of one more to either side, as places are means."""
    lines = list(lines)
    while True:
        ends = [(k, e) for k, line in enumerate(lines) if not line.closed for e in (0, 1) if line.free[e]]
        pairs = [
            (float(np.linalg.norm(lines[a].axis[-e] - lines[b].axis[-f])), (a, e), (b, f))
            for (a, e), (b, f) in itertools.combinations(ends, 2)
            if a != b or len(lines[a].axis) > 3
        ]
        apart, one, other = min(pairs, default=(np.inf, (0, 0), (0, 0)))
        if apart > gap:
            return lines
        whole = replace(lines[one[0]], closed=True) if one[0] == other[0] else joined(lines, one, other)
        lines = [*(line for k, line in enumerate(lines) if k not in (one[0], other[0])), whole]


def _features_along(
    lines: list[Branch],
    beside: list[Branch],
    members: list[Crossing],
    kind: str,
    around: Around,
    closes: Closes,
    longest: float = np.inf,
) -> list[Feature]:
    """A feature of each line, of the crossings that lie nearest to it, or of the nearest.

    Args:
        lines: of one point they are none.
        beside: others, which crossings may be of.
        members: all crossings.
        kind: of the features.
        around: what they are judged by.
        closes: whether one both of whose ends are free is closed.
        longest: distance beyond its last point up to which a line may go on, m.
    """
    # a lone point that is left between two meeting places is no line
    lines = [branch for branch in lines if len(branch.axis) > 1]
    features = []
    for branch in lines:
        others = [other.axis for other in (*lines, *beside) if other is not branch]
        own = [c for c in members if _nearest(c.point, branch.axis, others)]
        own = own or [min(members, key=lambda c: float(distances(c.point[None], branch.axis)[0]))]
        features.append(_line_feature(branch, own, kind, around, closes, longest))
    return features


def _denied(sign: float, half_width: float, around: Around, start: FloatArray, stop: FloatArray) -> bool:
    """True if a place between two points of crests was found too low."""
    low = np.sign(sign) * half_width**2 / (2 * around.tip_radius)
    return around.inspection.denies(between(start, stop, half_width), low, FELT_REACH * half_width)


def _links(points: FloatArray, sign: float, half_width: float, around: Around) -> FloatArray:
    """(K, K) distances between points of the crests, longer where a place between them was found too low."""
    length = np.linalg.norm(points[:, None] - points[None], axis=2)
    for i, j in zip(*np.nonzero(np.triu(length < LONGEST_LINK * half_width, 1)), strict=True):
        if _denied(sign, half_width, around, points[i], points[j]):
            length[i, j] = length[j, i] = DENIED * length[i, j]
    return np.asarray(length)


def _nearest(point: FloatArray, axis: FloatArray, others: list[FloatArray]) -> bool:
    distance = distances(point[None], axis)[0]
    return all(distance <= distances(point[None], other)[0] for other in others)


def _full_height(members: list[Crossing], half_width: float, inspection: Inspection) -> list[Crossing]:
    """Crossings less those that only met the flank of what a neighbour met at its crest."""
    points = np.array([c.point for c in members])
    heights, own = (np.array([abs(getattr(c, name)) for c in members]) for name in ("height", "half_width"))
    sweeps = np.array([c.sweep for c in members])
    wide = 1.5 * max(half_width, min(inspection.pitch, 2 * half_width))
    full = []
    for c in members:
        gap = np.linalg.norm(points - c.point, axis=1)
        # at a slant a sweep meets flanks as far off as it was disturbed
        beside = (gap < wide) | ((sweeps == c.sweep) & (gap < own + c.half_width))
        needed = max(FULL_HEIGHT * heights[beside].max(), CLOSE_HEIGHT * heights[gap < half_width].max())
        if abs(c.height) + 2 * c.height_sd >= needed:
            full.append(c)
    return full


def _squarely_first(full: list[Crossing], half_width: float, inspection: Inspection) -> list[Crossing]:
    """Crossings less those along the line that have a square crossing near: they know its place only within a width.

    A sweep that ran along a line, or crossed it at a slant, was disturbed over a longer stretch.
    """
    narrow = np.quantile([c.half_width for c in full], 0.25)
    square = [c for c in full if not isinstance(c, RunPoint) and c.half_width < SLANTED_WIDTH_RATIO * narrow]
    if not square:
        return full
    places = np.array([c.point for c in square])
    reach = 1.5 * max(min(inspection.pitch, 2 * half_width), half_width)
    rest = [c for c in full if not any(c is s for s in square)]
    return square + [c for c in rest if np.linalg.norm(places - c.point, axis=1).min() > reach + c.half_width]


def merged(crossings: list[Crossing], distance: float) -> list[list[Crossing]]:
    """Clusters of crossings nearer to each other than the distance, the strongest first in each."""
    clusters: list[list[Crossing]] = []
    for crossing in sorted(crossings, key=lambda c: -c.snr):
        home = next((k for k in clusters if np.linalg.norm(k[0].point - crossing.point) < distance), None)
        if home is None:
            clusters.append([crossing])
        else:
            home.append(crossing)
    return clusters


def mean_point(cluster: list[Crossing]) -> FloatArray:
    """Mean of the crossings' points, weighted by their precision."""
    weights = np.array([1 / max(c.position_sd, 1e-12) ** 2 for c in cluster])
    return np.asarray(weights @ np.array([c.point for c in cluster]) / weights.sum())


def _line_feature(
    branch: Branch,
    members: list[Crossing],
    kind: str,
    around: Around,
    closes: Closes,
    longest: float,
) -> Feature:
    axis = branch.axis
    height, half_width, sd = _section(axis, members, around)
    notes: tuple[str, ...] = ("junction",) if branch.junction else ()
    if branch.closed or (branch.free == (True, True) and closes(axis, height, half_width)):
        axis = np.vstack([axis, axis[:1]])
        length = _exactly(axis)
    else:
        axis, length = _ended(branch, height, half_width, members, around, longest)
        if length.censored:
            notes += ("runs on where nothing was inspected: its length is at least this",)
    # lowered onto the base, not along one crossing's normal: a line that bends over the base has many
    on_base = around.base.foot(axis, around.tip_radius).points
    return Feature(
        kind=kind,
        axis=on_base if not np.array_equal(axis[0], axis[-1]) else np.vstack([on_base[:-1], on_base[:1]]),
        normals=around.base.foot(on_base, around.tip_radius).normals,
        height=Interval.normal(height, sd),
        width=body_width(height, half_width, around.tip_radius),
        length=length,
        evidence=evidence(members, around.detections),
        curvature_feature=bool(abs(2 * height / half_width**2) > 1 / (2 * around.tip_radius)),
        position_sd=float(np.median([c.position_sd for c in members])),
        notes=notes,
        junction=branch.junction,
    )


def _section(axis: FloatArray, members: list[Crossing], around: Around) -> tuple[float, float, float]:
    """Height of the crest, half-width of the disturbance and the height's standard deviation, m.

    Least squares over the heights of all places beside the line, but not beyond its first and last crossing.
    """
    inspection = around.inspection
    highest = [c for c in members if not isinstance(c, RunPoint)] or members
    guess = float(np.median([c.height for c in highest]))
    width = float(np.sqrt(2 * around.tip_radius * abs(guess)))
    places = inspection.near(axis, 1.5 * width)
    points = inspection.points[places]
    distance = distances(points, axis)
    inner = np.linalg.norm(points[:, None] - axis[None, [0, -1]], axis=2).min(axis=1) > distance + 1e-12
    near = inner & (distance < 1.5 * width)
    if near.sum() < 8:
        return guess, width, float(np.median([c.height_sd for c in members]))
    found, sd = inspection.height[places[near]], inspection.sd[places[near]]
    best = (np.inf, guess, width, 0.0)
    for half_width in width * np.geomspace(0.6, 2.0, 25):
        shape = crest_trace(distance[near], np.sign(guess), half_width) * np.sign(guess)
        square = max(float((shape / sd) @ (shape / sd)), np.finfo(float).tiny)
        height = float(np.clip((shape / sd) @ (found / sd) / square / guess, 0.3, 3.0)) * guess
        cost = float(robust_cost(found - height * shape, sd, height).sum())
        best = min(best, (cost, height, float(half_width), 1.0 / float(np.sqrt(square))))
    scatter = 0.5 * float(np.std([c.height for c in highest])) / np.sqrt(len(highest))
    return best[1], best[2], float(np.hypot(best[3], scatter))


def _ended(
    branch: Branch, height: float, half_width: float, members: list[Crossing], around: Around, longest: float
) -> tuple[FloatArray, Interval]:
    """The axis up to its ends, and its length: at least so much where an end was not seen."""
    axis, ends = branch.axis, []
    longest = min(longest, 3 * half_width + 2 * min(around.inspection.pitch, 3 * half_width))
    for free in branch.free[::-1]:
        if free:
            axis = _without_low_end(axis, members, half_width)
            end = line_end(axis, height, half_width, around.inspection, longest)
            axis = np.vstack([axis[: len(axis) - end.dropped], end.point])
            ends.append(end)
        axis = axis[::-1]
    return axis, ended_length(axis, ends)


def _exactly(axis: FloatArray) -> Interval:
    length = float(arclengths(axis)[-1])
    return Interval(length, length, length)


def _without_low_end(axis: FloatArray, members: list[Crossing], half_width: float) -> FloatArray:
    """The axis less a last point that is lower than the one before: that crossing passed beside the end.

    One that is far from the one before stays: without it a bend would go straight on.
    """
    if np.linalg.norm(axis[-1] - axis[-2]) > half_width:
        return axis
    places = np.array([c.point for c in members])
    last, before = (members[int(np.linalg.norm(places - point, axis=1).argmin())] for point in axis[[-1, -2]])
    low = abs(last.height) + 2 * last.height_sd < END_HEIGHT * abs(before.height)
    return axis[:-1] if low and len(axis) > 2 else axis
