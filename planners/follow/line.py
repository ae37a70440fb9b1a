"""Line: the crossings of one ridge in the order of its axis, and the track that both ways from a seed make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.detection import Crossing
from planners.follow.axis_track import AxisEnd, AxisTrack, polyline_distance
from planners.follow.recross import is_step


@dataclass
class Line:
    """Crossings of one ridge in the order of its axis, while it is being followed one way from that of the `seed`."""

    crossings: list[Crossing]
    step: float
    seed: int = 0

    @property
    def points(self) -> FloatArray:
        """(K, 3) axis points, m."""
        return np.array([c.point for c in self.crossings])

    @property
    def height(self) -> float:
        """Median |height| of the last crossings, m."""
        return float(np.median([abs(c.height) for c in self.crossings[-4:]]))

    @property
    def half_width(self) -> float:
        """Median half-width of the disturbance, m."""
        return float(np.median([c.half_width for c in self.crossings[-5:]]))


def returned(line: Line) -> bool:
    """True if the last stretch of the line passes its own beginning, after a way round."""
    points = line.points
    if len(points) < 5:
        return False
    travelled = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    last_step = float(np.linalg.norm(points[-1] - points[-2]))
    return travelled > 3.0 * last_step and polyline_distance(points[0], points[-2:]) < 0.5 * line.half_width


def joined(halves: list[tuple[Line, AxisEnd | None]], sign: float) -> AxisTrack:
    """One track of both directions; the seed's crossing is shared, and each end's point is added."""
    line, end = halves[0]
    crossings = list(line.crossings)
    last_end = end
    if end is not None and len(halves) > 1:
        back, first_end = halves[1]
        crossings = [*back.crossings[: back.seed : -1], *crossings]
    else:
        first_end = AxisEnd(crossings[0].point, np.inf, "lost", -_first_step(crossings))
    points = [c.point for c in crossings]
    normals = [c.normal for c in crossings]
    step = is_step(crossings[0])
    height, sd = mean_height(crossings[1:-1] or crossings)
    half_width = float(np.median([c.half_width for c in crossings]))
    if last_end is None or first_end is None:
        if _passes(points[0], points[-2], points[-1]):
            points, normals = points[:-1], normals[:-1]
        points.append(points[0])
        normals.append(normals[0])
        return AxisTrack(np.array(points), np.array(normals), sign, step, height, sd, half_width, ())
    ends = (first_end, last_end)
    track = AxisTrack(np.array(points), np.array(normals), sign, step, height, sd, half_width, ends)
    for index, tip in enumerate(ends):
        if tip.reason in ("end", "edge of the model"):
            track = track.with_end(index, tip)
    return track


def mean_height(crossings: list[Crossing]) -> tuple[float, float]:
    """Median |height| of a line and its standard deviation, m: by the crossings' scatter if they claim less."""
    heights = np.array([abs(c.height) for c in crossings])
    claimed = float(np.median([c.height_sd for c in crossings]))
    # the median of normal variables scatters by a quarter more than their mean
    return float(np.median(heights)), 1.25 * max(claimed, float(heights.std())) / float(np.sqrt(len(heights)))


def _passes(point: FloatArray, start: FloatArray, stop: FloatArray) -> bool:
    """True if the stretch from start to stop leads past the point rather than up to it."""
    return bool((point - start) @ (stop - start) < (stop - start) @ (stop - start))


def _first_step(crossings: list[Crossing]) -> FloatArray:
    if len(crossings) < 2:
        return crossings[0].tangent
    step = crossings[1].point - crossings[0].point
    return np.asarray(step / max(float(np.linalg.norm(step)), np.finfo(float).tiny))
