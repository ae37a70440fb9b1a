"""Groove: a hollow line with upright walls, or with walls that run out smoothly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapping import FloatArray
from mapping.geometry.templates import rim_height
from mapping.inference.families import (
    GrooveShape,
    PosteriorProblem,
    Sizes,
    Surroundings,
    rounding_of,
    smooth_beginnings,
    smooth_groove_beside,
)
from mapping.inference.kinds.hollows import Hollow, within_ends
from mapping.inference.kinds.lines import ROUNDING_OF_ENDS, LineKind, Parameters, Traced
from mapping.inference.kinds.posterior_density import hollow_priors


class Groove(Hollow, LineKind):
    """Grooves with a flat bottom: course, rounding and places of the ends, log width, log depth; or smooth ones."""

    def shape(self, traced: Traced) -> GrooveShape:
        sizes, tip = traced.sizes, traced.tip_radius
        guess = float(np.log(2.0 * sizes.radius)), float(np.log(2.0 * sizes.height))
        rounding = Parameters() if traced.chart.closed else ROUNDING_OF_ENDS
        whole = traced.laterals + rounding + traced.ends + Parameters(hollow_priors(sizes, tip), guess, (0.02, 0.05))
        return GrooveShape(traced.window, traced.chart, traced.modes, tip, *whole.arrays)

    def other_starts(self, sizes: Sizes) -> tuple[float, ...]:
        return (float(np.log(sizes.height)),)

    def alternatives(self, problem: PosteriorProblem, around: Surroundings) -> Sequence[PosteriorProblem]:
        """A groove without an edge, on the same course."""
        upright: Any = problem.target.shape
        target = replace(problem.target, shape=smooth_groove_beside(upright, problem.sizes))
        beginnings = smooth_beginnings(upright, problem.beginnings, problem.sizes)
        return (replace(problem, target=target, beginnings=beginnings),)

    def heights(self, shape: Any, truth: FloatArray, feet: FloatArray, normals: FloatArray) -> FloatArray:
        s, lateral, _ = shape.chart.coordinates(feet)
        x = lateral - shape.modes.lateral(truth[None, : shape.modes.count], s)[0]
        along, across = np.minimum(s - truth[-4], truth[-3] - s), 0.5 * np.exp(truth[-2]) - np.abs(x)
        inside = within_ends(along, across, 0.5 * float(np.exp(truth[-2])) * float(rounding_of(truth[-5])))
        return rim_height(inside, shape.tip_radius, np.exp(truth[-1]))


GROOVE = Groove(
    name="groove",
    plural="grooves",
    sign=-1,
    line=True,
    has_ends=True,
    made_of="concave",
    words={"height": "deep", "length": "long"},
    colour=(0.13, 0.37, 0.66, 1.0),
    typical=(-0.05e-3, 2e-3),
)
