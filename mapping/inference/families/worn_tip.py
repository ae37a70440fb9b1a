"""WornTipShape: a crest felt by a ball that is worn flat where it touches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mapping import FloatArray
from mapping.inference.families.problem import PosteriorProblem
from mapping.inference.likelihood import Prior


@dataclass(frozen=True, eq=False)
class WornTipShape:
    """A crest of one height, as a ball feels it that lacks a cap of some depth s where it touches level ground.

    On the ground such a ball stands s lower than a whole one, on the flank of a crest beside its flat as high: over
    what is felt of the ground the flank is that of a crest which is s higher. Over the crest it is no higher than that
    is, for as far as the flat is wide. The rim of the flat is taken for sharp: over a round crest of the radius a it
    turns on an arc of a, which stays below by a (1 - cos phi), phi the angle of the rim: 0.005 a at a flat of 0.2 r.

    Args:
        felt: the shape as the whole ball feels it.
        depth: of the cap that is worn off, m.
    """

    felt: Any
    depth: float

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.felt.names)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(self.felt.units)

    @property
    def priors(self) -> tuple[Prior, ...]:
        return tuple(self.felt.priors)

    @property
    def start(self) -> FloatArray:
        return np.asarray(self.felt.start)

    @property
    def step(self) -> FloatArray:
        return np.asarray(self.felt.step)

    @property
    def tip_radius(self) -> float:
        return float(self.felt.tip_radius)

    @property
    def across(self) -> float:
        """Width of the flat, m."""
        return float(2.0 * np.sqrt(self.depth * max(2.0 * self.tip_radius - self.depth, 0.0)))

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over what is felt of the bare base, m."""
        which = self.names.index("height")
        raised = theta.copy()
        raised[:, which] += self.depth
        return np.asarray(np.minimum(self.felt.templates(raised), theta[:, which, None]))


def with_worn_tip(problem: PosteriorProblem, depth: float) -> PosteriorProblem:
    """The problem as a ball feels it that lacks a cap of a depth, m."""
    return replace(problem, target=replace(problem.target, shape=WornTipShape(problem.target.shape, depth)))
