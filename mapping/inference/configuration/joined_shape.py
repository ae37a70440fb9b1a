"""JoinedShape: several features at once, as one family of shapes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.inference.families import StepShape, TwinShape
from mapping.inference.likelihood import LogPosterior, Prior, Shape


@dataclass(frozen=True, eq=False)
class JoinedShape:
    """Shapes over one window, felt together: their parameters in a row.

    Dilation distributes over unions: of what stands out the highest is felt, at each place within a bin, not in its
    mean. A step lifts what stands on its high side, and a hollow is cut into whatever is there.

    Args:
        shapes: over a window that has `fine` bins for each one of the likelihood's.
        bins: of the likelihood.
        fine: parts of a bin.
    """

    shapes: Sequence[Shape]
    bins: int
    fine: int

    @cached_property
    def names(self) -> tuple[str, ...]:
        return tuple(f"{k} {name}" for k, shape in enumerate(self.shapes) for name in shape.names)

    @cached_property
    def units(self) -> tuple[str, ...]:
        return tuple(unit for shape in self.shapes for unit in shape.units)

    @cached_property
    def priors(self) -> tuple[Prior, ...]:
        return tuple(prior for shape in self.shapes for prior in shape.priors)

    @cached_property
    def start(self) -> FloatArray:
        return np.concatenate([np.zeros(0), *(shape.start for shape in self.shapes)])

    @cached_property
    def step(self) -> FloatArray:
        return np.concatenate([np.zeros(0), *(shape.step for shape in self.shapes)])

    @cached_property
    def columns(self) -> list[slice]:
        """The parameters of each shape."""
        ends = np.cumsum([0, *(len(shape.names) for shape in self.shapes)])
        return [slice(int(low), int(high)) for low, high in itertools.pairwise(ends)]

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        parts = [self._alone(shape, theta[:, own]) for shape, own in zip(self.shapes, self.columns, strict=True)]
        felt = np.zeros((len(theta), self.fine * self.bins))
        for k in self._steps:
            felt += parts[k]
        hollow = np.zeros_like(felt)
        for k, heights in enumerate(parts):
            if k not in self._steps:
                lifted = heights
                for number, mask in self._stands_on.get(k, ()):
                    lifted = lifted + theta[:, self.columns[number]][:, -1:] * mask
                felt = np.where(heights > 0.0, np.maximum(felt, lifted), felt)
                hollow += np.minimum(heights, 0.0)
        felt += hollow
        return np.asarray(felt.reshape(len(theta), self.bins, self.fine).mean(axis=2))

    @staticmethod
    def _alone(shape: Shape, theta: FloatArray) -> FloatArray:
        """The heights of one shape: of the rows of one difference quotient most are equal in its parameters."""
        rows, which = np.unique(theta, axis=0, return_inverse=True)
        return np.asarray(shape.templates(np.ascontiguousarray(rows))[which.reshape(-1)])

    @cached_property
    def _steps(self) -> list[int]:
        """Numbers of the steps."""
        return [k for k, shape in enumerate(self.shapes) if isinstance(shape, StepShape)]

    @cached_property
    def _stands_on(self) -> dict[int, list[tuple[int, BoolArray]]]:
        """For each other shape the steps, and (n,) whether the nearest point of its axis is on the high side of it."""
        found: dict[int, list[tuple[int, BoolArray]]] = {}
        for k, shape in enumerate(self.shapes):
            for number in self._steps if k not in self._steps else ():
                step: Any = self.shapes[number]
                lateral = step.chart.coordinates(_feet_of_axis(shape))[1]
                found.setdefault(k, []).append((number, step.high_side * lateral > 0.0))
        return found


def _feet_of_axis(shape: Any) -> FloatArray:
    """(n, 3) the point of a shape's axis that is nearest to each bin, or (1, 3) its one point."""
    if isinstance(shape, TwinShape):
        shape = shape.midway
    if not hasattr(shape, "chart"):
        return np.asarray(shape.spot.point[None])
    s = shape.chart.coordinates(shape.window.feet)[0]
    return np.asarray(shape.chart.at(np.clip(s, shape.chart.s[0], shape.chart.s[-1]))[0])


@dataclass(frozen=True, eq=False)
class OneOfMany(LogPosterior):
    """The density of one shape's parameters beside others that stay as they are.

    Args:
        others: shapes over the same parts of bins.
        theirs: their parameters in a row.
        fine: parts of a bin.
    """

    others: Sequence[Shape] = ()
    theirs: FloatArray = field(default_factory=lambda: np.zeros(0))
    fine: int = 1

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights of all of them together, m."""
        joined = JoinedShape([self.shape, *self.others], len(self.likelihood.window), self.fine)
        return joined.templates(np.hstack([theta, np.tile(self.theirs, (len(theta), 1))]))
