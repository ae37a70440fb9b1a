"""Posterior density: shape, window, noise and neighbours joined to one; priors that several kinds share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping import EmptyWindowError, Feature, FloatArray
from mapping.geometry.mesh import arclengths, nearest_on
from mapping.geometry.templates import contact_half_width
from mapping.inference.curves import Chart, CurveModes, chart_along
from mapping.inference.families import GrooveShape, PosteriorProblem, Sizes, StepShape, Surroundings
from mapping.inference.kinds.kind import feature_trace, kind_of, rise_of, sizes_of, uphill
from mapping.inference.likelihood import Beside, Prior, Shape, StudentT, Uniform, Window
from mapping.instrument import FEATURE_RESIDUAL_SDS

# Prior of log radius: a ball lying on the base (a = H/2) unless the data say otherwise, with heavy tails.
RADIUS_SCALE = 1.0
# Legs in which the course of a groove is followed that crosses another
LEGS_OF_OTHERS = 64


def pose(
    feature: Feature, sizes: Sizes, shape: Shape, window: Window, around: Surroundings, beginnings: FloatArray
) -> PosteriorProblem:
    """Join a shape, its window and the noise to a posterior density beside the feature's neighbours."""
    beside = None
    near = [other for other in around.others if other is not feature]
    if near:
        tip = around.trace.tip_radius
        traces = [feature_trace(other, window.feet, window.normals, tip) for other in near]
        beside = felt_beside(feature, near, traces, window.feet, shape if isinstance(shape, StepShape) else None)
        if isinstance(shape, StepShape) or type(shape) is GrooveShape:
            laid = [_laid(other, window, around) for other in near if _is_upright(other)]
            grooves = tuple(each for each in laid if each is not None)
            if isinstance(shape, StepShape):
                shape = replace(shape, grooves=grooves)
            else:
                edges = [_edge_beside(feature, sizes, other, window, around) for other in near if kind_of(other).sided]
                shape = replace(shape, crossed=grooves, edges=tuple(each for each in edges if each is not None))
    return PosteriorProblem.posed(feature, sizes, shape, window, around, beginnings, beside, rise_of(near))


def felt_beside(
    feature: Feature,
    near: Sequence[Feature],
    traces: Sequence[FloatArray],
    feet: FloatArray,
    step: StepShape | None = None,
) -> Beside:
    """What features leave together beside another one, from what each leaves alone.

    Of hollows that cross the deeper one is felt. Which side of a step a crest stands on is asked at the place of its
    axis that is nearest.

    Args:
        feature: the one that is asked about.
        near: the others.
        traces: (n,) heights that each of them leaves alone, m.
        feet: (n, 3) where, m.
        step: the family of the one that is asked about, if that is a step.
    """
    nothing = np.zeros(len(feet))
    ground, deepest, crests, apart = nothing, nothing, nothing, np.ones(len(feet), dtype=bool)
    steps = [(other, trace) for other, trace in zip(near, traces, strict=True) if kind_of(other).sided]

    def under(crest: Feature) -> FloatArray:
        if not steps:
            return nothing
        on = nearest_on(feet, crest.axis)[0]
        return np.asarray(sum(np.where(uphill(other, on) > 0.0, trace, 0.0) for other, trace in steps))

    for other, trace in zip(near, traces, strict=True):
        if kind_of(other).sided:
            ground = ground + trace
            apart &= (trace == 0.0) | (trace == abs(other.height.median))
            continue
        apart &= trace == 0.0
        deepest = np.minimum(deepest, trace)
        raised = np.where(trace > 0.0, trace + under(other), 0.0)
        if step is not None:  # what stands on its high side goes up with it
            carried = step.high_side * step.chart.coordinates(nearest_on(feet, other.axis)[0])[1] > 0.0
            ground, raised = ground + np.where(carried, raised, 0.0), np.where(carried, 0.0, raised)
        crests = np.maximum(crests, raised)
    return Beside(ground + deepest, crests, under(feature), kind_of(feature).sign > 0, apart)


def _is_upright(other: Feature) -> bool:
    """True of a groove with upright walls."""
    return other.kind == "groove" and other.details.taper is None and len(other.axis) > 1 and other.height.median < 0.0


