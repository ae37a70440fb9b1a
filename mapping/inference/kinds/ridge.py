"""Ridge: a line of round section that stands on the base, such as a wire."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapping import Feature, FloatArray
from mapping.geometry.proxy import Part, Swell
from mapping.geometry.templates import width_of_cap
from mapping.inference.families import (
    BellRidgeShape,
    PosteriorProblem,
    RidgeShape,
    Sizes,
    TrapezoidShape,
    bell_ridge_beside,
    bell_widths,
    flat_topped_widths,
    rounding_of,
    shouldered_beside,
    trapezoid_beside,
)
from mapping.inference.kinds.crests import (
    BEGUN_TAPERS,
    FLAT_STARTS,
    ROOF_STARTS,
    SHOULDER_STARTS,
    UPRIGHT_RUN,
    Crest,
    bell_said,
    flat_topped_said,
)
from mapping.inference.kinds.kind import Section
from mapping.inference.kinds.lines import ROUNDING_OF_ENDS, SQUARE_OR_ROUND, LineKind, Parameters, Traced, ended
from mapping.inference.kinds.posterior_density import height_prior, radius_prior
from mapping.inference.likelihood import Shape

# Half widths of a section that runs out, in half-widths of the disturbance, of which the best begins the search for its
# optimum: from the least to the most, and how many
BEGUN_HALVES = (0.02, 2.0, 15)


class Ridge(Crest, LineKind):
    """Capsule chains: course, rounding and places of the ends, height and log radius."""

    def part(self, feature: Feature, exaggeration: float = 1.0) -> Part | None:
        """The chain, the bar, or the swell that the feature's details describe."""
        scale, exponent, height = feature.details.scale, feature.details.exponent, feature.height.median
        if scale is None or exponent is None or not height > 0.0:
            return super().part(feature, exaggeration)
        return Swell(feature.axis, feature.normals, exaggeration * height, exaggeration * scale, exponent)

    def shape(self, traced: Traced) -> RidgeShape:
        sizes, tip = traced.sizes, traced.tip_radius
        rounding = Parameters() if traced.chart.closed else ROUNDING_OF_ENDS
        section = Parameters(
            (height_prior(sizes), radius_prior(sizes, tip)),
            (sizes.height, float(np.log(sizes.radius))),
            (0.02 * sizes.height, 0.1),
        )
        whole = traced.laterals + rounding + traced.ends + section
        return RidgeShape(traced.window, traced.chart, traced.modes, tip, *whole.arrays)

    def other_starts(self, sizes: Sizes) -> tuple[float, ...]:
        return float(np.log(4.0 * sizes.radius)), float(np.log(0.5 * sizes.height))

    def rivals(self, problem: PosteriorProblem, optimum: FloatArray) -> Sequence[PosteriorProblem]:
        """Lines with straight flanks, with a flat top or none, and such whose flanks run out, on the same course."""
        ridge: Any = problem.target.shape
        course, last = ridge.modes.count, len(optimum) - 1
        posed = []
        families = (
            (trapezoid_beside(ridge, problem.sizes, roof=False), FLAT_STARTS),
            (trapezoid_beside(ridge, problem.sizes, roof=True), ROOF_STARTS),
            (shouldered_beside(ridge, problem.sizes), SHOULDER_STARTS),
        )
        for shape, parts in families:
            kept = np.delete(optimum, [course, last] if shape.roof and not ridge.chart.closed else [last])
            begun = np.log(problem.sizes.half_width * np.array(parts))
            beginnings = np.column_stack([np.tile(kept, (len(parts), 1)), begun])
            if (top := problem.feature.details.top) and not shape.roof:  # a round one is no guide to it
                as_detected = np.append(ridge.start[:last], np.log([top, UPRIGHT_RUN * problem.sizes.half_width]))
                beginnings = np.vstack([beginnings, as_detected])
            alike = [ended(beginnings, shape.names, turn) for turn in SQUARE_OR_ROUND]
            beginnings = np.concatenate(alike) if len(alike[0]) else beginnings
            posed.append(replace(problem, target=replace(problem.target, shape=shape), beginnings=beginnings))
        return [*posed, _running_out(problem, optimum)]

    def section(self, feature: Feature, shape: Shape, draws: FloatArray) -> Section:
        """Of a round section; of one with a flat top, what its flanks lead to; of one that runs out, at half height."""
        if isinstance(shape, BellRidgeShape):
            return bell_said(draws)
        if not isinstance(shape, TrapezoidShape):
            return super().section(feature, shape, draws)
        return flat_topped_said(shape, draws)

    def draws_of_height(self, shape: Shape, draws: FloatArray) -> FloatArray:
        if isinstance(shape, BellRidgeShape):
            return draws[:, -3]
        return shape.parts(draws)[0] if isinstance(shape, TrapezoidShape) else draws[:, -2]

    def widths_felt(self, shape: Any, draws: FloatArray, *, half_way: bool = False) -> tuple[FloatArray, FloatArray]:
        if isinstance(shape, BellRidgeShape):
            return bell_widths(draws, shape.tip_radius)
        if isinstance(shape, TrapezoidShape):
            return flat_topped_widths(shape, draws, half_way=half_way)
        width = width_of_cap((0.5 if half_way else 1.0) * draws[:, -2], np.exp(draws[:, -1]))
        return width, width

    def heights(self, shape: Any, truth: FloatArray, feet: FloatArray, normals: FloatArray) -> FloatArray:
        """The compiled form, over points instead of bins."""
        from mapping.geometry.templates import chain_heights

        radius = np.exp(truth[-1:])
        chain = shape.chains(truth[None], truth[-2:-1] - radius)
        whole = np.zeros(len(feet), dtype=np.int64), np.full(len(feet), chain.shape[1] - 1, dtype=np.int64)
        out = np.empty((1, len(feet)))
        point, rounding = np.full(len(feet), 1e-15), rounding_of(truth[-5:-4])
        chain_heights(
            feet, normals, np.zeros_like(normals), point, *whole, chain, radius, rounding, shape.tip_radius, out
        )
        return np.asarray(out[0])


def _running_out(problem: PosteriorProblem, optimum: FloatArray) -> PosteriorProblem:
    """Lines with the section of a bell, begun with each taper at the half width that fits best where the ridge lies."""
    ridge: Any = problem.target.shape
    shape = bell_ridge_beside(ridge, problem.sizes)
    target = replace(problem.target, shape=shape)
    kept = np.delete(optimum, [len(optimum) - 1] if ridge.chart.closed else [ridge.modes.count, len(optimum) - 1])
    halves = np.log(problem.sizes.half_width * np.geomspace(*BEGUN_HALVES))
    begun = []
    for taper in BEGUN_TAPERS:
        tried = np.column_stack([np.tile(kept, (len(halves), 1)), halves, np.full(len(halves), taper)])
        begun.append(tried[int(np.argmax(target.log_density(tried)))])
    return replace(problem, target=target, beginnings=np.array(begun))


RIDGE = Ridge(
    name="ridge",
    plural="ridges",
    sign=1,
    line=True,
    has_ends=True,
    made_of="convex",
    words={"height": "high", "length": "long"},
    colour=(0.80, 0.16, 0.22, 1.0),
    typical=(0.65e-3, 0.65e-3),  # the paper's wire
)
