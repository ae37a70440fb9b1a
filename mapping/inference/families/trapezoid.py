"""TrapezoidShape, ShoulderedShape: lines with a flat top, from a bar to a roof, or with round edges; FrustumShape,
RoundedFrustumShape: spots with such a section, from a disc to a cone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapping import FloatArray
from mapping.geometry.templates import contact_half_width, flat_outline, shouldered_outline, width_of_cap
from mapping.inference.curves import Chart, CurveModes, Mouth, laid_beyond, mouths_of, opened
from mapping.inference.families.bump import BumpShape, Spot
from mapping.inference.families.nodes import line_nodes, point_nodes
from mapping.inference.families.problem import Sizes
from mapping.inference.families.ridge import RidgeShape, rounding_of
from mapping.inference.likelihood import Prior, Uniform, Window

# Tops and flanks from this share of the disturbance's half-width to that one, all equally probable in their logarithm:
# under a hundredth of it neither can be felt (an arc drops by 5e-5 of the height there), and wider ones than four times
# as wide as the disturbance are no fine feature
NARROWEST_PART, WIDEST_PART = 0.01, 4.0


class FlatTopped:
    """Sections with straight flanks, a flat top or none (a roof), which the last parameters of a family describe."""

    roof: bool
    tip_radius: float

    def parts(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(W,) heights, widths of the top, and runs of a flank, m."""
        if self.roof:
            return theta[:, -2], np.zeros(len(theta)), np.exp(theta[:, -1])
        return theta[:, -3], np.exp(theta[:, -2]), np.exp(theta[:, -1])


@dataclass(frozen=True, eq=False)
class TrapezoidShape(FlatTopped):
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


@dataclass(frozen=True, eq=False)
class FrustumShape(FlatTopped):
    """Bumps with a flat round top: position, height, log width of the top, log run of the flank all round.

    A trapezoid turned about its middle, from a disc with upright walls (a run of nothing) to a cone, which has no top.
    `free` is 1 for a lone profile: the bump is then taken to lie under it, so that a line that the profile crosses at a
    right angle leaves the same trace.

    Reference: theory equation 7.3: of a section that goes round, only the distance from its outline counts.
    """

    window: Window
    spot: Spot
    tip_radius: float
    free: int
    roof: bool
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        return (*("along", "across")[: self.free], "height", *(() if self.roof else ("log top",)), "log run")

    @property
    def units(self) -> tuple[str, ...]:
        return (*("m", "m")[: self.free], "m", *(() if self.roof else ("ln m",)), "ln m")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        height, top, run = self.parts(theta)
        corners = 0.5 * top[:, None] + np.multiply.outer(run, [0.0, 1.0])
        return self._turned(theta, top, corners, np.multiply.outer(height, [1.0, 0.0]), np.zeros(len(theta)))

    def _turned(
        self, theta: FloatArray, top: FloatArray, across: FloatArray, up: FloatArray, shoulders: FloatArray
    ) -> FloatArray:
        """Heights of a section that is turned about its middle: a line as long as its top, whose corners are round."""
        from mapping.geometry.templates import section_heights

        place = np.zeros((len(theta), 2))
        place[:, : self.free] = theta[:, : self.free]
        half, out = 0.5 * top, np.empty((len(theta), len(self.window)))
        ends = np.column_stack([place[:, 0] - half, place[:, 0] + half])
        section_heights(*self._places, place[:, 1:].copy(), ends, half, across, up, shoulders, self.tip_radius, out)
        return out

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        along, across = point_nodes(self.window, self.spot, self.tip_radius)
        aside = np.stack([np.ones_like(across), np.zeros_like(across)])[:, None]
        bend_along, bend = (np.full_like(along, each) for each in self.spot.bends)
        return along, across, aside, bend, bend_along


@dataclass(frozen=True, eq=False)
class RoundedFrustumShape(FrustumShape):
    """Bumps with a flat round top whose edge is round: as `FrustumShape`, with that log radius for the run."""

    @property
    def names(self) -> tuple[str, ...]:
        return (*super().names[:-1], "log shoulder")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        height, top, shoulder = self.parts(theta)
        return self._turned(theta, top, 0.5 * top[:, None], height[:, None].copy(), shoulder)


def trapezoid_beside(ridge: RidgeShape, sizes: Sizes, *, roof: bool) -> TrapezoidShape:
    """The family on a ridge's window, with its course, its ends and its height, and their priors."""
    course = ridge.modes.count
    # of the ridge's parameters all but the radius, and the rounding of its ends where no top has corners
    skipped = int(roof and not ridge.chart.closed)
    shared = [*range(course), *range(course + skipped, len(ridge.names) - 1)]
    parts = 1 if roof else 2
    priors = (*(ridge.priors[k] for k in shared), *(_any_part(sizes),) * parts)
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


def frustum_beside(cap: BumpShape, sizes: Sizes, *, roof: bool) -> FrustumShape:
    """The family on a cap's window, about its spot, with its height, and their priors."""
    parts = 1 if roof else 2
    return FrustumShape(cap.window, cap.spot, cap.tip_radius, cap.free, roof, *_section_beside(cap, sizes, parts))


def rounded_frustum_beside(cap: BumpShape, sizes: Sizes) -> RoundedFrustumShape:
    """The same with a round edge."""
    priors, start, step = _section_beside(cap, sizes, 2)
    priors = (*priors[:-1], cap.priors[-1])  # of a top of nothing its edge is the cap
    return RoundedFrustumShape(cap.window, cap.spot, cap.tip_radius, cap.free, False, priors, start, step)


def _section_beside(cap: BumpShape, sizes: Sizes, parts: int) -> tuple[tuple[Prior, ...], FloatArray, FloatArray]:
    """Priors, start and step: of a cap all but the radius, and so many parts of a flat-topped section."""
    start = np.append(cap.start[:-1], np.full(parts, np.log(0.2 * sizes.half_width)))
    return (*cap.priors[:-1], *(_any_part(sizes),) * parts), start, np.append(cap.step[:-1], [0.05, 0.1][-parts:])


def _any_part(sizes: Sizes) -> Prior:
    """Of the width of a top, or the run of a flank."""
    return Uniform(*np.log(sizes.half_width * np.array([NARROWEST_PART, WIDEST_PART])))


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


def flat_topped_widths(
    shape: FlatTopped, draws: FloatArray, *, half_way: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Those of draws (S, P) of a family."""
    widths = shouldered_widths if isinstance(shape, ShoulderedShape | RoundedFrustumShape) else touched_widths
    return widths(*shape.parts(draws), shape.tip_radius, half_way=half_way)


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
