"""JoinedShape: several features at once, as one family of shapes."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mapping import FloatArray, IntArray
from mapping.inference.families import Crossing, GrooveShape, OffsetRims, StepShape, TwinShape
from mapping.inference.likelihood import LogPosterior, Prior, Shape

# Places along a line at which it is asked on which side of a step it lies; between two of them the side changes where
# a straight line says
PLACES_OF_LINE = 65
# By a power of that (m) crests are raised beside hollows: 4 % more than a row asks for, at most. Were it by just that,
# every row of a difference quotient would ask for crests of its own; by what most rows ask for, a row would depend on
# others
RAISED_BY = 2.0 ** (1 / 16)


@dataclass(frozen=True, eq=False)
class JoinedShape:
    """Shapes over one window, felt together: their parameters in a row.

    Dilation distributes over unions: the highest of ground and crests is felt, at each place within a bin, not in its
    mean. The ground is base, steps and hollows, whose depths add but where grooves cross or run along a step's edge;
    the part of a crest that stands on the high side of a step is higher by that step, and is felt from the low side
    too.

    Args:
        shapes: over a window that has `fine` bins for each one of the likelihood's.
        bins: of the likelihood.
        fine: parts of a bin.
        held: others that are felt with them and stay as they are.
        theirs: the parameters of these in a row.
    """

    shapes: Sequence[Shape]
    bins: int
    fine: int
    held: Sequence[Shape] = ()
    theirs: FloatArray = field(default_factory=lambda: np.zeros(0))

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
        return _in_a_row(self.shapes)

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        theta = np.hstack([theta, np.tile(self.theirs, (len(theta), 1))]) if self.held else theta
        own = [theta[:, columns] for columns in _in_a_row(self._all)]
        hollows = [_Distinct.of(self._all[k].templates, own[k]) for k in self._varied if not stands_out(self._all[k])]
        felt = np.tile(self._held_ground, (len(theta), 1))
        for hollow in hollows:
            felt += hollow.heights[hollow.which]
        if self._crossing is not None:
            crossed = _Distinct.of(self._crossed, np.hstack([own[k] for k in self._grooves]))
            felt += crossed.heights[crossed.which]
        for (groove, edge), rims in self._offset_rims.items():
            beside = _Distinct.of(rims.heights, np.hstack([own[groove], own[edge]]))
            felt += beside.heights[beside.which]
        # a crest beside a hollow holds the ball that sinks into it: crests are known as far down as it does
        deep = np.maximum(-felt.min(axis=1, initial=0.0), 0.0)
        powers = np.ceil(np.log(np.maximum(deep, np.finfo(float).tiny)) / np.log(RAISED_BY))
        sunk = np.where(deep > 0.0, RAISED_BY**powers, 0.0)
        every = ((self._all[k], piece) for k in self._varied for piece in self._crests(k, own, sunk))
        crests = [_lowered(shape.templates, piece, sunk) for shape, piece in every]
        if self._has_held_crests:
            crests.append(_Distinct.of(lambda rows: self._held_crests(own, rows[:, 0]), sunk[:, None]))
        _rest_on(felt, crests)
        # part by part: numpy's mean over so short an axis takes four times as long
        return np.asarray(sum(felt[:, part :: self.fine] for part in range(self.fine)) / self.fine)

    @cached_property
    def _varied(self) -> range:
        """Numbers of the shapes that leave something else when parameters change: a step lifts what stands on it."""
        every = not self.held or any(isinstance(shape, StepShape) for shape in self.shapes)
        return range(len(self._all) if every else len(self.shapes))

    @cached_property
    def _grooves(self) -> dict[int, GrooveShape]:
        """The grooves with upright walls, by their numbers."""
        return {k: shape for k, shape in enumerate(self._all) if type(shape) is GrooveShape}

    @cached_property
    def _crossing(self) -> Crossing | None:
        """Where grooves are near one another; None where a sum says it."""
        if len(self._grooves) < 2:
            return None
        crossing = Crossing.of(list(self._grooves.values()))
        return crossing if len(crossing.bin) else None

    @cached_property
    def _offset_rims(self) -> dict[tuple[int, int], OffsetRims]:
        """Each groove beside each step, by their numbers."""
        steps = [(k, shape) for k, shape in enumerate(self._all) if isinstance(shape, StepShape)]
        return {(g, k): OffsetRims(groove, step) for g, groove in self._grooves.items() for k, step in steps}

    def _crossed(self, theta: FloatArray) -> FloatArray:
        """(W, n) what the grooves leave together more than the sum, m, of their parameters (W, P) in a row."""
        assert self._crossing is not None
        grooves = list(self._grooves.values())
        own = zip(self._grooves, _in_a_row(grooves), strict=True)
        rows = [theta[: len(theta) if k in self._varied else 1, columns] for k, columns in own]
        taken = [groove.taken(each) for groove, each in zip(grooves, rows, strict=True)]
        return self._crossing.heights(taken, grooves[0].tip_radius)

    @cached_property
    def _held_ground(self) -> FloatArray:
        """(fine * bins,) what steps and hollows leave that do not vary, m."""
        ground = np.zeros(self.fine * self.bins)
        columns = _in_a_row(self.held)
        for k in range(len(self._varied), len(self._all)):
            if not stands_out(self._all[k]):
                ground += self._all[k].templates(self.theirs[None, columns[k - len(self.shapes)]])[0]
        return ground

    def _held_crests(self, own: Sequence[FloatArray], sunk: FloatArray) -> FloatArray:
        """(M, fine * bins) highest of the crests that do not vary, known as far down as `sunk` (M,), m."""
        one, numbers = [each[:1] for each in own], range(len(self._varied), len(self._all))
        for each in [each for each in set(sunk.tolist()) if each not in self._raised_by]:  # other cores add to it
            crests = [
                self._all[k].templates(piece)[0] for k in numbers for piece in self._crests(k, one, np.array([each]))
            ]
            self._raised_by[each] = np.max(crests, axis=0) - each
        return np.array([self._raised_by[each] for each in sunk.tolist()])

    @cached_property
    def _has_held_crests(self) -> bool:
        return any(stands_out(self._all[k]) for k in range(len(self._varied), len(self._all)))

    @cached_property
    def _raised_by(self) -> dict[float, FloatArray]:
        return {}

    def _crests(self, k: int, own: Sequence[FloatArray], sunk: FloatArray) -> Iterator[FloatArray]:
        """Parameters (W, P) of the k-th shape if it stands out, and of what of it stands on steps, raised by `sunk`
        (W,), m."""
        shape = self._all[k]
        if not stands_out(shape):
            return
        yield _raised(shape, own[k], sunk)
        for piece, lift in self._on_steps(k, own):
            yield _raised(shape, piece, lift + sunk)

    def _on_steps(self, k: int, own: Sequence[FloatArray]) -> Iterator[tuple[FloatArray, FloatArray]]:
        """What of the k-th shape stands on the high side of each step: its parameters (W, P), and the (W,) lift, m."""
        shape: Any = self._all[k]
        for number, step in enumerate(self._all):
            if not isinstance(step, StepShape):
                continue
            s, along, aside = self._places_at(k, number)
            uphill = step.high_side * (aside - step.modes.lateral(own[number][:, : step.modes.count], along))
            piece, lift = own[k].copy(), np.where((uphill > 0.0).any(axis=1), step.parts(own[number])[0], 0.0)
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
        shape: Any = self._all[k]
        return shape.midway if isinstance(shape, TwinShape) else shape

    @cached_property
    def _all(self) -> list[Shape]:
        return [*self.shapes, *self.held]

    @cached_property
    def _known(self) -> dict[tuple[int, int], tuple[FloatArray, FloatArray, FloatArray]]:
        return {}


def _in_a_row(shapes: Sequence[Shape]) -> list[slice]:
    """The columns of each shape's parameters."""
    ends = np.cumsum([0, *(len(shape.names) for shape in shapes)])
    return [slice(int(low), int(high)) for low, high in itertools.pairwise(ends)]


