"""The posteriors of features along a curve of the base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import CourseError, EmptyWindowError, Feature, FloatArray
from mapping.inference.curves import (
    HIGHEST_DEGREE,
    Chart,
    CurveModes,
    chart_along,
    normals_along,
    smooth_axis,
    smooth_on_base,
    up_to_edges,
)
from mapping.inference.families import (
    MEETING_REACH,
    LineShape,
    PosteriorProblem,
    Sizes,
    Surroundings,
    tells_of_line,
    touches,
    window_for,
)
from mapping.inference.kinds.kind import Kind, sizes_of
from mapping.inference.kinds.posterior_density import pose
from mapping.inference.likelihood import Normal, Prior, Uniform, Window
from mapping.inference.sampler import find_optima

# Chords of the chart may sag by this share of the feature's height.
SAG = 0.005
MOST_LEGS = 300
# An end may lie so many half-widths beyond an edge of the body, where all places say the same: the line is open there.
# One that was felt to go on to as near to an edge as the ball feels it is open as likely as not
OPEN = 1.0
# After so many degrees in a row that are no better than a lower one, no higher one is tried.
FUTILE_DEGREES = 2


@dataclass(frozen=True, eq=False)
class Parameters:
    """Some parameters of a shape: priors, first guess, and small but visible changes."""

    priors: tuple[Prior, ...] = ()
    start: tuple[float, ...] = ()
    step: tuple[float, ...] = ()

    def __add__(self, other: Parameters) -> Parameters:
        return Parameters(self.priors + other.priors, self.start + other.start, self.step + other.step)

    @property
    def arrays(self) -> tuple[tuple[Prior, ...], FloatArray, FloatArray]:
        """Priors, start (P,) and step (P,), as a shape takes them."""
        return self.priors, np.array(self.start), np.array(self.step)


# Of both ends alike, from square to round: a line is mostly made by one tool
ROUNDING_OF_ENDS = Parameters((Uniform(0.0, 1.0),), (0.5,), (0.2,))
# Its values in the middle of those that are square and of those that are round: no descent leads from one to the other
SQUARE_OR_ROUND = (1.0 / 6.0, 5.0 / 6.0)


@dataclass(frozen=True, eq=False)
class Traced:
    """What a line's shape is made from.

    Args:
        window: the bins.
        chart: the reference curve on the base.
        modes: lateral course of the axis over the chart.
        sizes: preliminary ones.
        tip_radius: m.
        laterals: the parameters of the course.
        ends: the places of the two ends along the chart; none of a closed line, or of a kind without ends.
    """

    window: Window
    chart: Chart
    modes: CurveModes
    sizes: Sizes
    tip_radius: float
    laterals: Parameters
    ends: Parameters


class LineKind(Kind):
    """A kind along a curve: it gives the shape, and what the first guess of its last parameter may be instead."""

    @property
    def sampled(self) -> bool:
        return True

    def shape(self, traced: Traced) -> LineShape:
        """The family of shapes along a chart; those that have ends name them "start" and "end", beside each other."""
        raise NotImplementedError(f"{type(self).__name__} gives no shape")

    def other_starts(self, sizes: Sizes) -> tuple[float, ...]:
        """Further values of the last parameter, from which the search for the optimum begins as well."""
        return ()

    def problem(self, feature: Feature, around: Surroundings) -> PosteriorProblem:
        """Pose the posterior.

        The trace decides how freely the axis bends over the base (BIC): few crossings cannot tell a gentle bend from
        their own scatter, and one that a neighbour displaced fits bends that are not there. A bend that does not pay
        for itself is not none, though, and a course without it is stated too surely where it lies: the next bend is a
        parameter as well, as large as may have been overlooked.
        """
        tip = around.trace.tip_radius
        sizes = sizes_of(feature, tip)
        axis, normals, crossings = _axis_of(feature, sizes, around)
        axis, normals = _on_one_face(axis, normals, around)
        course = self._chart(axis, normals, sizes, crossings, HIGHEST_DEGREE, around, bends=False)
        rises = (0.0, sizes.height, -sizes.height) if self.sided else (0.0,)
        window = window_for(*_crest(course, tip, sizes, rises), sizes, around)
        if not self.has_ends and not course.closed:
            window = window.only(tells_of_line(axis, normals, window.feet, window.run, sizes.half_width))
        laid = replace(feature, axis=axis, normals=normals, evidence=replace(feature.evidence, crossings=crossings))
        beside = replace(around, others=[other for other in around.others if other is not feature])

        def posed(most: int, least: int = 1, *, overlooked: bool = False) -> tuple[PosteriorProblem, int]:
            shape, degree = self.shape_on(window, laid, beside, most, least, overlooked=overlooked)
            return pose(feature, sizes, shape, window, around, self._beginnings(shape, sizes)), degree

        best, asked = first = posed(HIGHEST_DEGREE)
        if len(axis) < 3:
            return best
        bends, least, costs = (HIGHEST_DEGREE, 1), _cost(best), list[float]()
        for degree in range(1, HIGHEST_DEGREE + 1):
            other, reached = first if degree == asked else posed(degree, degree)
            if reached < degree:
                break
            costs.append(least if other is best else _cost(other))
            if costs[-1] < least:
                bends, best, least = (degree, degree), other, costs[-1]
            if len(costs) > FUTILE_DEGREES and min(costs[-FUTILE_DEGREES:]) >= min(costs[:-FUTILE_DEGREES]):
                break
        return posed(*bends, overlooked=True)[0]

    def shape_on(
        self,
        window: Window,
        feature: Feature,
        around: Surroundings,
        most: int = HIGHEST_DEGREE,
        least: int = 1,
        *,
        overlooked: bool = False,
    ) -> tuple[LineShape, int]:
        """The family about a feature's axis of two points or more, over any window, and the degree of its course.

        Args:
            window: the bins; they need not be those near this feature alone.
            feature: of this kind.
            around: base, tip, and the neighbours that its ends may meet.
            most, least: degrees that its course may have.
            overlooked: True if an open course has one bend more, of a size that its degree leaves out.
        """
        (axis, normals), crossings = _on_one_face(feature.axis, feature.normals, around), feature.evidence.crossings
        tip, sizes = around.trace.tip_radius, sizes_of(feature, around.trace.tip_radius)
        if window.flat:  # nothing to unroll, and nothing bends
            line, degree = smooth_axis(axis, sizes.position_sd, most, least)
        else:
            line, degree = smooth_on_base(
                axis, normals, sizes.position_sd, most, least, around.base, tip, sizes.half_width
            )
        lift = normals_along(line, axis, normals)
        spare = int(overlooked)
        chart = self._chart(line, lift, sizes, crossings, degree + spare, around, bends=not window.flat)
        ends = chart.coordinates(axis[[0, -1]])[0]
        modes = _modes(chart, ends, degree, spare, crossings, sizes)
        laterals, along = _laterals(modes, degree, len(window), crossings, sizes), Parameters()
        if self.has_ends and not chart.closed:
            along = _ends(ends, _end_limits(axis, chart, ends, feature, sizes, around), chart, sizes)
        return self.shape(Traced(window, chart, modes, sizes, tip, laterals, along)), degree

    def _chart(
        self,
        line: FloatArray,
        lift: FloatArray,
        sizes: Sizes,
        crossings: int,
        degree: int,
        around: Surroundings,
        *,
        bends: bool,
    ) -> Chart:
        """The chart along the line, extended to where the ends may be, its legs as long as its curvature allows."""
        length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
        extension = max(6.0 * sizes.half_width, 1.5 * length / max(crossings - 1, 1)) if self.has_ends else 0.0
        tip = around.trace.tip_radius

        def build(spacing: float, bends: bool) -> Chart:
            return chart_along(line, lift, around.base, tip, spacing, extension, sizes.half_width, bends=bends)

        trial = build((length + 2.0 * extension) / 64.0, False)
        if trial.length < length / MOST_LEGS:  # a course that the data do not hold runs far off the base
            raise CourseError("less than a leg of its axis lies over the base")
        turn = np.linalg.norm(np.diff(trial.tangents, axis=0), axis=1).max(initial=0.0)
        curvature = turn / (trial.length / max(len(trial.s) - 1, 1))
        if curvature * trial.length < 1e-6 and degree == 1:
            return build(length + extension, bends)
        spacing = float(np.sqrt(8.0 * SAG * sizes.height / max(curvature, 1e-12)))
        return build(min(max(spacing, trial.length / MOST_LEGS), trial.length / 16.0), bends)

    def _beginnings(self, shape: LineShape, sizes: Sizes) -> FloatArray:
        """Starts that differ in the section, and in the ends."""
        starts = [shape.start]
        for value in self.other_starts(sizes):
            section = shape.start.copy()
            section[-1] = value
            starts.append(section)
        if self.has_ends and not shape.chart.closed:
            first = shape.names.index("start")
            for out in (-0.5, 0.5, 1.0):
                moved = shape.start.copy()
                moved[first : first + 2] += out * sizes.half_width * np.array([-1.0, 1.0])
                starts.append(moved)
        return np.concatenate([starts, *(ended(np.array(starts[:1]), shape.names, turn) for turn in SQUARE_OR_ROUND)])


def ended(starts: FloatArray, names: Sequence[str], turn: float) -> FloatArray:
    """(M, P) starts with another rounding of the ends; none where the shape's ends have no rounding."""
    if "end rounding" not in names:
        return starts[:0]
    starts = starts.copy()
    starts[:, names.index("end rounding")] = turn
    return starts


