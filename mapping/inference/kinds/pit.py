"""Pit: a round hollow with an upright wall, or with one that runs out smoothly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapping import FloatArray
from mapping.geometry.templates import rim_height
from mapping.inference.families import (
    PitShape,
    PosteriorProblem,
    Sizes,
    Surroundings,
    smooth_beginnings,
    smooth_pit_beside,
)
from mapping.inference.kinds.hollows import Hollow
from mapping.inference.kinds.points import PointKind, PointShape, Seen
from mapping.inference.kinds.posterior_density import hollow_priors, place_prior


class Pit(Hollow, PointKind):
    """Pits about a spot: log width and log depth equally probable over wide ranges."""

    def shape(self, seen: Seen) -> PitShape:
        sizes, free = seen.sizes, seen.free
        place = place_prior(sizes)
        width, depth = hollow_priors(sizes, seen.tip_radius)
        start = np.array([0.0] * free + [np.log(2.0 * sizes.radius), np.log(2.0 * sizes.height)])
        step = np.array([0.02 * sizes.half_width] * free + [0.02, 0.05])
        return PitShape(seen.window, seen.spot, seen.tip_radius, free, (*(place,) * free, width, depth), start, step)

    def beginnings(self, shape: PointShape, sizes: Sizes) -> FloatArray:
        """One on whose floor the ball stands among them: while it hangs, nothing leads to a wider mouth."""
        others = super().beginnings(shape, sizes)
        deep = shape.window.height < -0.5 * sizes.height
        if not deep.any():
            return others
        tip, depth = shape.tip_radius, -float(np.median(shape.window.height[deep]))
        middle = shape.window.feet[deep].mean(axis=0)
        half = float(np.linalg.norm(shape.window.feet[deep] - middle, axis=1).max())
        fall = min(0.5 * depth, tip)  # half as deep as on the floor
        width = 2.0 * (half + float(np.sqrt(fall * (2.0 * tip - fall))))
        place = (shape.spot.axes @ (middle - shape.spot.point))[: shape.free]
        return np.vstack([others, [*place, np.log(width), np.log(depth)]])

    def other_starts(self, sizes: Sizes) -> tuple[float, ...]:
        return (float(np.log(sizes.height)),)

    def alternatives(self, problem: PosteriorProblem, around: Surroundings) -> Sequence[PosteriorProblem]:
        """A pit without an edge."""
        upright: Any = problem.target.shape
        target = replace(problem.target, shape=smooth_pit_beside(upright, problem.sizes))
        return (
            replace(problem, target=target, beginnings=smooth_beginnings(upright, problem.beginnings, problem.sizes)),
        )

    def heights(self, shape: Any, truth: FloatArray, feet: FloatArray, normals: FloatArray) -> FloatArray:
        place = np.zeros(2)
        place[: shape.free] = truth[: shape.free]
        center = shape.spot.point + place @ shape.spot.axes
        rim = 0.5 * np.exp(truth[-2]) - np.linalg.norm(feet - center, axis=1)
        return rim_height(rim, shape.tip_radius, np.exp(truth[-1]))


PIT = Pit(
    name="pit",
    plural="pits",
    sign=-1,
    line=False,
    made_of="concave",
    words={"height": "deep"},
    colour=(0.20, 0.53, 0.74, 1.0),
    typical=(-0.1e-3, 3e-3),
)
