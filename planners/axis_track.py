"""AxisTrack: the axis of a ridge, groove or step as far as it was followed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mapping.crossing import Crossing
from planners.strokes import tangential

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AxisEnd:
    """An end of an axis.

    Args:
        point: (3,) on the base, m.
        sd: standard deviation along the axis, m; infinite if unknown.
        reason: "end", "edge of the model", "joins another", "closed", "lost".
        heading: (3,) direction that points off the end.
        reach: how far beyond `point` the axis was found to be gone, m.
    """

    point: FloatArray
    sd: float
    reason: str
    heading: FloatArray
    reach: float = 0.0


@dataclass(frozen=True, eq=False)
class AxisTrack:
    """A followed axis.

    Args:
        points, normals: (K, 3) on the base, in order along the axis, ends included.
        sign: +1 for ridges, -1 for grooves.
        kind: kind of its crossings ("convex", "concave" or "step").
        height: median |height| of its crossings, m.
        half_width: median half-width of the disturbance, m.
        ends: of the first and the last point; none if closed.
    """

    points: FloatArray
    normals: FloatArray
    sign: float
    kind: str
    height: float
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
        if self.kind == "step":
            return away < 1.5 * self.half_width
        near = max(away - 2.0 * crossing.position_sd - 0.1 * self.half_width, 0.0)
        expected = self.height * (1.0 - min(near / (1.2 * self.half_width), 1.0) ** 2)
        return abs(crossing.height) < expected + slack and away < 1.3 * self.half_width

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


def heading_and_turn(points: FloatArray, normal: FloatArray, fallback: FloatArray) -> tuple[FloatArray, float]:
    """Direction at the last of the points (K, 3) and the geodesic curvature (1/m) of the line through them.

    The last two points give a direction, the last four also a curvature (least squares in the tangent plane).
    """
    if len(points) < 2:
        return tangential(fallback, normal), 0.0
    recent = points[-4:] - points[-1]
    forward = tangential(-recent[0], normal)
    u, v = recent @ forward, recent @ np.cross(normal, forward)
    degree = 2 if len(recent) >= 3 else 1
    scale = float(np.abs(u).max()) or 1.0
    design = np.vander(u / scale, degree + 1)
    coefficients = np.linalg.lstsq(design, v, rcond=None)[0]
    slope = float(coefficients[-2]) / scale
    curvature = 2.0 * float(coefficients[0]) / scale**2 if degree == 2 else 0.0
    turn = curvature / (1.0 + slope**2) ** 1.5
    return tangential(forward + slope * np.cross(normal, forward), normal), turn
