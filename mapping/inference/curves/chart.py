"""Chart: Fermi coordinates, distances along and across a curve on the base, in which lines are described.

Reference: theory section 10.4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import CourseError, FloatArray, IntArray, lengths
from mapping.base import Base, between_walls, onto_base
from mapping.geometry.mesh import arclengths
from mapping.inference.curves.body_edge import Wall, up_to_edges

# Legs longer than this, in tip radii, are asked in between where a wall begins: a ball feels one from a radius away on
ASKED_WALL = 0.5
# Chords that tell in which direction a line ends, in half-widths of its disturbance: an S of arcs of 3 mm under a ball
# of 10 mm (building seed 1000) has the log evidence 7098.7 with a half, 7101.4 with a quarter, whose chords hold more
# noise; two ridges and a bump had 7033.1 before
ONWARD = 0.5


@dataclass(frozen=True, eq=False)
class Chart:
    """A reference curve on the base.

    Args:
        s: (K,) distance along the curve, m.
        points: (K, 3) points of the base, m.
        tangents, laterals, normals: (K, 3) right-handed unit frames: lateral = normal x tangent.
        bend, bend_along: (K,) normal curvatures of the base across and along the curve, 1/m, positive where it bulges
            outward.
        closed: True if the curve returns to its beginning (last point equals the first).
        walls: outward normals of the walls behind the sharp edges of the body at which the curve begins and ends; None
            where it comes to no edge.
        edge_bends: curvatures of the base along these edges, 1/m, as `bend`.
        felt: first and last of the legs that the curve was felt on, not those that go on straight from its ends; None
            if all are.
        reach: how far beside the curve it is felt, m.
    """

    s: FloatArray
    points: FloatArray
    tangents: FloatArray
    laterals: FloatArray
    normals: FloatArray
    bend: FloatArray
    bend_along: FloatArray
    closed: bool
    walls: tuple[Wall, Wall] = (None, None)
    edge_bends: tuple[float, float] = (0.0, 0.0)
    felt: tuple[int, int] | None = None
    reach: float = 0.0

    @property
    def length(self) -> float:
        """Length of the curve, m."""
        return float(self.s[-1] - self.s[0])

    @property
    def arcs(self) -> FloatArray:
        """(K,) length of the smooth curve through the points up to each, m: on `s` chords cut its bends.

        From point to point it is a circle that turns by the angle between their tangents.
        """
        half = np.arcsin(np.clip(0.5 * np.linalg.norm(np.diff(self.tangents, axis=0), axis=1), 0.0, 1.0))
        return np.concatenate([[0.0], np.cumsum(np.diff(self.s) / np.sinc(half / np.pi))])

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Points, laterals, normals (..., 3) and bends (...) at distances s, interpolated linearly."""
        leg = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        share = ((s - self.s[leg]) / (self.s[leg + 1] - self.s[leg]))[..., None]

        def mix(values: FloatArray) -> FloatArray:
            return np.asarray((1.0 - share) * values[leg] + share * values[leg + 1])

        return mix(self.points), mix(self.laterals), mix(self.normals), mix(self.bend[:, None])[..., 0]

    def coordinates(self, points: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
        """Distance along the curve, signed lateral distance (n,) and nearest leg of points (n, 3) on the base, m.

        Where a line that bends goes on straight from an end it may run into itself: a point that is felt on the line
        itself lies there, however near to it the line might go on.
        """
        from mapping.inference.curves.leg_kernels import nearest_legs

        nearest = nearest_legs(points, self.points)
        s, lateral = self._on_leg(points, nearest)
        if self.felt is not None:
            first, last = self.felt
            onward = np.flatnonzero((nearest < first) | (nearest > last))
            own = first + nearest_legs(points[onward], self.points[first : last + 2])
            along, aside = self._on_leg(points[onward], own)
            on_line = (np.abs(aside) < self.reach) & (along > self.s[first]) & (along < self.s[last + 1])
            onward = onward[on_line]
            nearest[onward], s[onward], lateral[onward] = own[on_line], along[on_line], aside[on_line]
        return s, lateral, nearest

    def _on_leg(self, points: FloatArray, leg: IntArray) -> tuple[FloatArray, FloatArray]:
        offset = points - self.points[leg]
        along = self.points[leg + 1] - self.points[leg]
        length = lengths(along)
        forward = np.einsum("ij,ij->i", offset, along) / np.maximum(length, np.finfo(float).tiny)
        lateral = np.einsum("ij,ij->i", offset, self.laterals[leg])
        s = self.s[leg] + forward * (self.s[leg + 1] - self.s[leg]) / np.maximum(length, np.finfo(float).tiny)
        return s, lateral


def chart_along(
    axis: FloatArray,
    normals: FloatArray,
    base: Base,
    tip_radius: float,
    spacing: float,
    extension: float,
    reach: float,
    *,
    bends: bool = True,
) -> Chart:
    """The chart along a polyline, its vertices put on the base, straight on by `extension` beyond both ends.

    Args:
        axis: (K, 3) polyline near the base, K >= 2, m; first equals last for a closed curve.
        normals: (K, 3) outward normals at its points.
        base: the global model.
        tip_radius: radius of the fingertip, m: feet are sought from this high above.
        spacing: wanted distance of the chart's points, m.
        extension: length added at both ends of an open curve, m; less where the base ends, a wall begins, or an edge of
            the body is crossed.
        reach: distance over which the bends of the base are measured, m.
        bends: False for a trial of the course alone: the base is not asked how it bends across, and taken for flat.

    Raises:
        CourseError: the line does not lie over the base, turns back on itself, or has no length.
    """
    closed = len(axis) > 3 and bool(np.array_equal(axis[0], axis[-1]))
    line, lift = _resampled(axis, normals, spacing)
    if not closed and extension > 0.0:
        line, lift = _extended(line, lift, spacing, extension, reach)
    walls: tuple[Wall, Wall] = (None, None)
    if not closed:
        on_face = up_to_edges(*_short_of_walls(line, lift, base, tip_radius), base, tip_radius)
        line, lift, walls = on_face.line, on_face.lift, on_face.walls
    points, up = onto_base(line, lift, base, tip_radius, smooth=int(0.5 * reach / spacing))
    if not closed:
        keep = _on_base(points - line, up, 0.1 * reach)
        points, up = _apart(points[keep], up[keep])
    if closed:
        points[-1], up[-1] = points[0], up[0]
    tangents = _tangents(points, closed)
    laterals = np.cross(up, tangents)
    laterals /= np.linalg.norm(laterals, axis=1, keepdims=True)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    bend, bend_along = np.zeros((2, len(s)))
    if bends:
        bend = _bend(points, laterals, up, base, tip_radius, reach)
        bend_along = _bend_along(points, s, tangents, up, reach, closed)
    edge_bends = [0.0, 0.0]
    for end, wall in enumerate(walls):
        if wall is not None and bends:
            along = np.cross(wall, up[-end])[None]
            edge_bends[end] = float(_bend(points[[-end]], along, up[[-end]], base, tip_radius, reach)[0])
    chart = Chart(s, points, tangents, laterals, up, bend, bend_along, closed, walls, (edge_bends[0], edge_bends[1]))
    if closed or extension == 0.0:
        return chart
    ends = np.sort(chart.coordinates(axis[[0, -1]])[2])
    return replace(chart, felt=(int(ends[0]), int(ends[1])), reach=reach)


def _resampled(axis: FloatArray, normals: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(s) > 0.0])
    s, axis, normals = s[keep], axis[keep], normals[keep]
    if len(s) < 2:
        raise CourseError("all points of its axis are one")
    even = np.linspace(0.0, s[-1], max(2, int(np.ceil(s[-1] / spacing)) + 1))
    both = [np.column_stack([np.interp(even, s, values[:, i]) for i in range(3)]) for values in (axis, normals)]
    return both[0], both[1] / np.linalg.norm(both[1], axis=1, keepdims=True)