@dataclass(frozen=True, eq=False)
class _Distinct:
    """Heights of some shapes: most rows of a difference quotient have the same, and differ in the others' parameters.

    Args:
        heights: (U, n) of parameters that differ, the commonest ones first, m; others may be there twice.
        which: (W,) of them for each row.
        other: rows that do not have the commonest ones.
    """

    heights: FloatArray
    which: IntArray
    other: IntArray

    @classmethod
    def of(cls, templates: Callable[[FloatArray], FloatArray], theta: FloatArray) -> _Distinct:
        """Of what gives heights (M, n) for parameters (M, P), and parameters (W, P)."""
        if (theta == theta[0]).all():
            return cls.same(templates(np.ascontiguousarray(theta[:1]))[0], len(theta))
        # of a batch of difference quotients its first or its last row is that of most
        alike = max(((theta == row).all(axis=1) for row in (theta[0], theta[-1])), key=np.count_nonzero)
        other = np.flatnonzero(~alike)
        which = np.zeros(len(theta), dtype=np.int64)
        which[other] = 1 + np.arange(len(other))
        rows = np.concatenate([theta[alike.argmax()][None], theta[other]])
        return cls(templates(np.ascontiguousarray(rows)), which, other)

    @classmethod
    def same(cls, heights: FloatArray, count: int) -> _Distinct:
        """Heights (n,) that so many rows have."""
        return cls(heights[None], np.zeros(count, dtype=np.int64), np.zeros(0, dtype=np.int64))


