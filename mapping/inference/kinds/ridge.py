"""Ridge: a line of round section that stands on the base, such as a wire."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapping import Feature, FloatArray, Interval
from mapping.geometry.proxy import Part, Swell
from mapping.geometry.templates import width_of_cap
from mapping.inference.families import (
    BellRidgeShape,
    PosteriorProblem,
    RidgeShape,
    ShoulderedShape,
    Sizes,
    TrapezoidShape,
    bell_ridge_beside,
    bell_widths,
    rounding_of,
    shouldered_beside,
    shouldered_widths,
    touched_widths,
    trapezoid_beside,
)
from mapping.inference.kinds.crests import BEGUN_TAPERS, Crest, bell_said, rounding_said
from mapping.inference.kinds.kind import Section
from mapping.inference.kinds.lines import ROUNDING_OF_ENDS, SQUARE_OR_ROUND, LineKind, Parameters, Traced, ended
from mapping.inference.kinds.posterior_density import height_prior, radius_prior
from mapping.inference.likelihood import Shape

# Widths of a flat top and runs of a flank, in half-widths of the disturbance, from which their optimum is searched:
# upright and gentle flanks, tops that are hardly felt and such as fill the disturbance
FLAT_STARTS = ((0.3, 0.02), (1.0, 0.02), (0.1, 0.6))
# Run of an upright flank
UPRIGHT_RUN = 0.02
ROOF_STARTS = ((0.02,), (0.6,))
SHOULDER_STARTS = ((0.3, 0.05), (1.0, 0.05))
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
        height, top, run = shape.parts(draws)
        flank = "shoulder" if isinstance(shape, ShoulderedShape) else "run"
        parts = {"top": float(np.median(top)), flank: float(np.median(run)), "radius": None}
        parts |= rounding_said(shape, draws)
        foot = top + (width_of_cap(height, run) if flank == "shoulder" else 2.0 * run)
        return Section(Interval.from_draws(height), Interval.from_draws(foot), parts)

    def has_plain_member(self, shape: Any) -> bool:
        return isinstance(shape, RidgeShape)

    def plain_odds(self, shape: Any, draws: FloatArray) -> float:
        """Of a wire that lies on the base: its radius is half its height.

        By the ratio of the densities of the radius there, after the data and before (Savage's ratio; Dickey, Annals of
        Mathematical Statistics 42, 1971), the former from the draws by Gaussian kernels of Silverman's width.
        """
        if not self.has_plain_member(shape):
            return 0.0
        lying = np.log(0.5 * draws[:, -2])
        off = draws[:, -1] - lying
        width = 1.06 * max(float(off.std()), 1e-9) * len(off) ** -0.2
        after = float(np.exp(-0.5 * (off / width) ** 2).mean()) / (width * np.sqrt(2.0 * np.pi))
        before = float(np.exp(shape.priors[-1].log_density(np.median(lying))))
        return float(after / before)

    def draws_of_height(self, shape: Shape, draws: FloatArray) -> FloatArray:
        if isinstance(shape, BellRidgeShape):
            return draws[:, -3]
        return shape.parts(draws)[0] if isinstance(shape, TrapezoidShape) else draws[:, -2]

    def widths_felt(self, shape: Any, draws: FloatArray, *, half_way: bool = False) -> tuple[FloatArray, FloatArray]:
        tip = shape.tip_radius
        if isinstance(shape, BellRidgeShape):
            return bell_widths(draws, tip)
        if isinstance(shape, ShoulderedShape):
            return shouldered_widths(*shape.parts(draws), tip, half_way=half_way)
        if isinstance(shape, TrapezoidShape):
            return touched_widths(*shape.parts(draws), tip, half_way=half_way)
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
