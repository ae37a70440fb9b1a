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
        bend: curvature of the base across the chart there, 1/m.
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
        bend = float(chart.bend[end])
        points[:, 2] = np.minimum(points[:, 2], -0.5 * bend * points[:, 1] ** 2)
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

    def short(self, ends: FloatArray) -> FloatArray:
        """(W,) by how much lines with ends (W, 2) along the chart end before the edge, m; 0 of those that are open."""
        before = ends[:, 0] - self.place if self.first else self.place - ends[:, 1]
        return np.maximum(before, 0.0)

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
        short, courses = mouth.short(theta[:, first : first + 2]), theta[:, : len(mouth.basis)]
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


def opened(chart: Chart, ends: FloatArray) -> FloatArray:
    """Ends (W, 2) along a chart, those beyond an edge of the body EVERYWHERE: the line does not end on this face."""
    places = np.ascontiguousarray(ends)
    for k, (end, wall) in enumerate(zip(chart.s[[0, -1]], chart.walls, strict=True)):
        if wall is not None:
            beyond = ends[:, k] <= end if k == 0 else ends[:, k] >= end
            places = places.copy()
            places[beyond, k] = -EVERYWHERE if k == 0 else EVERYWHERE
    return places
