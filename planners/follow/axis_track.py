"""AxisTrack: the axis of a ridge, groove or step as far as it was followed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import FloatArray
from mapping.detection import Crossing
from planners.paths import tangential


@dataclass(frozen=True, eq=False)
class Slides:
    """What `count` sweeps off an end felt: `points` (N, 3) of the base and `heights` (N,) over it, m."""

    points: FloatArray
    heights: FloatArray
    count: int

    @classmethod
    def joined(cls, before: Slides | None, points: FloatArray, heights: FloatArray) -> Slides:
        """One more sweep."""
        if before is None:
            return cls(points, heights, 1)
        points = np.concatenate([before.points, points])
        return cls(points, np.concatenate([before.heights, heights]), before.count + 1)


@dataclass(frozen=True, eq=False)
class AxisEnd:
    """An end of an axis.

    Args:
        point: (3,) on the base, m.
        sd, across_sd: standard deviations along the axis and across it, m; infinite if unknown.
        reason: "end", "edge of the model", "joins another", "closed", "lost".
        heading: (3,) direction that points off the end.
        reach: how far beyond `point` the axis was found to be gone, m.
        turn: geodesic curvature of the axis there, towards the end, 1/m.
    """

    point: FloatArray
    sd: float
    reason: str
    heading: FloatArray
    reach: float = 0.0
    turn: float = 0.0
    across_sd: float = np.inf


@dataclass(frozen=True, eq=False)
class AxisTrack:
    """A followed axis.

    Args:
        points, normals: (K, 3) on the base, in order along the axis, ends included.
        sign: +1 for ridges, -1 for grooves.
        step: True where it is the edge between two levels, not a crest or a hollow.
        height, height_sd: median |height| of its crossings, and its standard deviation, m.
        half_width: median half-width of the disturbance, m.
        ends: of the first and the last point; none if closed.
    """

    points: FloatArray
    normals: FloatArray
    sign: float
    step: bool
    height: float
    height_sd: float
    half_width: float
    ends: tuple[AxisEnd, ...]

    @property
    def closed(self) -> bool:
        """True if the axis returns to its beginning."""
        return not self.ends

    @property
    def length(self) -> float:
        """Length along the axis, m."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def distance(self, point: FloatArray) -> float:
        """Distance of a point from the axis, m."""
        return polyline_distance(point, self.points)

    def explains(self, crossing: Crossing) -> bool:
        """True if this axis alone would disturb a sweep there as much as the crossing says."""
        away = self.distance(crossing.point)
        slack = 4.0 * crossing.height_sd + 0.15 * self.height
        if self.sign * crossing.height < 0:
            # the skirts of a crest may show as shallow dips, and the rims of a groove as low crests
            return away < 1.5 * self.half_width and abs(crossing.height) < 0.3 * self.height + slack
        if self.step:
            return away < 1.5 * self.half_width
        near = max(away - 2.0 * crossing.position_sd - 0.1 * self.half_width, 0.0)
        expected = self.height * (1.0 - min(near / (1.2 * self.half_width), 1.0) ** 2)
        return abs(crossing.height) < expected + slack and away < 1.3 * self.half_width

    def repeats(self, other: AxisTrack) -> bool:
        """True if all of this axis lies within another's half-width, or bridges two stretches of it."""
        away = np.array([other.distance(point) for point in self.points])
        joined = all(end.reason == "joins another" for end in self.ends) and bool(self.ends)
        short = self.length < 3.0 * self.half_width
        return bool((away < other.half_width).all() or (joined and short and (away[[0, -1]] < other.half_width).all()))

    def with_end(self, index: int, end: AxisEnd) -> AxisTrack:
        """The track with one end moved; points of the axis beyond the new end are dropped."""
        points, normals = self.points, self.normals
        if index == 0:
            points, normals = points[::-1], normals[::-1]
        keep = (points - end.point) @ end.heading < 0
        keep[0] = True
        points = np.concatenate([points[keep], end.point[None]])
        normals = np.concatenate([normals[keep], normals[-1:]])
        if index == 0:
            points, normals = points[::-1], normals[::-1]
        ends = tuple(end if i == index else other for i, other in enumerate(self.ends))
        return replace(self, points=points, normals=normals, ends=ends)


def polyline_distance(point: FloatArray, line: FloatArray) -> float:
    """Distance of a point (3,) from a polyline (K, 3), m."""
    if len(line) == 1:
        return float(np.linalg.norm(point - line[0]))
    start, step = line[:-1], np.diff(line, axis=0)
    square = np.maximum((step**2).sum(axis=1), np.finfo(float).tiny)
    share = np.clip(((point - start) * step).sum(axis=1) / square, 0.0, 1.0)
    return float(np.linalg.norm(point - start - share[:, None] * step, axis=1).min())


@dataclass(frozen=True, eq=False)
class Course:
    """Where a line is and where it goes: `point` (3,) m, `heading` (3,) unit, `turn` geodesic curvature 1/m."""

    point: FloatArray
    heading: FloatArray
    turn: float


def course(points: FloatArray, normal: FloatArray, fallback: FloatArray, tip_radius: float) -> Course:
    """The course at the last of the points (K, 3) of a line: the circle through those of the last 1.5 tip radii.

    Least squares for offset, angle and curvature in the tangent plane, by arclength; curvatures above 1/r
    are held to be unlikely, which steadies the angle while the points are few or close together.

    Args:
        normal: (3,) of the base at the last point.
        fallback: (3,) heading while there is only one point.
    """
    last = points[-1]
    back = -np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[::-1], axis=0), axis=1))])
    count = max(int((back > -1.5 * tip_radius).sum()), min(4, len(points)))
    if count < 2:
        return Course(last, tangential(fallback, normal), 0.0)
    recent, s = points[::-1][:count] - last, back[:count]
    forward = tangential(-recent[-1], normal)
    left = np.cross(normal, forward)
    v = recent @ left
    design = np.column_stack([np.ones(count), s, 0.5 * s**2])
    # the crossings scatter by about a two-hundredth of the tip radius
    prior = np.array([[0.0, 0.0, 0.005 * tip_radius**2]])
    offset = angle = turn = 0.0
    for _ in range(4):
        half = 0.5 * turn * s
        curve = offset + s * np.sin(angle + half) * np.sinc(half / np.pi)
        rest = np.concatenate([v - curve, -prior[0, 2:] * turn])
        change = np.linalg.lstsq(np.vstack([design, prior]), rest, rcond=None)[0]
        offset, angle, turn = offset + change[0], float(np.clip(angle + change[1], -1.5, 1.5)), turn + change[2]
    heading = tangential(np.cos(angle) * forward + np.sin(angle) * left, normal)
    return Course(last + offset * left, heading, float(turn))