def _cost(problem: PosteriorProblem) -> float:
    """Half the Bayesian information criterion (Schwarz, Annals of Statistics 6, 1978) at the detection's optimum."""
    best = find_optima(problem.target, problem.beginnings[:1])[0]
    fit = float(problem.target.likelihood.log_density(problem.target.templates(best[None]))[0])
    return 0.5 * len(best) * float(np.log(len(problem.window))) - fit


def _axis_of(feature: Feature, sizes: Sizes, around: Surroundings) -> tuple[FloatArray, FloatArray, int]:
    """Axis, normals and number of crossings; a single crossing gets a short axis across its sweep."""
    axis, normals = np.asarray(feature.axis), np.asarray(feature.normals)
    if len(axis) > 1 and np.ptp(axis, axis=0).max() > 0.0:
        return axis, normals, max(feature.evidence.crossings, 2 if len(axis) == 2 else len(axis))
    window = window_for(axis[:1] + around.trace.tip_radius * normals[:1], normals[:1], sizes, around)
    nearest = int(np.argmin(np.linalg.norm(window.feet - axis[0], axis=1)))
    across = np.cross(normals[0], window.tangents[nearest])
    if not across.any():
        raise EmptyWindowError(f"a single sample lies near the {feature.kind}: it tells no direction of the sweep")
    half = 0.5 * sizes.half_width * across / max(float(np.linalg.norm(across)), np.finfo(float).tiny)
    return np.stack([axis[0] - half, axis[0] + half]), np.repeat(normals[:1], 2, axis=0), 1


