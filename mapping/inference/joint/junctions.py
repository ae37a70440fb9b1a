"""Junctions: the one place at which lines meet, estimated from the courses of all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import Details, Feature, FloatArray, Interval
from mapping.base import Base, onto_base
from mapping.geometry.mesh import arclengths, nearest_on
from mapping.inference import with_open_ends
from mapping.inference.families import MEETING_REACH, touches
from mapping.inference.kinds import kind_of

# A course is known no better than this share of the half-width; places that settle the meeting place
LEAST_SD, MEETING_ROUNDS = 1e-3, 5
NORMAL_QUANTILE_95 = 1.6448536


@dataclass(frozen=True, eq=False)
class Meeting:
    """A place at which lines end on others.

    Args:
        ends: (feature, 0 or -1) of every line that ends here, by its number.
        lines: numbers of all features that come here, those that end and those that pass.
        reach: standard deviation of the place before the courses are looked at, m.
    """

    ends: tuple[tuple[int, int], ...]
    lines: tuple[int, ...]
    reach: float


def meetings(features: Sequence[Feature], half_widths: Sequence[float]) -> list[Meeting]:
    """The places at which ridges and grooves that were detected as one detail end on one another."""
    found: list[Meeting] = []
    lines = [k for k, feature in enumerate(features) if feature.junction and kind_of(feature).has_ends]
    for number in lines:
        feature, half_width = features[number], half_widths[number]
        for end in () if feature.closed else (0, -1):
            place, reach = feature.axis[end], MEETING_REACH * half_width
            met = [k for k in lines if k != number and touches(place, features[k], half_width)]
            if not met:
                continue
            one = Meeting(((number, end),), tuple(sorted([number, *met])), reach)
            same = [m for m in found if np.linalg.norm(features[m.ends[0][0]].axis[m.ends[0][1]] - place) < reach]
            found = [m for m in found if m not in same]
            found.append(_joined([*same, one]))
    return found


def _joined(several: list[Meeting]) -> Meeting:
    ends = tuple(end for meeting in several for end in meeting.ends)
    lines = tuple(sorted({line for meeting in several for line in meeting.lines}))
    return Meeting(ends, lines, max(meeting.reach for meeting in several))


def brought_together(
    features: Sequence[Feature], met: Sequence[Meeting], half_widths: Sequence[float], base: Base, tip_radius: float
) -> list[Feature]:
    """The features with the ends of those that meet at the place that is nearest to all courses there.

    Each course is weighted across itself with the precision that its draws give it; along itself an end that others
    cover is hardly determined by its own samples.

    Args:
        features: refined ones, in the order of the detected ones that `met` was found with.
        met: where they meet.
        half_widths: of their disturbances, m.
        base: the global model, on which the place lies.
        tip_radius: m.
    """
    result = list(features)
    for meeting in met:
        place, covariance = _place(meeting, result, half_widths)
        first, end = meeting.ends[0]
        point = onto_base(place[None], result[first].normals[end][None], base, tip_radius)[0]
        for number, end in meeting.ends:
            result[number] = _ended_at(result[number], end, point[0], covariance, half_widths[number], base, tip_radius)
    return result


def _place(
    meeting: Meeting, features: Sequence[Feature], half_widths: Sequence[float]
) -> tuple[FloatArray, FloatArray]:
    """The meeting place (3,), m, and its covariance (3, 3): least squares over the courses, by Gauss-Newton steps."""
    before: FloatArray = np.mean([features[number].axis[end] for number, end in meeting.ends], axis=0)
    point, covariance = before, np.eye(3)
    for _ in range(MEETING_ROUNDS):
        precision = np.eye(3) / meeting.reach**2
        pull = precision @ before
        for number in meeting.lines:
            feature, half_width = features[number], half_widths[number]
            foot, way, sd = _course(feature, point, half_width)
            across = (np.eye(3) - np.outer(way, way)) / max(sd, LEAST_SD * half_width) ** 2
            precision, pull = precision + across, pull + across @ foot
        covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
        point = np.asarray(covariance @ pull, dtype=np.float64)
    return point, covariance


def _course(feature: Feature, point: FloatArray, half_width: float) -> tuple[FloatArray, FloatArray, float]:
    """The place (3,) on a feature's course nearest to a point, the unit way there, and how well it is known, m."""
    line = _extended(feature.axis, half_width)
    foot, at = nearest_on(point[None], line)
    s = arclengths(line)
    leg = int(np.clip(np.searchsorted(s, at[0], side="right"), 1, len(line) - 1))
    way = line[leg] - line[leg - 1]
    along = feature.details.axis_sd
    known = np.array([feature.position_sd]) if along is None else along
    share = (at[0] - half_width) / max(s[-1] - 2.0 * half_width, np.finfo(float).tiny)
    sd = float(np.interp(share, np.linspace(0.0, 1.0, len(known)), known))
    return foot[0], way / np.linalg.norm(way), sd