def _extended(
    line: FloatArray, lift: FloatArray, spacing: float, extension: float, reach: float
) -> tuple[FloatArray, FloatArray]:
    """The line and its normals with straight legs before and behind, as the line runs where it ends."""
    count = max(1, int(np.ceil(extension / spacing)))
    far = np.linspace(extension / count, extension, count)[:, None]
    before = line[0] + far[::-1] * _onward(line[::-1], reach)
    behind = line[-1] + far * _onward(line, reach)
    lifts = [np.repeat(lift[:1], count, axis=0), lift, np.repeat(lift[-1:], count, axis=0)]
    return np.concatenate([before, line, behind]), np.concatenate(lifts)


def _onward(line: FloatArray, reach: float) -> FloatArray:
    """(3,) unit direction in which a line (K, 3) ends, from two chords of half a reach (m), or of a third of it.

    The last leg alone would hold the noise of two crossings. A chord runs as the line does at its middle: where the
    line bends it goes on turning from there by half of what it turned from the chord before. Without that places beside
    the line were nearer to the extension and taken to lie beyond it: of two arcs of 250 degrees it left them by 84.
    """
    s = arclengths(line)[-1] - arclengths(line)
    stretch = min(ONWARD * reach, s[0] / 3.0)
    ends = np.column_stack([np.interp([0.0, stretch, 2.0 * stretch], s[::-1], line[::-1, i]) for i in range(3)])
    last, before = ends[0] - ends[1], ends[1] - ends[2]
    onward = 1.5 * last / np.linalg.norm(last) - 0.5 * before / np.linalg.norm(before)
    return np.asarray(onward / np.linalg.norm(onward))


