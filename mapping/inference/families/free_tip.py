"""FreeTipShape: any shape felt by a tip whose radius is known only up to a prior."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from mapping import FloatArray
from mapping.inference.families.problem import PosteriorProblem
from mapping.inference.families.worn_tip import WornTipShape
from mapping.inference.likelihood import Normal, Prior, Shape

# A tip is at least this share of its nominal radius.
SMALLEST_TIP_SHARE = 0.1
# A prior is narrow up to this share of the radius. Over the radii of 2 sd of such a one, heights go with the radius as
# a parabola to the third order of that share, 1e-3 of a height; only where a footprint begins, in a strip that shrinks
# with the share, are they not smooth (tests/mapping/inference/families/test_free_tip.py compares).
NARROW_PRIOR = 0.05
NODE_SDS = 2.0


@dataclass(frozen=True, eq=False)
class FreeTipShape:
    """A shape with the radius of the fingertip as its last parameter.

    The feet and heights of a trace hold for the nominal radius r. A ball of radius r' stands r' - r higher over the
    bare base, and feels the feature with its own radius. What is not known of the tip mostly widens the radius of a
    crest (only a + r' counts under a ball) and the width of a groove.

    Args:
        felt: the shape as the nominal tip feels it.
        tip: prior of the radius, m.
        base_was_felt: True over a base that was fitted to the trace: it lies where any tip would have felt it, and
            says nothing of the radius.
    """

    felt: Any
    tip: Normal
    base_was_felt: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.felt.names, "tip radius")

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.felt.units, "m")

    @property
    def priors(self) -> tuple[Prior, ...]:
        return (*self.felt.priors, self.tip)

    @property
    def start(self) -> FloatArray:
        return np.append(self.felt.start, self.tip.mean)

    @property
    def step(self) -> FloatArray:
        return np.append(self.felt.step, 0.1 * self.tip.sd)

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the trace of a tip of nominal radius on the bare base, m.

        Up to NARROW_PRIOR the shape is evaluated at three radii, all rows at once, and a parabola through them gives
        each row its own; a wider prior needs every row's own radius.
        """
        off = theta[:, -1:] - self.tip.mean
        higher = np.zeros_like(off) if self.base_was_felt else off
        if self.tip.sd > NARROW_PRIOR * self.tip.mean:
            rows = [self._with_tip(float(row[-1])).templates(row[None, :-1]) for row in theta]
            return np.concatenate(rows) + higher
        below, at, above = (shape.templates(theta[:, :-1]) for shape in self._nodes)
        u = off / (NODE_SDS * self.tip.sd)
        felt: FloatArray = at + 0.5 * u * (above - below) + 0.5 * u**2 * (above - 2.0 * at + below)
        return felt + higher

    @cached_property
    def _nodes(self) -> tuple[Shape, Shape, Shape]:
        """The shape felt by tips of the three radii that a narrow prior's parabola goes through."""
        node = NODE_SDS * self.tip.sd
        return self._with_tip(self.tip.mean - node), self.felt, self._with_tip(self.tip.mean + node)

    def _with_tip(self, radius: float) -> Shape:
        # A copy keeps what the shape has cached of its window, which does not depend on the tip.
        other: Shape = copy.copy(self.felt)
        object.__setattr__(other, "tip_radius", radius)
        return other


def with_free_tip(problem: PosteriorProblem, sd: float, base_was_felt: bool = False) -> PosteriorProblem:
    """The problem with the tip's radius as a parameter: Gaussian about the nominal one, sd in m."""
    felt: Any = problem.target.shape
    prior = Normal(felt.tip_radius, sd, SMALLEST_TIP_SHARE * felt.tip_radius)
    nominal = np.full((len(problem.beginnings), 1), felt.tip_radius)
    target = replace(problem.target, shape=FreeTipShape(felt, prior, base_was_felt))
    return replace(problem, target=target, beginnings=np.hstack([problem.beginnings, nominal]))


def with_nominal_tip(problem: PosteriorProblem) -> PosteriorProblem:
    """The problem as the nominal tip feels it; the same if the tip was neither free nor worn."""
    shape = problem.target.shape
    if isinstance(shape, WornTipShape):
        return replace(problem, target=replace(problem.target, shape=shape.felt))
    if not isinstance(shape, FreeTipShape):
        return problem
    return replace(problem, target=replace(problem.target, shape=shape.felt), beginnings=problem.beginnings[:, :-1])