def _extended(axis: FloatArray, reach: float) -> FloatArray:
    """The polyline (K, 3) gone on straight beyond its first and its last point."""
    first, last = axis[0] - axis[1], axis[-1] - axis[-2]
    return np.vstack([
        axis[0] + reach * first / np.linalg.norm(first), axis, axis[-1] + reach * last / np.linalg.norm(last)
    ])  # fmt: skip


def _ended_at(
    feature: Feature, end: int, place: FloatArray, covariance: FloatArray, half_width: float, base: Base, tip: float
) -> Feature:
    """The feature with one end at the place: cut or gone on along its course, the last half-width bent to it."""
    order = slice(None) if end == -1 else slice(None, None, -1)
    axis = feature.axis[order]
    line = _extended(axis, half_width)[1:]
    foot, at = nearest_on(place[None], line)
    if at[0] <= 0.0:  # the place lies before its other end: the course says nothing
        return feature
    s, even = arclengths(line), np.linspace(0.0, at[0], len(axis))
    points = np.column_stack([np.interp(even, s, line[:, i]) for i in range(3)])
    bent = np.clip(1.0 - (at[0] - even) / half_width, 0.0, 1.0)
    points += bent[:, None] * (place - foot[0])
    along = np.interp(even, arclengths(axis), np.arange(len(axis)))
    nearest = feature.normals[order][np.round(along).astype(int)]
    points, normals = onto_base(points, nearest, base, tip)
    points[-1] = place
    way = (line[-1] - line[-2]) / np.linalg.norm(line[-1] - line[-2])
    spread = NORMAL_QUANTILE_95 * float(np.sqrt(way @ covariance @ way))
    details, length = _measured(feature, end, points, spread)
    notes = with_open_ends(feature.notes, details.ends_seen or (True, True))
    sd = details.axis_sd
    if sd is not None and len(sd) == len(axis):
        details = replace(details, axis_sd=np.interp(along, np.arange(len(axis)), sd[order])[order])
    return replace(feature, axis=points[order], normals=normals[order], length=length, details=details, notes=notes)


def _measured(feature: Feature, end: int, axis: FloatArray, spread: float) -> tuple[Details, Interval]:
    """What is known of the ends, and the length (m), once an end lies within `spread` of its place."""
    details, length = feature.details, float(arclengths(axis)[-1])
    if details.end_intervals is None or details.ends_seen is None:
        off = length - feature.length.median
        return details, replace(
            feature.length, median=length, low=feature.length.low + off, high=feature.length.high + off
        )
    intervals, seen = details.end_intervals.copy(), list(details.ends_seen)
    intervals[end], seen[end] = [-spread, spread], True
    details = replace(details, end_intervals=intervals, ends_seen=(seen[0], seen[1]))
    shorter = float(np.hypot(intervals[0][1], intervals[1][0]))
    longer = float(np.hypot(intervals[0][0], intervals[1][1]))
    return details, Interval(length, max(length - shorter, 0.0), length + longer, not all(seen))
