"""Mouth: where a line is cut off by an edge of the body, and the places from which its cut end is felt."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray
from mapping.inference.curves.chart import Chart
from mapping.inference.curves.curve_modes import CurveModes
from mapping.inference.likelihood import Window

# Half of a section (W, J), distances from its middle outwards and heights over the base, m, of lines that end so far
# before the edge (W,), m
Outline = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
# A ball in a hollow rests on rims so many tip radii beside its centre: one of 4 mm under a ball of 3 mm by 0.67; what
# is cut off at a slant is missing there
RIM_BESIDE = 0.5
# A foot no farther before the edge lies on it, in tip radii
ROUNDING = 1e-9
# Sine of the angle at which a course must meet an edge to cross it
CROSSING_SINE = 0.1
# An end of a line that goes on, m
EVERYWHERE = 1e300


@dataclass(frozen=True, eq=False)
class Mouth:
    """The end of a chart at an edge of the body.

    Args:
        first: True of the first end of the chart.
        place: of the edge along the chart, m.
        bins: (M,) of a window that feel that the line is cut off: first those on the edge or on the wall behind it,
            then such before it as the ball may reach a mouth from that is cut at a slant.
        beyond: how many are beyond the edge.
        points, ways: (M, 3) where they lie, m, and directions to the ball, in the frame of the edge: out along the
            chart, beside it, and over the base.
        wall: (3,) outward unit normal of the wall in that frame.
        bend: curvature of the base along the edge, 1/m.
        basis, slopes: (m,) lateral modes at the edge, and their change per metre out.
    """

    first: bool
    place: float
    bins: IntArray
    beyond: int
    points: FloatArray
    ways: FloatArray
    wall: FloatArray
    bend: float
    basis: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, window: Window, chart: Chart, modes: CurveModes, tip: float, first: bool) -> Mouth | None:
        """The mouth at one end; None where that is no edge, or nothing was felt beyond it."""
        end, sign = (0, -1.0) if first else (-1, 1.0)
        normal = chart.walls[end]
        if normal is None:
            return None
        frame = np.stack([sign * chart.tangents[end], chart.laterals[end], chart.normals[end]], axis=1)
        points, wall = (window.feet - chart.points[end]) @ frame, normal @ frame
        if wall[0] <= 0.0:
            return None
        out = points @ wall
        slant = RIM_BESIDE * tip * float(abs(wall[1]) / wall[0])
        on = out > -window.half - ROUNDING * tip
        beyond, before = np.flatnonzero(on), np.flatnonzero(~on & (out > -slant))
        bins = np.concatenate([beyond, before])
        if not len(beyond):
            return None
        # the mean of a few feet lies off the body by some of their scatter
        points = points[bins] - np.maximum(out[bins], 0.0)[:, None] * wall
        place = chart.s[[end]]
        bend = chart.edge_bends[end]
        on_edge = np.arange(len(bins)) < len(beyond)
        sag = 0.5 * bend * (points[:, 0] ** 2 + points[:, 1] ** 2)
        points[on_edge, 2] = np.minimum(points, -sag[:, None])[on_edge, 2]
        return cls(
            first,
            float(place[0]),
            bins,
            len(beyond),
            points,
            window.normals[bins] @ frame,
            wall,
            bend,
            modes.basis(place)[:, 0],
            sign * modes.slopes(place)[:, 0],
        )

    def short(self, courses: FloatArray, ends: FloatArray) -> FloatArray:
        """(W,) by how much lines of courses (W, m) with ends (W, 2) along the chart end before the edge, m; 0 of those
        that are open."""
        before = ends[:, 0] - self.place if self.first else self.place - ends[:, 1]
        return np.maximum(before + _farther(courses @ self.basis, courses @ self.slopes, self.wall), 0.0)

    def felt(
        self, courses: FloatArray, across: FloatArray, up: FloatArray, tip: float, *, beyond: bool = False
    ) -> FloatArray:
        """(W, M) heights of lines with half sections (W, J), m, on all bins, or only on those beyond the edge."""
        from mapping.geometry.templates import mouth_heights

        count = self.beyond if beyond else len(self.bins)
        out = np.empty((len(courses), count))
        points, aside, slopes = self.points[:count, None], courses @ self.basis, courses @ self.slopes
        mouth_heights(points, self.ways[:count], self.wall, self.bend, aside, slopes, across, up, tip, out)
        return out


def laid_beyond(
    mouths: Sequence[Mouth],
    heights: FloatArray,
    theta: FloatArray,
    names: Sequence[str],
    tip: float,
    outline: Outline,
    *,
    fades: bool = False,
) -> None:
    """Put into heights (W, n), m, what the ball feels of lines beyond the edges that cut them off.

    Args:
        mouths: where edges cut them off.
        heights: as of lines that go on, or have ended on their face.
        theta, names: (W, P) parameters of the lines, the modes of their courses first, and their names.
        tip: radius of the fingertip, m.
        outline: their sections.
        fades: True of lines that run out at their ends, so that one which ends a little before an edge is felt beyond.
    """
    for mouth in mouths:
        first = names.index("start")
        courses = theta[:, : len(mouth.basis)]
        short = mouth.short(courses, theta[:, first : first + 2])
        across, up = outline(short)
        for rows, beyond in ((short == 0.0, False), (short > 0.0, True)):
            if rows.any() and (fades or not beyond):
                bins = mouth.bins[: mouth.beyond] if beyond else mouth.bins
                felt = mouth.felt(courses[rows], across[rows], up[rows], tip, beyond=beyond)
                heights[np.ix_(np.flatnonzero(rows), bins)] = felt


def mouths_of(window: Window, chart: Chart, modes: CurveModes, tip: float) -> tuple[Mouth, ...]:
    """The mouths of a chart over a window, as a ball of a radius (m) feels them."""
    if chart.closed:
        return ()
    both = [Mouth.of(window, chart, modes, tip, first) for first in (True, False)]
    return tuple(mouth for mouth in both if mouth is not None)


def opened(chart: Chart, modes: CurveModes, courses: FloatArray, ends: FloatArray) -> FloatArray:
    """Ends (W, 2) along a chart; EVERYWHERE those before which courses (W, m) cross an edge of the body: the line does
    not end on this face."""
    if all(wall is None for wall in chart.walls):
        return np.ascontiguousarray(ends)
    edges = edges_along(chart, modes, courses)
    first = np.where(ends[:, 0] <= edges[:, 0], -EVERYWHERE, ends[:, 0])
    return np.column_stack([first, np.where(ends[:, 1] >= edges[:, 1], EVERYWHERE, ends[:, 1])])


def edges_along(chart: Chart, modes: CurveModes, courses: FloatArray) -> FloatArray:
    """(W, 2) places along a chart at which courses (W, m) cross the edges of the body at its ends, m; where there is
    none, infinitely far out."""
    places = np.tile([-np.inf, np.inf], (len(courses), 1))
    for end, (sign, wall) in enumerate(zip((-1.0, 1.0), chart.walls, strict=True)):
        if wall is not None:
            at = chart.s[[-end]]
            aside, slope = courses @ modes.basis(at)[:, 0], sign * (courses @ modes.slopes(at)[:, 0])
            faced = np.array([sign * chart.tangents[-end] @ wall, chart.laterals[-end] @ wall])
            places[:, end] = at + sign * _farther(aside, slope, faced)
    return places


def ends_on_face(chart: Chart, modes: CurveModes, courses: FloatArray, ends: FloatArray) -> FloatArray:
    """Ends (W, 2) along a chart, m; of courses (W, m) that are open at an edge of the body at that edge."""
    edges = edges_along(chart, modes, courses)
    return np.clip(ends, edges[:, :1], edges[:, 1:])


def _farther(aside: FloatArray, slope: FloatArray, wall: FloatArray) -> FloatArray:
    """(W,) by how much farther out than the chart its courses meet an edge that they cross at a slant, m.

    Args:
        aside, slope: (W,) of the course beside the chart there, m, and its change for each metre out.
        wall: of the outward normal of the wall first the parts along the chart and beside it.
    """
    out = wall[0] + slope * wall[1]
    return np.where(out > CROSSING_SINE, -aside * wall[1] / np.maximum(out, CROSSING_SINE), 0.0)