def _short_of_walls(line: FloatArray, lift: FloatArray, base: Base, tip_radius: float) -> tuple[FloatArray, FloatArray]:
    """The line and its normals up to where it runs into walls, which legs longer than ASKED_WALL are asked for between
    their ends: an extension may be a single one."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    legs = np.ceil(np.diff(s) / (ASKED_WALL * tip_radius)).astype(int)
    shares = np.concatenate([np.arange(count) / max(count, 1) for count in legs])
    asked = np.append(np.repeat(s[:-1], legs) + shares * np.repeat(np.diff(s), legs), s[-1])
    reached = asked[between_walls(*_at_places(asked, s, line, lift), base, tip_radius)]
    if len(reached) == len(asked):
        return line, lift
    inner = s[(s > reached[0]) & (s < reached[-1])]
    return _at_places(np.concatenate([reached[:1], inner, reached[-1:]]), s, line, lift)


def _at_places(places: FloatArray, s: FloatArray, line: FloatArray, lift: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (N, 3) and unit normals (N, 3) at arclengths (N,) of a line with arclengths s (K,)."""
    points, up = (np.column_stack([np.interp(places, s, of[:, i]) for i in range(3)]) for of in (line, lift))
    return points, up / np.linalg.norm(up, axis=1, keepdims=True)


def _on_base(moved: FloatArray, up: FloatArray, tolerance: float) -> slice:
    """The longest stretch about the middle that lies over the base, and one point more at each border.

    A foot moves along its own normal where the base goes on, and sideways, back to the border, where it does not.
    """
    sideways = moved - np.einsum("ij,ij->i", moved, up)[:, None] * up
    out = np.flatnonzero(np.linalg.norm(sideways, axis=1) > tolerance)
    middle = len(moved) // 2
    low, high = int(out[out < middle].max(initial=-1)), int(out[out >= middle].min(initial=len(moved)))
    return slice(max(low, 0), min(high + 1, len(moved)))


def _apart(points: FloatArray, up: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The points without those that stand where the one before them does: on the base's border feet gather."""
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    apart = np.concatenate([[True], step > 1e-9 * step.max(initial=0.0)])
    if apart.sum() < 2:
        raise CourseError("its axis does not lie over the base")
    return points[apart], up[apart]


def _tangents(points: FloatArray, closed: bool) -> FloatArray:
    if closed:
        ring = points[:-1]
        along = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
        along = np.concatenate([along, along[:1]])
    else:
        along = np.gradient(points, axis=0)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    if length.min() <= 1e-9 * length.max():
        raise CourseError("its axis turns back on itself")
    return np.asarray(along / length)


def _bend(
    points: FloatArray, laterals: FloatArray, up: FloatArray, base: Base, tip_radius: float, reach: float
) -> FloatArray:
    """(K,) curvature across the curve from the base's sag at `reach` on both sides; 0 where the base ends."""
    sag = np.zeros((2, len(points)))
    for side, sign in enumerate((-1.0, 1.0)):
        aside = base.foot(points + sign * reach * laterals + tip_radius * up, tip_radius).points - points
        across = np.einsum("ij,ij->i", aside, laterals)
        drop = -np.einsum("ij,ij->i", aside, up)
        sound = np.abs(across) > 0.5 * reach
        sag[side] = np.where(sound, 2.0 * drop / np.where(sound, across, 1.0) ** 2, np.nan)
    return _known_mean(sag)


def _bend_along(
    points: FloatArray, s: FloatArray, tangents: FloatArray, up: FloatArray, reach: float, closed: bool
) -> FloatArray:
    """(K,) curvature along the curve from the sag of its own points at `reach` on both sides; 0 where it is shorter."""
    around, places = points, s
    if closed:
        around = np.concatenate([points[:-1], points[:-1], points])
        places = np.concatenate([s[:-1] - s[-1], s[:-1], s + s[-1]])
    sag = np.full((2, len(points)), np.nan)
    for side, sign in enumerate((-1.0, 1.0)):
        at = s + sign * reach
        inside = (at >= places[0]) & (at <= places[-1])
        away = np.column_stack([np.interp(at, places, around[:, i]) for i in range(3)]) - points
        forward = np.einsum("ij,ij->i", away, tangents)
        sound = inside & (np.abs(forward) > 0.5 * reach)
        drop = -np.einsum("ij,ij->i", away, up)
        sag[side, sound] = 2.0 * drop[sound] / forward[sound] ** 2
    return _known_mean(sag)


def _known_mean(values: FloatArray) -> FloatArray:
    """(K,) mean of what is finite of (2, K) values; 0 where neither is."""
    known = np.isfinite(values)
    return np.asarray(np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1))