def _lowered(templates: Callable[[FloatArray], FloatArray], theta: FloatArray, raised: FloatArray) -> _Distinct:
    """Heights of a shape that was raised by (W,) m, where it belongs."""
    rows = np.column_stack([theta, raised])
    return _Distinct.of(lambda some: templates(np.ascontiguousarray(some[:, :-1])) - some[:, -1:], rows)


def _rest_on(felt: FloatArray, crests: Sequence[_Distinct]) -> None:
    """Raise ground (W, n) to the highest of crests."""
    if not crests:
        return
    commonest = np.array([each.heights[0] for each in crests])
    top = commonest.argmax(axis=0)
    highest = np.take_along_axis(commonest, top[None], axis=0)[0]
    changed: list[list[int]] = [[] for _ in felt]
    for k, crest in enumerate(crests):
        for row in crest.other:
            changed[row].append(k)
    np.put_along_axis(commonest, top[None], -np.inf, axis=0)
    second = commonest.max(axis=0)
    np.put_along_axis(commonest, top[None], highest[None], axis=0)
    without: dict[tuple[int, ...], FloatArray] = {(): highest}
    for row, own in enumerate(changed):
        if (key := tuple(own)) not in without:
            where = (top == np.array(own)[:, None]).any(axis=0)
            without[key] = np.where(where, second, highest)
            if len(own) > 1:
                without[key][where] = np.delete(commonest, own, axis=0)[:, where].max(axis=0, initial=-np.inf)
        np.maximum(felt[row], without[key], out=felt[row])
        for k in own:
            np.maximum(felt[row], crests[k].heights[crests[k].which[row]], out=felt[row])


def _first_above(s: FloatArray, values: FloatArray) -> FloatArray:
    """(W,) where the first stretch of s (n,) begins over which values (W, n) are positive; -inf if it is the beginning,
    inf if they never are."""
    above = values > 0.0
    k, row = np.maximum(np.argmax(above, axis=1), 1), np.arange(len(values))
    before, after = values[row, k - 1], values[row, k]
    place = s[k - 1] + (s[k] - s[k - 1]) * before / np.where(before == after, 1.0, before - after)
    return np.where(above[:, 0], -np.inf, np.where(above.any(axis=1), place, np.inf))


def stands_out(shape: Shape) -> bool:
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
        return self._joined.templates(theta)

    @cached_property
    def _joined(self) -> JoinedShape:
        """All of them; what the others leave is worked out once."""
        return JoinedShape([self.shape], len(self.likelihood.window), self.fine, self.others, self.theirs)
