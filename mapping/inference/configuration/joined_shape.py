"""JoinedShape: several features at once, as one family of shapes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mapping import FloatArray
from mapping.inference.families import StepShape, TwinShape
from mapping.inference.likelihood import LogPosterior, Prior, Shape

# Places along a line at which it is asked on which side of a step it lies; between two of them the side changes where
# a straight line says
PLACES_OF_LINE = 65


@dataclass(frozen=True, eq=False)
class JoinedShape:
    """Shapes over one window, felt together: their parameters in a row.

    Dilation distributes over unions: the highest of ground and crests is felt, at each place within a bin, not in its
    mean. The ground is base, steps and hollows; the part of a crest that stands on the high side of a step is higher by
    that step, and is felt from the low side too.

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
        own = [theta[:, columns] for columns in self.columns]
        ground = np.zeros((len(theta), self.fine * self.bins))
        for k, shape in enumerate(self.shapes):
            if not _stands_out(shape):
                ground += self._alone(shape, own[k])
        # a crest beside a hollow holds the ball that sinks into it: crests are known as far down as it does
        sunk = np.maximum(-ground.min(axis=1), 0.0)
        felt = ground
        for k, shape in enumerate(self.shapes):
            if _stands_out(shape):
                for piece, lift in [(own[k], np.zeros(len(theta))), *self._on_steps(k, own)]:
                    felt = np.maximum(felt, self._alone(shape, _raised(shape, piece, lift + sunk)) - sunk[:, None])
        return np.asarray(felt.reshape(len(theta), self.bins, self.fine).mean(axis=2))

    @staticmethod
    def _alone(shape: Shape, theta: FloatArray) -> FloatArray:
        """The heights of one shape: most rows of one difference quotient are the last one's in its parameters."""
        own = (theta != theta[-1]).any(axis=1)
        own[-1] = True
        found = shape.templates(np.ascontiguousarray(theta[own]))
        heights = np.tile(found[-1], (len(theta), 1))
        heights[own] = found
        return heights

    def _on_steps(self, k: int, own: Sequence[FloatArray]) -> Iterator[tuple[FloatArray, FloatArray]]:
        """What of the k-th shape stands on the high side of each step: its parameters (W, P), and the (W,) lift, m."""
        shape: Any = self.shapes[k]
        for number, step in enumerate(self.shapes):
            if not isinstance(step, StepShape):
                continue
            s, along, aside = self._places_at(k, number)
            uphill = step.high_side * (aside - step.modes.lateral(own[number][:, : step.modes.count], along))
            piece, lift = own[k].copy(), np.where((uphill > 0.0).any(axis=1), own[number][:, -1], 0.0)
            if "start" in shape.names:
                first = shape.names.index("start")
                low, high = _first_above(s, uphill), -_first_above(-s[::-1], uphill[:, ::-1])
                lift = np.where((piece[:, first + 1] > low) & (piece[:, first] < high), lift, 0.0)
                piece[:, first] = np.where(lift > 0.0, np.maximum(piece[:, first], low), piece[:, first])
                piece[:, first + 1] = np.where(lift > 0.0, np.minimum(piece[:, first + 1], high), piece[:, first + 1])
            if lift.any():
                yield piece, lift

    def _places_at(self, k: int, number: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Places along the k-th shape's chart, and where they lie along and beside the chart of a step."""
        if (k, number) not in self._known:
            shape, step = self._line(k), self._line(number)
            if hasattr(shape, "chart"):
                s = np.linspace(shape.chart.s[0], shape.chart.s[-1], PLACES_OF_LINE)
                points = shape.chart.at(s)[0]
            else:
                s, points = np.zeros(1), shape.spot.point[None]
            self._known[k, number] = (s, *step.chart.coordinates(points)[:2])
        return self._known[k, number]

    def _line(self, k: int) -> Any:
        """The k-th shape, or the course of a twin."""
        shape: Any = self.shapes[k]
        return shape.midway if isinstance(shape, TwinShape) else shape

    @cached_property
    def _known(self) -> dict[tuple[int, int], tuple[FloatArray, FloatArray, FloatArray]]:
        return {}


def _first_above(s: FloatArray, values: FloatArray) -> FloatArray:
    """(W,) where the first stretch of s (n,) begins over which values (W, n) are positive; -inf if it is the beginning,
    inf if they never are."""
    above = values > 0.0
    k, row = np.maximum(np.argmax(above, axis=1), 1), np.arange(len(values))
    before, after = values[row, k - 1], values[row, k]
    place = s[k - 1] + (s[k] - s[k - 1]) * before / np.where(before == after, 1.0, before - after)
    return np.where(above[:, 0], -np.inf, np.where(above.any(axis=1), place, np.inf))


def _stands_out(shape: Shape) -> bool:
    """True of what the ball rests on beside the base: crests, not steps nor hollows."""
    return "height" in shape.names and not isinstance(shape, StepShape)


def _raised(shape: Shape, theta: FloatArray, lift: FloatArray) -> FloatArray:
    """(W, P) parameters of the same section, its crest higher by (W,) lifts, m."""
    raised = theta.copy()
    raised[:, shape.names.index("height")] += lift
    return raised


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
