"""LaidTrace: a trace on its base; where it stands over the base, how high, and how far along, each computed once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from mapping import BoolArray, FloatArray, IntArray, Trace, dots, lengths
from mapping.base.base import Base, Feet
from mapping.base.cells import Cells
from mapping.base.height_profile import SweepHeights, arclength, height_profiles
from mapping.geometry.mesh import BoxedPoints

# Feet whose directions differ by no more (rad), and whose places rise off the first one's plane by no more of their
# distance, lie as in one plane: by a bend of t lateral noise of sd sigma changes single heights by t sigma / 2 at most,
# one part in 200, which is 6 % of the sd of a mean of 150 samples; a path of length l bent by t misses its own mean by
# t l / 24, 2 um in 5 mm. Where a hollow or a crease lies between, the means themselves are laid
ONE_PLANE = 0.01
# Between centres this near to each other (tip radii) directions are interpolated linearly. Where they turn fastest,
# over an edge, the centre goes round it on a circle of the tip's radius: linear between two that are an angle a apart
# they are at most a^2 / 8 off, 1.3e-3 rad for a tenth; a contact's angle is measured to 1 degree, 17e-3 rad
LONGEST_KNOWN_GAP = 0.1
# Row of a sample that is not laid on the base yet
NOT_LAID = -1


class LaidSweep:
    """One sweep over its base. What was asked once is kept, and shared by every trace that the sweep is part of.

    Args:
        number: of the sweep.
        trace: its samples.
        base: the global model.
    """

    def __init__(self, number: int, trace: Trace, base: Base) -> None:
        self.number, self.trace, self.base = number, trace, base
        self._arclength: FloatArray | None = None
        self._heights: dict[float, tuple[SweepHeights, ...]] = {}
        # feet of the samples laid by now, in the order in which they were asked for, and each sample's row among them:
        # few are, and those of all would take more memory than the trace itself
        self._feet = _empty(0)
        self._row: NDArray[np.int32] = np.full(len(trace), NOT_LAID, dtype=np.int32)

    @property
    def arclength(self) -> FloatArray:
        """(N,) along the base's trace under the sweep, m (see height_profile.arclength)."""
        if self._arclength is None:
            self._arclength = arclength(self.trace, self.base, self.feet_of_means)
        return self._arclength

    def heights(self, spacing: float) -> tuple[SweepHeights, ...]:
        """Mean heights in bins of a width (m), one profile for each piece without a gap."""
        if spacing not in self._heights:
            self._heights[spacing] = height_profiles(
                self.number, self.trace, self.arclength, self.base, spacing, self.feet, self.feet_of_means
            )
        return self._heights[spacing]

    def known_heights(self) -> tuple[SweepHeights, ...]:
        """The finest of the heights that were asked for by now: nothing is laid."""
        return self._heights[min(self._heights)] if self._heights else ()

    def feet(self, index: slice | IntArray = slice(None)) -> Feet:
        """Where some of the samples stand; each sample is laid on the base the first time that it is asked for."""
        which = np.arange(len(self.trace))[index]
        new = which[self._row[which] == NOT_LAID]
        if len(new):
            count = len(self._feet.height)
            laid = self.base.foot(self.trace.centers[new], self.trace.tip_radius)
            self._feet = _joined([self._feet, laid]) if count else laid
            self._row[new] = np.arange(count, count + len(new))
        return _rows(self._feet, _run_of(self._row[index]))

    @property
    def _all_laid(self) -> bool:
        return len(self._feet.height) == len(self._row)

    def feet_of_means(
        self, centers: FloatArray, first: IntArray, stop: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Where places (n, 3) amid runs of samples stand: points (n, 3), directions (n, 3), heights (n,) as in `Feet`.

        Where the feet of all samples of a run are known and lie in one plane (to ONE_PLANE), the mean of its centres
        stands at the mean of the feet, and a place beside that beside it: only the others are laid. (Another face that
        bends towards the path within the run could be nearer to the mean alone, by the square of the run's length over
        its distance.)

        Args:
            centers: a place amid each of the runs, within a step of the mean of its centres, m.
            first: (n,) first sample of each.
            stop: past the last sample of the last one.
        """
        found = np.empty((len(first), 3)), np.empty((len(first), 3)), np.empty(len(first))
        known = np.zeros(len(first), dtype=bool)
        if len(self._feet.height) and len(first):
            rows, counts = self._row[first[0] : stop], np.diff(np.append(first, stop))
            known = np.logical_and.reduceat(rows != NOT_LAID, first - first[0])
            samples = np.arange(first[0], stop)[np.repeat(known, counts)]
            rows, counts = rows[samples - first[0]], counts[known]
        if known.any():
            starts = np.cumsum([0, *counts[:-1]])
            kept = _rows(self._feet, _run_of(rows))
            up = np.repeat(kept.normals[starts], counts, axis=0)
            turn = np.abs(kept.normals - up).max(axis=1)
            apart = kept.points - np.repeat(kept.points[starts], counts, axis=0)
            flat = turn < ONE_PLANE
            flat &= np.abs(dots(apart, up)) <= ONE_PLANE * lengths(apart)
            plane = np.logical_and.reduceat(flat, starts)
            known[known] = plane
            runs = (self.trace.centers[samples], kept.points, kept.normals, kept.height)
            amid, points, normals, height = (np.add.reduceat(each, starts)[plane] for each in runs)
            for each in (amid, points, normals, height):
                each /= counts[plane].reshape(-1, *(1,) * (each.ndim - 1))
            beside = centers[known] - amid
            up = np.einsum("ij,ij->i", beside, normals)
            found[0][known], found[1][known] = points + beside - up[:, None] * normals, normals
            found[2][known] = height + up
        if not known.all():
            feet = self.base.foot(centers[~known], self.trace.tip_radius)
            for place, values in zip(found, (feet.points, feet.normals, feet.height), strict=True):
                place[~known] = values
        return found

    def known_feet(self, part: slice) -> Feet | None:
        """The feet of some samples in a row if all of them are known by now, else None: nothing is laid."""
        return self.feet(part) if (self._row[part] != NOT_LAID).all() else None

    def touched(self) -> tuple[FloatArray, FloatArray]:
        """Known points of the base under the sweep, and directions from there to the ball, both (M, 3)."""
        if self._all_laid:
            feet = self.feet()
            return feet.points, feet.normals
        bins = self.known_heights()
        known = [(each.feet, each.normals) for each in bins if each.feet is not None and each.normals is not None]
        if not known:
            return np.zeros((0, 3)), np.zeros((0, 3))
        return np.concatenate([points for points, _ in known]), np.concatenate([up for _, up in known])

    def directions(self) -> tuple[FloatArray, FloatArray]:
        """(M, 3) centres of which it is known what lies under them, in the order of time, and their directions."""
        if self._all_laid:
            return self.trace.centers, self.feet().normals
        bins = self.known_heights()
        known = [(each.centers, each.normals) for each in bins if each.normals is not None]
        if not known:
            return np.zeros((0, 3)), np.zeros((0, 3))
        return np.concatenate([centers for centers, _ in known]), np.concatenate([up for _, up in known])

    def kept(self) -> tuple[Feet, NDArray[np.int32]]:
        """Feet of the samples laid by now, and (N,) each sample's row among them, or NOT_LAID: nothing is laid."""
        return self._feet, self._row

    def take(self, feet: Feet, row: IntArray) -> None:
        """Keep the feet of those samples of which they are known from elsewhere, and their rows among them (N,)."""
        known = row != NOT_LAID
        self._feet = _rows(feet, row[known])
        self._row[known] = np.arange(len(self._feet.height))


class LaidTrace(Trace):
    """A trace together with the base under it: wherever a Trace is taken, this one spares laying it down again.

    Args:
        trace: the samples; they are shared, not copied.
        base: the global model.
    """

    base: Base
    laid_sweeps: tuple[LaidSweep, ...]

    def __init__(self, trace: Trace, base: Base, laid_sweeps: tuple[LaidSweep, ...] | None = None) -> None:
        for each in fields(Trace):
            object.__setattr__(self, each.name, getattr(trace, each.name))
        if laid_sweeps is None:
            laid_sweeps = tuple(LaidSweep(number, part, base) for number, part in trace.sweeps())
        object.__setattr__(self, "base", base)
        object.__setattr__(self, "laid_sweeps", laid_sweeps)
        # index of the first sample of each sweep, and the count of all
        starts = np.cumsum([0, *(len(sweep.trace) for sweep in laid_sweeps)]).astype(np.int64)
        object.__setattr__(self, "_starts", starts)
        object.__setattr__(self, "_touched", {})

    @classmethod
    def of(cls, trace: Trace, base: Base) -> LaidTrace:
        """The trace itself if it lies on this base already, else laid on it."""
        return trace if isinstance(trace, cls) and trace.base is base else cls(trace, base)

    @classmethod
    def together(cls, parts: Sequence[Trace], base: Base) -> LaidTrace:
        """Traces of sweeps that have numbers of their own, one after the other; what is known of each stays known."""
        laid = [cls.of(part, base) for part in parts]
        if len(laid) == 1:
            return laid[0]
        return cls(Trace.concatenate(laid), base, tuple(sweep for part in laid for sweep in part.laid_sweeps))

    def touched(self, most: int) -> tuple[FloatArray, FloatArray]:
        """Points of the base under the trace, and directions from there to the ball, both (M, 3).

        Those of which it is known by now, thinned to about `most`; of sweeps without any, means of short stretches.
        """
        kept: dict[int, tuple[FloatArray, FloatArray]] = self.__dict__["_touched"]
        if most not in kept:
            parts = [(sweep, *sweep.touched()) for sweep in self.laid_sweeps]
            rest = {sweep.number for sweep, points, _ in parts if not len(points)}
            step = 1 + sum(len(points) for _, points, _ in parts) // most
            points, up = [p[::step] for _, p, _ in parts], [n[::step] for _, _, n in parts]
            if rest:
                few = self.select(np.isin(self.sweep, list(rest)))
                found = self.base.foot(Cells.of(few, most).centers, self.tip_radius)
                points, up = [*points, found.points], [*up, found.normals]
            kept[most] = np.concatenate([np.zeros((0, 3)), *points]), np.concatenate([np.zeros((0, 3)), *up])
        return kept[most]

    def appended(self, trace: Trace) -> LaidTrace:
        """This one followed by further sweeps; what is known of the earlier ones stays known."""
        more = LaidTrace(trace, self.base)
        whole = Trace.concatenate([self, trace])
        return LaidTrace(whole, self.base, (*self.laid_sweeps, *more.laid_sweeps))

    def of_sweeps(self, numbers: Collection[int]) -> LaidTrace:
        """The sweeps with these numbers, as they lie; of sweeps in a row nothing is copied."""
        wanted, starts = set(numbers), self.__dict__["_starts"]
        picked = [k for k, sweep in enumerate(self.laid_sweeps) if sweep.number in wanted]
        laid = tuple(self.laid_sweeps[k] for k in picked)
        if picked and picked[-1] - picked[0] + 1 == len(picked):
            return LaidTrace(self._view(slice(int(starts[picked[0]]), int(starts[picked[-1] + 1]))), self.base, laid)
        return LaidTrace(self._view(np.isin(self.sweep, list(wanted))), self.base, laid)

    def within(self, keep: BoolArray) -> LaidTrace:
        """The samples that a mask picks, with those of their feet that are known by now."""
        picked = LaidTrace(self.select(keep), self.base)
        kept = [sweep.kept() for sweep in self.laid_sweeps]
        if kept:
            firsts = np.cumsum([0, *(len(feet.height) for feet, _ in kept)])
            feet = _joined([feet for feet, _ in kept])
            rows = np.concatenate(
                [np.where(row == NOT_LAID, row, row + n) for (_, row), n in zip(kept, firsts[:-1], strict=True)]
            )[keep]
            starts: IntArray = picked.__dict__["_starts"]
            for sweep, start, stop in zip(picked.laid_sweeps, starts[:-1], starts[1:], strict=True):
                sweep.take(feet, rows[start:stop])
        return picked

    def directions(self) -> Callable[[FloatArray], FloatArray]:
        """What gives (M, 3) unit directions from the base to centres on the sweeps, m, between those that are known.

        What is known now is laid out once; a centre with nothing known within LONGEST_KNOWN_GAP of a tip radius is laid
        on the base.
        """
        parts = [sweep.directions() for sweep in self.laid_sweeps]
        known = np.concatenate([np.zeros((0, 3)), *(places for places, _ in parts)])
        up = np.concatenate([np.zeros((0, 3)), *(normals for _, normals in parts)])
        if len(known) < 2:
            return lambda centers: self.base.foot(centers, self.tip_radius).normals
        boxed = BoxedPoints(known)

        def between_known(centers: FloatArray) -> FloatArray:
            distance, near = boxed.nearest(centers)
            found = up[near]
            for step in (-1, 1):  # linearly towards the neighbour beyond which the centre does not lie
                beside = np.clip(near + step, 0, len(known) - 1)
                leg = known[beside] - known[near]
                square = np.einsum("ij,ij->i", leg, leg)
                share = np.einsum("ij,ij->i", centers - known[near], leg) / np.maximum(square, np.finfo(float).tiny)
                between = (share > 0.0) & (share < 1.0) & (square < (LONGEST_KNOWN_GAP * self.tip_radius) ** 2)
                found[between] += share[between, None] * (up[beside] - up[near])[between]
            far = distance > LONGEST_KNOWN_GAP * self.tip_radius
            if far.any():
                found[far] = self.base.foot(centers[far], self.tip_radius).normals
            return np.asarray(found / lengths(found)[:, None])

        return between_known

    def feet(self, index: IntArray | None = None) -> Feet:
        """Where samples stand over the base: all, or those with these indices, which ascend."""
        if index is None:
            index = np.arange(len(self), dtype=np.int64)
        starts: IntArray = self.__dict__["_starts"]
        cuts = np.searchsorted(index, starts)
        parts = [
            sweep.feet(index[low:high] - start)
            for sweep, start, low, high in zip(self.laid_sweeps, starts[:-1], cuts[:-1], cuts[1:], strict=True)
            if high > low
        ]
        return _joined(parts) if parts else _empty(0)


def _joined(parts: Sequence[Feet]) -> Feet:
    return Feet(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Feet)))


def _empty(count: int) -> Feet:
    return Feet(
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros(count),
        np.zeros(count, dtype=np.int64),
        np.zeros((count, 3)),
    )


def _run_of(rows: NDArray[np.int32]) -> NDArray[np.int32] | slice:
    """Rows (M,), as a slice where they follow one another: of all that were laid at once nothing is copied."""
    if len(rows) and rows[-1] - rows[0] == len(rows) - 1 and (np.diff(rows) == 1).all():
        return slice(int(rows[0]), int(rows[-1]) + 1)
    return rows


def _rows(feet: Feet, rows: NDArray[np.int32] | IntArray | slice) -> Feet:
    return Feet(*(getattr(feet, each.name)[rows] for each in fields(Feet)))
