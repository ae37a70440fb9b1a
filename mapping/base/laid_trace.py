"""LaidTrace: a trace on its base; where it stands over the base, how high, and how far along, each computed once."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import fields

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Trace
from mapping.base.base import Base, Feet
from mapping.base.height_profile import SweepHeights, arclength, height_profiles


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
        self._feet: Feet | None = None
        self._laid: BoolArray = np.zeros(len(trace), dtype=bool)

    @property
    def arclength(self) -> FloatArray:
        """(N,) along the base's trace under the sweep, m (see height_profile.arclength)."""
        if self._arclength is None:
            self._arclength = arclength(self.trace, self.base)
        return self._arclength

    def heights(self, spacing: float) -> tuple[SweepHeights, ...]:
        """Mean heights in bins of a width (m), one profile for each piece without a gap."""
        if spacing not in self._heights:
            self._heights[spacing] = height_profiles(
                self.number, self.trace, self.arclength, self.base, spacing, self.feet
            )
        return self._heights[spacing]

    def feet(self, index: slice | IntArray = slice(None)) -> Feet:
        """Where some of the samples stand; each sample is laid on the base the first time that it is asked for."""
        which = np.arange(len(self.trace))[index]
        new = which[~self._laid[which]]
        if self._feet is None:
            self._feet = _empty(len(self.trace))
        if len(new):
            _put(self._feet, new, self.base.foot(self.trace.centers[new], self.trace.tip_radius))
            self._laid[new] = True
        return Feet(*(getattr(self._feet, each.name)[index] for each in fields(Feet)))

    def take(self, feet: Feet, start: int) -> None:
        """Keep the feet of all samples, which were found elsewhere: they begin at `start` in `feet`."""
        own = slice(start, start + len(self.trace))
        self._feet = Feet(*(getattr(feet, each.name)[own] for each in fields(Feet)))
        self._laid[:] = True


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

    @classmethod
    def of(cls, trace: Trace, base: Base) -> LaidTrace:
        """The trace itself if it lies on this base already, else laid on it."""
        return trace if isinstance(trace, cls) and trace.base is base else cls(trace, base)

    def appended(self, trace: Trace) -> LaidTrace:
        """This one followed by further sweeps; what is known of the earlier ones stays known."""
        more = LaidTrace(trace, self.base)
        whole = Trace.concatenate([self, trace])
        return LaidTrace(whole, self.base, (*self.laid_sweeps, *more.laid_sweeps))

    def of_sweeps(self, numbers: Collection[int]) -> LaidTrace:
        """The sweeps with these numbers, as they lie."""
        wanted = set(numbers)
        keep = np.isin(self.sweep, list(wanted))
        laid = tuple(sweep for sweep in self.laid_sweeps if sweep.number in wanted)
        return LaidTrace(self._view(keep), self.base, laid)

    def within(self, keep: BoolArray) -> LaidTrace:
        """The samples that a mask picks, with their feet."""
        kept = LaidTrace(self.select(keep), self.base)
        feet, start = self.feet(np.flatnonzero(keep)), 0
        for sweep in kept.laid_sweeps:
            sweep.take(feet, start)
            start += len(sweep.trace)
        return kept

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
        if not parts:
            return _empty(0)
        return Feet(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Feet)))


def _empty(count: int) -> Feet:
    return Feet(
        np.empty((count, 3)),
        np.empty((count, 3)),
        np.empty(count),
        np.empty(count, dtype=np.int64),
        np.empty((count, 3)),
    )


def _put(feet: Feet, index: IntArray, found: Feet) -> None:
    for each in fields(Feet):
        getattr(feet, each.name)[index] = getattr(found, each.name)
