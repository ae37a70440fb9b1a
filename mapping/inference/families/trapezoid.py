"""TrapezoidShape, ShoulderedShape: lines with a flat top, from a bar to a roof, or with round edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapping import FloatArray
from mapping.geometry.templates import contact_half_width, flat_outline, shouldered_outline, width_of_cap
from mapping.inference.curves import Chart, CurveModes, Mouth, laid_beyond, mouths_of, opened
from mapping.inference.families.nodes import line_nodes
from mapping.inference.families.problem import Sizes
from mapping.inference.families.ridge import RidgeShape, rounding_of
from mapping.inference.likelihood import Prior, Uniform, Window

# Tops and flanks from this share of the disturbance's half-width to that one, all equally probable in their logarithm:
# under a hundredth of it neither can be felt (an arc drops by 5e-5 of the height there), and wider ones than four times
# as wide as the disturbance are no fine feature
NARROWEST_PART, WIDEST_PART = 0.01, 4.0


@dataclass(frozen=True, eq=False)
class TrapezoidShape:
    """Lines with a flat top: lateral modes, rounding and places of the ends, height, log width of the top, log run of
    each flank.

    An end is where the top ends: in plan its corners are square (rounding 0), or both are one half circle (1), and the
    flanks go round it. Which of them it is moves the end by a share of the width, so what is not known of it is
    marginalised. A run of nothing is a bar with upright walls; a roof has no top, and no parameters for it and its
    corners. A flank that is steeper than the ball's own flank at the kink is never touched: all such runs leave one
    trace.
    """

    window: Window
    chart: Chart
    modes: CurveModes
    tip_radius: float
    roof: bool
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("start", "end") if self.roof else ("end rounding", "start", "end")
        return (*self.modes.names, *ends, "height", *(() if self.roof else ("log top",)), "log run")

    @property
    def units(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("m", "m") if self.roof else ("", "m", "m")
        return (*self.modes.units, *ends, "m", *(() if self.roof else ("ln m",)), "ln m")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        from mapping.geometry.templates import section_heights

        ends, rounded = np.tile([-1e300, 1e300], (len(theta), 1)), np.zeros(len(theta))
        if "start" in self.names:
            first = self.names.index("start")
            ends = opened(self.chart, self.modes, theta[:, : self.modes.count], theta[:, first : first + 2])
        courses = np.ascontiguousarray(theta[:, : self.modes.count])
        height, top, run = self.parts(theta)
        up, half = np.column_stack([height, np.zeros(len(theta))]), 0.5 * top
        if "end rounding" in self.names:
            rounded = half * rounding_of(theta[:, self.modes.count])
        out = np.empty((len(theta), len(self.window)))
        corners = np.column_stack([half, half + run])
        section_heights(*self._places, courses, ends, rounded, corners, up, np.zeros_like(half), self.tip_radius, out)
        laid_beyond(self.mouths, out, theta, self.names, self.tip_radius, lambda _: flat_outline(height, half, run))
        return out

    @cached_property
    def mouths(self) -> tuple[Mouth, ...]:
        """Where edges of the body cut it off."""
        return mouths_of(self.window, self.chart, self.modes, self.tip_radius)

    def parts(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(W,) heights, widths of the top, and runs of a flank, m."""
        if self.roof:
            return theta[:, -2], np.zeros(len(theta)), np.exp(theta[:, -1])
        return theta[:, -3], np.exp(theta[:, -2]), np.exp(theta[:, -1])

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        return line_nodes(self.window, self.chart, self.modes, self.tip_radius)


