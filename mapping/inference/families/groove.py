"""GrooveShape: grooves, in which the ball rests on the nearer rim or on the bottom; and grooves that cross."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from mapping import FloatArray, IntArray
from mapping.geometry.templates import upright_outline
from mapping.inference.curves import Chart, CurveModes, Mouth, laid_beyond, mouths_of, opened
from mapping.inference.families.nodes import bin_nodes, line_nodes
from mapping.inference.families.ridge import rounding_of
from mapping.inference.families.step import OffsetRims, StepShape
from mapping.inference.likelihood import Prior, Window


@dataclass(frozen=True, eq=False)
class GrooveShape:
    """Grooves with upright walls and a flat bottom: lateral modes, rounding and places of ends, log width, log depth.

    In plan an end is square (rounding 0), or a half circle as a cutter leaves it (1). It is where the mouth ends.
    `crossed` are grooves and `edges` steps that stay as they are, each with its parameters (1, P), and of an edge
    whether it is a rim of whatever groove is tried: what these leave alone is not in the heights, but what crossing
    them, or running along them, changes is.
    """

    window: Window
    chart: Chart
    modes: CurveModes
    tip_radius: float
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray
    crossed: tuple[tuple[GrooveShape, FloatArray], ...] = ()
    edges: tuple[tuple[StepShape, FloatArray, bool], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("end rounding", "start", "end")
        return (*self.modes.names, *ends, "log width", "log depth")

    @property
    def units(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("", "m", "m")
        return (*self.modes.units, *ends, "ln m", "ln m")

    @property
    def widest(self) -> float:
        """Width that the mouth has at most, m."""
        return float(np.exp(self.priors[-2].high if self.priors else self.start[-2]))

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights (negative) over the base's trace, m."""
        from mapping.geometry.templates import groove_heights

        courses, ends, width, depth = self.taken(theta)
        rounded = np.zeros(len(theta)) if self.chart.closed else 0.5 * width * rounding_of(theta[:, -5])
        out = np.empty((len(theta), len(self.window)))
        groove_heights(*self.places, courses, ends, rounded, width, depth, self.tip_radius, out)
        laid_beyond(
            self.mouths, out, theta, self.names, self.tip_radius, lambda _: upright_outline(0.5 * width, -depth)
        )
        alone = out
        if self.crossed:
            taken = [self.taken(theta), *(groove.taken(known) for groove, known in self.crossed)]
            out = out + self._crossing.heights(taken, self.tip_radius)
        for rims, (_, known, _) in zip(self._offset_rims, self.edges, strict=True):
            out = out + rims.heights(np.hstack([theta, np.tile(known, (len(theta), 1))]), alone)
        return out

    def taken(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Courses (W, m), places of the ends (W, 2), m, widths and depths (W,), m, of parameters (W, P)."""
        courses = np.ascontiguousarray(theta[:, : self.modes.count])
        ends = np.tile([-1e300, 1e300], (len(theta), 1))
        if not self.chart.closed:
            ends = opened(self.chart, self.modes, courses, theta[:, -4:-2])
        return courses, ends, np.exp(theta[:, -2]), np.exp(theta[:, -1])

    @cached_property
    def places(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Where the nodes of the window lie, as of `line_nodes`."""
        return line_nodes(self.window, self.chart, self.modes, self.tip_radius)

    @cached_property
    def mouths(self) -> tuple[Mouth, ...]:
        """Where edges of the body cut it off."""
        return mouths_of(self.window, self.chart, self.modes, self.tip_radius)

    @cached_property
    def _crossing(self) -> Crossing:
        return Crossing.of([self, *(groove for groove, _ in self.crossed)])

    @cached_property
    def _offset_rims(self) -> list[OffsetRims]:
        alone = replace(self, crossed=(), edges=())
        return [OffsetRims(alone, edge, is_rim) for edge, _, is_rim in self.edges]


@dataclass(frozen=True, eq=False)
class Crossing:
    """The places of a window at which some grooves may disturb one another (theory section 4.4).

    Args:
        bins: number of bins.
        bin: (N,) the bin that each place lies in.
        share: of its bin that a place stands for.
        modes: of each groove: (2, m, N) lateral modes and their slopes.
        charts: (5, G, N) distance along each chart and beside it, m, the chart's direction, from the sweep's towards
            its left, rad, and the base's curvature across and along it, 1/m.
    """

    bins: int
    bin: IntArray
    share: float
    modes: tuple[FloatArray, ...]
    charts: FloatArray

    @classmethod
    def of(cls, grooves: Sequence[GrooveShape]) -> Self:
        """The places in which two grooves or more may be, or beside which, all over one window."""
        window, nodes = grooves[0].window, bin_nodes(grooves[0].window)
        reach = max(groove.widest for groove in grooves)
        near = np.zeros(nodes.shape[:2], dtype=np.int64)
        for groove in grooves:
            s, lateral, *_ = groove.places
            low, high = groove.chart.s[0] - reach, groove.chart.s[-1] + reach
            near += (np.abs(lateral) < reach) & (s > low) & (s < high)
        chosen = np.nonzero(near > 1)
        points, ahead = nodes[chosen], window.tangents[chosen[0]]
        left = np.cross(window.normals[chosen[0]], ahead)
        charts, modes = np.empty((5, len(grooves), len(points))), []
        for g, groove in enumerate(grooves):
            s, lateral, basis, bend, bend_along = groove.places
            leg = groove.chart.coordinates(points)[2]
            way = groove.chart.points[leg + 1] - groove.chart.points[leg]
            turn = np.arctan2(np.einsum("ij,ij->i", way, left), np.einsum("ij,ij->i", way, ahead))
            charts[:, g] = s[chosen], lateral[chosen], turn, bend[chosen], bend_along[chosen]
            modes.append(np.ascontiguousarray(basis[:, :, chosen[0], chosen[1]]))
        return cls(len(window), chosen[0], 1.0 / nodes.shape[1], tuple(modes), charts)

    def heights(self, taken: Sequence[tuple[FloatArray, FloatArray, FloatArray, FloatArray]], tip: float) -> FloatArray:
        """(W, n) what the grooves leave together more than the sum of what each leaves alone, m.

        Args:
            taken: of each groove, as `GrooveShape.taken` gives it; what has one row holds for all.
            tip: radius of the ball, m.
        """
        from mapping.geometry.templates import crossing_heights

        rows = max(len(each[-1]) for each in taken)
        out = np.zeros((rows, self.bins))
        chosen = self._beside_two(taken)
        if not len(chosen):
            return out
        places, sizes = np.empty((4, len(taken), rows, len(chosen))), np.empty((2, len(taken), rows))
        for g, (courses, ends, width, depth) in enumerate(taken):
            s, lateral, turn = self.charts[:3, g, chosen]
            basis, slopes = self.modes[g][:, :, chosen]
            away, slope = lateral - courses @ basis, courses @ slopes
            stretch = np.sqrt(1.0 + slope**2)
            foot = s + away * slope / stretch**2
            places[:3, g] = away / stretch, stretch * (foot - ends[:, :1]), stretch * (ends[:, 1:] - foot)
            places[3, g], sizes[:, g] = turn + np.arctan(slope), (0.5 * width, depth)
        more = np.empty((rows, len(chosen)))
        crossing_heights(places, np.ascontiguousarray(self.charts[3:, :, chosen]), *sizes, tip, more)
        bins, first = np.unique(self.bin[chosen], return_index=True)
        out[:, bins] = self.share * np.add.reduceat(more, first, axis=1)
        return out

    def _beside_two(self, taken: Sequence[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]) -> IntArray:
        """Numbers of the places that for any row lie in two grooves, or as near as half of the widest mouth."""
        far, near = 0.5 * max(width.max() for _, _, width, _ in taken), np.zeros(len(self.bin), dtype=np.int64)
        for g, (courses, _, width, _) in enumerate(taken):
            basis, slopes = self.modes[g]
            spread = np.abs(courses - courses[0]).max(axis=0)
            away = np.abs(self.charts[1, g] - courses[0] @ basis) - spread @ np.abs(basis)
            slope = np.abs(courses[0] @ slopes) + spread @ np.abs(slopes)
            near += away < (0.5 * width.max() + far) * np.sqrt(1.0 + slope**2)
        return np.flatnonzero(near > 1)
