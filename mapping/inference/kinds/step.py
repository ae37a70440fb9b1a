"""Step: an upright or slanted edge between two levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapping import Feature, FloatArray, Interval
from mapping.geometry.proxy import Part, Terrace
from mapping.geometry.templates import contact_half_width, step_height, untouched_run
from mapping.inference.families import PosteriorProblem, Sizes, StepShape, slanted_beginnings, slanted_beside
from mapping.inference.kinds.kind import Section, place_sd, preliminary, uphill
from mapping.inference.kinds.lines import LineKind, Parameters, Traced
from mapping.inference.kinds.posterior_density import height_prior

# Places at which an edge is looked for, at most: one in each bin up to walls a thirtieth of a disturbance wide
EDGE_PLACES = 400


class Step(LineKind):
    """Steps, up to walls: course and height, and the run of a slanted one; the higher side is the one that fits better.

    An upright step stands for all whose flank is too steep to be touched; slanted ones are weighed against it.
    """

    def sizes(self, feature: Feature, tip_radius: float) -> Sizes:
        """The disturbance is that of a sharp edge of its height, and of the climb to it of a slanted one."""
        height, sd, _ = preliminary(feature, tip_radius)
        arc = float(contact_half_width(min(height, tip_radius), 0.0, tip_radius))
        half = arc + 0.5 * (feature.details.run or 0.0)
        return Sizes(height, sd, 0.0, half, place_sd(feature, half))

    def trace(self, feature: Feature, feet: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
        """(N,) heights over the low side, m; 0 where it is not known which that is; see `Kind.trace`."""
        away = uphill(feature, feet)
        run = feature.details.run or 0.0
        return step_height(away, abs(feature.height.median), tip_radius, run) if away.any() else away

    def shape(self, traced: Traced) -> StepShape:
        height = traced.sizes.height
        whole = traced.laterals + Parameters((height_prior(traced.sizes),), (height,), (0.02 * height,))
        sides = [
            StepShape(traced.window, traced.chart, traced.modes, traced.tip_radius, side, *whole.arrays)
            for side in (-1.0, 1.0)
        ]
        return max(sides, key=lambda side: float(_rough_fits(side, side.start[None])[0]))

    def _beginnings(self, shape: Any, sizes: Sizes) -> FloatArray:
        """Where it was detected, and at the place at which an edge fits best: of a wall no descent leads over a bin."""
        starts = super()._beginnings(shape, sizes)
        low, high = shape.priors[0].low, shape.priors[0].high
        places = np.tile(shape.start, (EDGE_PLACES, 1))
        places[:, 0] = np.linspace(low, high, len(places))
        return np.vstack([starts, places[int(np.argmax(_rough_fits(shape, places)))]])

    def rivals(self, problem: PosteriorProblem, optimum: FloatArray) -> Sequence[PosteriorProblem]:
        """The slanted step on the same course."""
        upright: Any = problem.target.shape
        height = float(optimum[upright.modes.count])
        shape = slanted_beside(upright, problem.sizes, float(untouched_run(height, upright.tip_radius)))
        target, begun = replace(problem.target, shape=shape), list[FloatArray]()
        for tried in slanted_beginnings(shape, optimum, problem.feature.details.run):
            begun.append(tried[int(np.argmax(target.log_density(tried)))])
        return [replace(problem, target=target, beginnings=np.array(begun))]

    def claims_more(self, shape: Any) -> bool:
        """A climb."""
        return bool(shape.slanted)

    def draws_of_height(self, shape: Any, draws: FloatArray) -> FloatArray:
        return np.asarray(shape.parts(draws)[0])

    def widths_felt(self, shape: Any, draws: FloatArray, *, half_way: bool = False) -> tuple[FloatArray, FloatArray]:
        """Those of the climb; none of an upright step."""
        width = (0.5 if half_way else 1.0) * shape.climbs(draws)
        return width, width

    def section(self, feature: Feature, shape: Any, draws: FloatArray) -> Section:
        sign, run = 1.0 if feature.height.median >= 0.0 else -1.0, shape.climbs(draws)
        known = {"high_side": shape.high_side, "run": float(np.median(run)) if shape.slanted else None}
        return Section(Interval.from_draws(sign * shape.parts(draws)[0]), Interval.from_draws(run), known)

    def part(self, feature: Feature, exaggeration: float = 1.0) -> Part | None:
        """The terrace; None of an edge whose higher side was not recorded, or that is a point or closed."""
        side, height = feature.details.high_side, exaggeration * abs(feature.height.median)
        if side is None or not height > 0.0 or len(feature.axis) < 2 or feature.closed:
            return None
        return Terrace(feature.axis, feature.normals, height, side)

    def heights(self, shape: Any, truth: FloatArray, feet: FloatArray, normals: FloatArray) -> FloatArray:
        s, lateral, _ = shape.chart.coordinates(feet)
        x = lateral - shape.modes.lateral(truth[None, : shape.modes.count], s)[0]
        height, run = (float(each[0]) for each in shape.parts(truth[None]))
        return step_height(shape.high_side * x, height, shape.tip_radius, run)

    def profile(
        self, feature: Feature, x: FloatArray, feet: FloatArray, normals: FloatArray, tip_radius: float
    ) -> FloatArray:
        """(N,) heights of a sweep that climbs it squarely, m; see `Kind.profile`."""
        return step_height(x, abs(feature.height.median), tip_radius, feature.details.run or 0.0)

    def outline(self, height: float, width: float) -> tuple[FloatArray, bool]:
        """A wall."""
        return np.array([[0.0, 0.0], [0.0, height]]), False


def _rough_fits(shape: StepShape, theta: FloatArray) -> FloatArray:
    """(W,) correlations of a step's templates for parameters (W, P) with the data, each run's mean taken out."""
    templates, height = shape.templates(theta), shape.window.height
    total, square = np.zeros(len(theta)), np.zeros(len(theta))
    for start, stop in zip(shape.window.starts[:-1], shape.window.starts[1:], strict=True):
        own = templates[:, start:stop] - templates[:, start:stop].mean(axis=1)[:, None]
        total += own @ height[start:stop]
        square += (own**2).sum(axis=1)
    return np.asarray(total / np.sqrt(np.maximum(square, np.finfo(float).tiny)))


STEP = Step(
    name="step",
    plural="steps",
    sign=0,
    line=True,
    sided=True,
    made_of="step",
    words={"height": "high", "length": "long"},
    colour=(0.48, 0.31, 0.64, 1.0),
    typical=(0.3e-3, 0.0),
)
