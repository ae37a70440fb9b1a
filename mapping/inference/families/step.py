"""StepShape: an upright or slanted step along a curve on the base; and a groove along its edge."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from mapping import FloatArray
from mapping.inference.curves import Chart, CurveModes
from mapping.inference.families.nodes import LineShape, line_nodes
from mapping.inference.families.problem import Sizes
from mapping.inference.likelihood import Prior, Uniform, Window

# Climbs from this share of the disturbance's half-width to that one, all equally probable in their logarithm: as the
# parts of a flat-topped section (`trapezoid`)
NARROWEST_PART, WIDEST_PART = 0.01, 4.0
# Runs of a climb, from the least to the most that its prior allows, at each of which the search for the optimum begins,
# and how far beside the upright step's place its middle is tried, in runs: that lies between foot and upper edge
BEGUN_RUNS, BEGUN_ASIDE = 6, np.linspace(-0.5, 0.5, 5)


class Upright(LineShape, Protocol):
    """What a step must know of a groove with upright walls that runs along its edge: see `GrooveShape`."""

    @property
    def window(self) -> Window: ...

    @property
    def places(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]: ...

    def taken(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]: ...


@dataclass(frozen=True, eq=False)
class StepShape:
    """Steps of any height: lateral modes of the edge, and the height; of slanted ones the log run of the climb as well.

    The course of a slanted step is the middle of its climb.

    `high_side` is +1 if the chart's lateral side is the high one, else -1. Whether the base lies low or high does
    not matter: the height of the base under each run is marginalised. `grooves` stay as they are, each with its
    parameters (1, P): what they leave alone is not in the heights, but what running along the edge changes is.
    """

    window: Window
    chart: Chart
    modes: CurveModes
    tip_radius: float
    high_side: float
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray
    grooves: tuple[tuple[Upright, FloatArray], ...] = ()
    slanted: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.modes.names, "height", *(("log run",) if self.slanted else ()))

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.modes.units, "m", *(("ln m",) if self.slanted else ()))

    def parts(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(W,) heights and runs of the climb, squarely across the edge, m."""
        height = np.ascontiguousarray(theta[:, self.modes.count])
        return height, self.climbs(theta) * self._squareness(theta)

    def climbs(self, theta: FloatArray) -> FloatArray:
        """(W,) runs of the climb across the edge, m; of a lone sweep along that, which knows no other."""
        return np.exp(theta[:, -1]) if self.slanted else np.zeros(len(theta))

    def _squareness(self, theta: FloatArray) -> FloatArray | float:
        """What a climb takes across the edge, in shares of the parameter: a lone sweep tells how long its own way up is
        and hardly the edge's heading, and a chain would follow one along the other."""
        if len(self.window.starts) > 2:
            return 1.0
        slope = self.modes.slope(theta[:, : self.modes.count], self.modes.middle)
        return np.asarray(1.0 / np.sqrt(1.0 + slope**2))

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the low side's trace, m."""
        from mapping.geometry.templates import step_heights

        courses, (heights, runs) = np.ascontiguousarray(theta[:, : self.modes.count]), self.parts(theta)
        out = np.empty((len(theta), len(self.window)))
        step_heights(*self._places, courses, heights, runs, self.high_side, self.tip_radius, out)
        for rims, (_, known) in zip(self._offset_rims, self.grooves, strict=True):
            out += rims.heights(np.hstack([np.tile(known, (len(theta), 1)), theta]))
        return out

    @cached_property
    def _offset_rims(self) -> list[OffsetRims]:
        alone = replace(self, grooves=())
        return [OffsetRims(groove, alone) for groove, _ in self.grooves]

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, nodes) lateral distances from the chart, (2, m, n, nodes) modes and slopes, and bends of the base."""
        _, lateral, basis, bend, _ = line_nodes(self.window, self.chart, self.modes, self.tip_radius)
        return lateral, basis, bend


def slanted_beside(upright: StepShape, sizes: Sizes, untouched: float) -> StepShape:
    """Slanted steps on the course of upright ones; all whose flank is never touched are one of these.

    Args:
        upright: the family.
        sizes: preliminary ones.
        untouched: longest run whose flank the ball never touches, m.
    """
    prior = Uniform(*np.log([max(untouched, NARROWEST_PART * sizes.half_width), WIDEST_PART * sizes.half_width]))
    start = np.append(upright.start, 0.5 * (prior.low + prior.high))
    priors = (*upright.priors, prior)
    return replace(upright, priors=priors, start=start, step=np.append(upright.step, 0.1), slanted=True)


def slanted_beginnings(slanted: StepShape, upright: FloatArray, known: float | None = None) -> FloatArray:
    """(runs, BEGUN_ASIDE, P) parameters that the search for a climb begins from, beside those of an upright step (P,).

    Args:
        slanted: the family.
        upright: its course and height.
        known: a run that is told, m; it is the first.
    """
    least, most = slanted.priors[-1].low, slanted.priors[-1].high
    runs = np.linspace(least, most, BEGUN_RUNS + 2)[1:-1]
    if known is not None:
        runs = np.insert(runs, 0, np.clip(np.log(known), least, most))
    begun = np.array([np.tile(np.append(upright, run), (len(BEGUN_ASIDE), 1)) for run in runs])
    begun[..., 0] += BEGUN_ASIDE * np.exp(runs)[:, None]
    begun[..., 0] = np.clip(begun[..., 0], slanted.priors[0].low, slanted.priors[0].high)
    return begun


@dataclass(frozen=True, eq=False)
class OffsetRims:
    """An upright groove along the edge of a step, whose rims stand on two levels, as a gap between panels does.

    Where the edge lies in the mouth, the rim on its high side stands that much higher; where it lies beyond the rim of
    the low side's level, the ball in the groove may touch it. In both cases the ball rests on the highest of the groove
    in the low level and of a step down into the groove, at the high rim or at the edge. Of a groove in the high level,
    and of one that crosses the edge, heights add (theory section 4.4, equation 4.9b).

    Args:
        groove, edge: their families.
        is_rim: True if the edge is a rim of the groove wherever it lies.
    """

    groove: Upright
    edge: StepShape
    is_rim: bool = False

    def heights(self, theta: FloatArray, alone: FloatArray | None = None) -> FloatArray:
        """(W, n) what both leave together more than the sum of what each leaves alone, m.

        Args:
            theta: (W, P) the groove's and the edge's parameters in a row.
            alone: (W, n) what the groove leaves alone, m, if that is known.
        """
        from mapping.geometry.templates import step_heights

        groove, edge = np.split(theta, [len(self.groove.names)], axis=1)
        courses, ends, width, depth = self.groove.taken(groove)
        uphill = np.zeros((len(width), 1)) if self.is_rim else self._uphill(courses, edge)
        aside = uphill.mean(axis=1)
        together = (np.ptp(uphill, axis=1) < width) & (aside > -0.5 * width)
        out = np.zeros((len(groove), len(self.groove.window)))
        if not together.any():
            return out
        moved = courses[together].copy()
        moved[:, 0] += self._side * np.maximum(aside, 0.5 * width)[together]
        deep, height = depth[together, None], self.edge.parts(edge[together])[0]
        wall = np.empty((len(moved), len(self.groove.window)))
        _, lateral, basis, bend, _ = self.groove.places
        upright, tip = np.zeros(len(moved)), self.groove.tip_radius
        step_heights(lateral, basis, bend, moved, height + deep[:, 0], upright, self._side, tip, wall)
        wall -= deep
        alone = _templates(self.groove, groove[together]) if alone is None else alone[together]
        s = self.groove.places[0].mean(axis=1)
        within = (s > ends[together, :1]) & (s < ends[together, 1:])
        added = alone + _templates(self.edge, edge[together])
        out[together] = np.where(within, np.maximum(alone, wall) - added, 0.0)
        return out

    def _uphill(self, courses: FloatArray, edge: FloatArray) -> FloatArray:
        """(W, K) how far uphill of the groove's middle the edge lies at places along it, m."""
        along, s, aside, way = self._places
        of_edge = self.edge.modes.lateral(edge[:, : self.edge.modes.count], along)
        return np.asarray(self._side * (aside + way * of_edge - self.groove.modes.lateral(courses, s)))

    @cached_property
    def _side(self) -> float:
        """+1 if the lateral side of the groove's chart is the step's high one, else -1."""
        return float(self.edge.high_side * np.sign(np.sum(self._places[3])))

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Where places on the edge's chart lie on it, on and beside the groove's chart, m, and which way (+1, -1) the
        edge's lateral side is on that."""
        chart, other = self.edge.chart, self.groove.chart
        s, aside, leg = other.coordinates(chart.points)
        along = (s >= other.s[0]) & (s <= other.s[-1])
        along = along if along.any() else np.ones_like(along)
        way = np.sign(np.einsum("ij,ij->i", chart.laterals, other.laterals[leg]))
        return chart.s[along], s[along], aside[along], way[along]


def _templates(shape: Upright | StepShape, theta: FloatArray) -> FloatArray:
    """(W, n) heights, m; (1, n) where all parameters are the same, as of what is held."""
    return shape.templates(theta[:1] if (theta == theta[0]).all() else theta)