def _on_one_face(axis: FloatArray, normals: FloatArray, around: Surroundings) -> tuple[FloatArray, FloatArray]:
    """A detected axis without what was felt of it over an edge of the body: the feet of all balls that roll over that
    lie on it, wherever beside the line they are."""
    if np.array_equal(axis[0], axis[-1]):
        return axis, normals
    kept = up_to_edges(axis, normals, around.base, around.trace.tip_radius)
    return kept.line, kept.lift


def _modes(chart: Chart, ends: FloatArray, degree: int, spare: int, crossings: int, sizes: Sizes) -> CurveModes:
    if chart.closed:
        # Offsets of a ring whose coordinates have a degree have harmonics one higher: an ellipse differs from a
        # circle by the second.
        highest = max(0, min(degree + 1, (crossings - 1) // 2, HIGHEST_DEGREE))
        return CurveModes(highest, 0.5 * chart.length, 0.5 * chart.length, True)
    reach = max(0.5 * abs(float(ends[1] - ends[0])), 0.5 * sizes.half_width)
    highest = min(max(degree, 1) + spare, max(crossings - 1, 1), HIGHEST_DEGREE)
    return CurveModes(highest, float(ends.mean()), reach, False)


def _crest(chart: Chart, tip_radius: float, sizes: Sizes, rises: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
    """Points along the chart one tip radius above the base, close enough together to measure distances from, and its
    normals there.

    They stand that far above the base and, of an edge between two levels, above where the other may be: rises, m.
    """
    count = max(2, int(np.ceil(chart.length / (0.25 * sizes.half_width))) + 1)
    points, _, normals, _ = chart.at(np.linspace(chart.s[0], chart.s[-1], count))
    return np.concatenate([points + (tip_radius + rise) * normals for rise in rises]), np.tile(normals, (len(rises), 1))


def _end_limits(
    axis: FloatArray, chart: Chart, ends: FloatArray, feature: Feature, sizes: Sizes, around: Surroundings
) -> list[tuple[float, float]]:
    """Places between which the beginning and the end of an open line lie, m along the chart.

    One that lies beyond an edge of the body is open there.
    """
    low, high = float(chart.s[0]), float(chart.s[-1])
    middle = min(max(float(ends.mean()), low + 1e-3 * (high - low)), high - 1e-3 * (high - low))
    limits = []
    for k, (least, most) in zip(np.argsort(ends), ((low, middle), (middle, high)), strict=True):
        tip = axis[[0, -1][k]]
        if any(touches(tip, other, sizes.half_width) for other in around.others if other is not feature):
            reach = MEETING_REACH * sizes.half_width
            at = float(np.clip(ends[k], least + 0.1 * reach, most - 0.1 * reach))
            least, most = max(least, at - reach), min(most, at + reach)
        beyond = OPEN * sizes.half_width
        if chart.walls[0] is not None and least == low:
            least -= beyond
        if chart.walls[1] is not None and most == high:
            most += beyond
        limits.append((least, most))
    return limits


def _ends(places: FloatArray, limits: list[tuple[float, float]], chart: Chart, sizes: Sizes) -> Parameters:
    """Parameters of the two ends: where they were detected (2,), anywhere within their limits, m along the chart.

    One that was detected within a half-width of an edge of the body begins as open.
    """
    (lowest, _), (_, highest) = limits
    first, last = float(places.min()), float(places.max())
    if chart.walls[0] is not None and first < chart.s[0] + sizes.half_width:
        first = 0.5 * (lowest + min(float(chart.s[0]), first))
    if chart.walls[1] is not None and last > chart.s[-1] - sizes.half_width:
        last = 0.5 * (highest + max(float(chart.s[-1]), last))
    return Parameters(
        tuple(Uniform(*limit) for limit in limits),
        (first, last),
        (0.1 * sizes.half_width,) * 2,
    )


def _laterals(modes: CurveModes, degree: int, bins: int, crossings: int, sizes: Sizes) -> Parameters:
    """Parameters of the course: within 1.5 half widths of where it was detected; the heading of a single crossing may
    be anything to 60 degrees.

    The bend beyond the degree that was chosen is one that the criterion leaves out: with a standard deviation sd it may
    be anything to sqrt(ln n) sd, n bins, which a normal law of that over sqrt(3) stands for. For c crossings side by
    side (2 k + 1) / c of a crossing's variance are that of Legendre's coefficient k.
    """
    bound = 1.5 * sizes.half_width
    priors: list[Prior] = []
    for k, name in enumerate(modes.names):
        if name == "offset":
            priors.append(Uniform(-bound, bound))
        elif name == "heading":
            limit = 1.7 if crossings < 2 else max(2.0 * bound / modes.reach, 0.1)
            priors.append(Uniform(-limit, limit))
        elif not modes.closed and k > max(degree, 1):
            sd = sizes.position_sd * np.sqrt((2 * k + 1) / crossings * np.log(bins) / 3.0)
            priors.append(Normal(0.0, min(float(sd), 0.5 * sizes.half_width)))
        else:
            priors.append(Normal(0.0, 0.5 * sizes.half_width))
    step = tuple(float(each) for each in 0.02 * sizes.half_width * modes.scale)
    return Parameters(tuple(priors), (0.0,) * modes.count, step)