@dataclass(frozen=True, eq=False)
class ShoulderedShape(TrapezoidShape):
    """Lines with a flat top whose edges are round: as `TrapezoidShape`, with the log radius of the edges for the run.

    From a bar, whose edges are sharp, to a cap with a flattened crest. What is below the edges, upright, slanting, or a
    fillet at the foot, is not touched by a ball that leaves the edge above it.
    """

    @property
    def names(self) -> tuple[str, ...]:
        return (*super().names[:-1], "log shoulder")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        from mapping.geometry.templates import section_heights

        ends, rounded = np.tile([-1e300, 1e300], (len(theta), 1)), np.zeros(len(theta))
        height, top, shoulder = self.parts(theta)
        if not self.chart.closed:
            first = self.modes.count
            ends = opened(self.chart, self.modes, theta[:, :first], theta[:, first + 1 : first + 3])
            rounded = 0.5 * top * rounding_of(theta[:, first])
        courses = np.ascontiguousarray(theta[:, : self.modes.count])
        out = np.empty((len(theta), len(self.window)))
        edge, up = 0.5 * top[:, None], np.ascontiguousarray(height[:, None])
        section_heights(*self._places, courses, ends, rounded, edge, up, shoulder, self.tip_radius, out)
        outline = shouldered_outline(height, 0.5 * top, shoulder)
        laid_beyond(self.mouths, out, theta, self.names, self.tip_radius, lambda _: outline)
        return out


def trapezoid_beside(ridge: RidgeShape, sizes: Sizes, *, roof: bool) -> TrapezoidShape:
    """The family on a ridge's window, with its course, its ends and its height, and their priors."""
    course = ridge.modes.count
    # of the ridge's parameters all but the radius, and the rounding of its ends where no top has corners
    skipped = int(roof and not ridge.chart.closed)
    shared = [*range(course), *range(course + skipped, len(ridge.names) - 1)]
    wide = Uniform(*np.log(sizes.half_width * np.array([NARROWEST_PART, WIDEST_PART])))
    parts = 1 if roof else 2
    priors = (*(ridge.priors[k] for k in shared), *(wide,) * parts)
    guess = np.full(parts, np.log(0.2 * sizes.half_width))
    start = np.concatenate([ridge.start[shared], guess])
    step = np.concatenate([ridge.step[shared], [0.05, 0.1][-parts:]])
    return TrapezoidShape(ridge.window, ridge.chart, ridge.modes, ridge.tip_radius, roof, priors, start, step)


def shouldered_beside(ridge: RidgeShape, sizes: Sizes) -> ShoulderedShape:
    """The same with round edges."""
    bar = trapezoid_beside(ridge, sizes, roof=False)
    return ShoulderedShape(
        ridge.window, ridge.chart, ridge.modes, ridge.tip_radius, False, bar.priors, bar.start, bar.step
    )


def touched_widths(
    height: FloatArray, top: FloatArray, run: FloatArray, tip: float, *, half_way: bool = False
) -> tuple[FloatArray, FloatArray]:
    """(W,) widths of trapezoids that the ball touches, and within which alone there may be more of them, m.

    The second reaches from where the ball leaves the base on the one side to where it does on the other. Where the
    flanks are so gentle that the ball rolls down on them, both are the width of the foot that they lead to, or that at
    half of the height.
    """
    foot = top + (1.0 if half_way else 2.0) * run
    # the ball that rests on base and edge stands kink = x_c beside the edge, and falls there by x_c to each r - H
    kink = np.sqrt(np.clip(height * (2.0 * tip - height), 0.0, None))
    hidden = height * np.clip(tip - height, 0.0, None) > run * kink
    hidden |= height >= tip
    return np.where(hidden, top, foot), np.where(hidden, top + 2.0 * kink, foot)


def shouldered_widths(
    height: FloatArray, top: FloatArray, shoulder: FloatArray, tip: float, *, half_way: bool = False
) -> tuple[FloatArray, FloatArray]:
    """The same of flat tops with round edges: where the ball that leaves an edge rests on it, and on the base."""
    kink = contact_half_width(height, shoulder, tip)
    touched, bridged = 2.0 * kink * shoulder / (shoulder + tip), 2.0 * kink
    if half_way:  # of a low cap the ball touches more than that
        width = width_of_cap(0.5 * height, shoulder)
        inside = (width <= touched) & (0.5 * height < shoulder)
        touched, bridged = np.where(inside, width, touched), np.where(inside, width, bridged)
    return top + touched, top + bridged