def _laid(groove: Feature, window: Window, around: Surroundings) -> tuple[GrooveShape, FloatArray] | None:
    """A groove as it is known over any window, and its parameters (1, P); where the ball hangs it has no bottom. None
    where its axis has no chart: it must not cost the groove that it crosses its posterior."""
    chart, tip = _chart_of(groove, 0.5 * groove.width.median, around), around.trace.tip_radius
    if chart is None:
        return None
    ends = [] if groove.closed else [0.0, float(chart.s[0]), float(chart.s[-1])]
    depth = tip if groove.height.censored else -groove.height.median
    known = np.array([0.0, *ends, np.log(groove.width.median), np.log(depth)])
    return GrooveShape(window, chart, _straight(chart), tip, (), known, np.zeros_like(known)), known[None]


def _edge_beside(
    groove: Feature, sizes: Sizes, step: Feature, window: Window, around: Surroundings
) -> tuple[StepShape, FloatArray, bool] | None:
    """A step beside a groove as it is known over any window, its parameters (1, P), and True if its edge is a rim.

    Where in the mouth of a groove an edge lies nothing tells, nor on a ledge beyond its lower rim as long as the ball
    that has sunk by d touches the edge, H higher, instead of that rim: then the edge is no farther off than the
    half-chord of d + H. None where its axis has no chart, or it is not known which side of it is high.
    """
    tip, height = around.trace.tip_radius, abs(step.height.median)
    chart = _chart_of(step, sizes_of(step, tip).half_width, around)
    if chart is None or not step.details.high_side:
        return None
    low, high = (float(contact_half_width(min(sizes.height + up, tip), 0.0, tip)) for up in (0.0, height))
    doubt = FEATURE_RESIDUAL_SDS * float(np.hypot(sizes.position_sd, step.position_sd))
    is_rim = -high - doubt < float(np.median(uphill(step, groove.axis))) < low
    known, side = np.array([0.0, height]), float(np.sign(step.details.high_side))
    edge = StepShape(window, chart, _straight(chart), tip, side, (), known, np.zeros_like(known))
    return edge, known[None], is_rim


def _chart_of(line: Feature, reach: float, around: Surroundings) -> Chart | None:
    """A chart along a line as it is known; None where there is none."""
    if len(line.axis) < 2:
        return None
    spacing = float(arclengths(line.axis)[-1]) / LEGS_OF_OTHERS
    tip = around.trace.tip_radius
    try:
        return chart_along(line.axis, line.normals, around.base, tip, spacing, 0.0, reach, bends=False)
    except EmptyWindowError:
        return None


def _straight(chart: Chart) -> CurveModes:
    return CurveModes(0, 0.5 * chart.length, 0.5 * chart.length, chart.closed)


def place_prior(sizes: Sizes) -> Prior:
    """Anywhere within 1.5 half widths of where it was detected."""
    return Uniform(-1.5 * sizes.half_width, 1.5 * sizes.half_width)


def height_prior(sizes: Sizes) -> Prior:
    """Equally probable from nothing to several times what was detected."""
    return Uniform(0.0, max(4.0 * sizes.height, sizes.height + 10.0 * sizes.height_sd))


def radius_prior(sizes: Sizes, tip: float) -> Prior:
    """Log radius: about a round wire or ball lying on the base, a = H/2.

    Under a much larger tip only radius + tip counts, and the data hardly determine the radius: the prior does, within
    a factor of e or so. Its tails are heavy: a gentle cap of a thousand times that radius is found where the trace
    shows it.
    """
    guess = float(np.log(0.5 * sizes.height))
    return StudentT(guess, RADIUS_SCALE, 4.0, guess - 7.0, float(np.log(1e4 * max(tip, sizes.height, sizes.radius))))


def hollow_priors(sizes: Sizes, tip: float) -> tuple[Prior, Prior]:
    """Log width and log depth of a groove or pit; the ball does not feel the bottom of a deep one."""
    width = np.log(2.0 * sizes.radius)
    depth = np.log(sizes.height)
    return Uniform(width - 2.0, width + 2.0), Uniform(depth - 1.5, float(max(np.log(tip), depth + 2.0)))
