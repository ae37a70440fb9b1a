"""Unclimbed levels: sweeps side by side that run on different levels of a fitted base, and none climbs between."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.base import LaidSweep, LaidTrace

# Share of a sweep that must keep to one level: what crosses an edge anywhere but near its ends keeps to none so long
_KEEPS = 0.8


@dataclass(frozen=True, eq=False)
class UnclimbedLevel:
    """By how much (signed) the sweeps from `behind` on stand over those up to `before`, m, the place midway between the
    centres of these two, m, and how far they are apart, m."""

    height: float
    before: int
    behind: int
    place: FloatArray
    apart: float


def unclimbed_levels(trace: LaidTrace) -> list[UnclimbedLevel]:
    """Where the level changes from one sweep to the next: a step along the sweeps, or the instrument's own.

    Args:
        trace: laid on its base, and searched: the heights are those that are known by now.
    """
    levels = trace.base.levels
    if len(levels) < 2:
        return []
    rows = [(sweep, level) for sweep in trace.laid_sweeps if (level := _own(sweep, levels)) is not None]
    found: list[UnclimbedLevel] = []
    begun: LaidSweep | None = None
    climbed = 0.0
    for (one, here), (other, there) in itertools.pairwise(rows):
        if here == there:
            continue
        by = float(levels[there] - levels[here])
        # neighbours that all differ, one way, stand on the arc of one edge
        if begun is None or found[-1].behind != one.number or climbed * by < 0.0:
            begun, climbed = one, 0.0
            found.append(UnclimbedLevel(0.0, one.number, one.number, _middle(one), 0.0))
        climbed += by
        first, last = _middle(begun), _middle(other)
        apart = float(np.linalg.norm(last - first))
        found[-1] = UnclimbedLevel(climbed, begun.number, other.number, 0.5 * (first + last), apart)
    return found


def _own(sweep: LaidSweep, levels: FloatArray) -> int | None:
    """The level that nearly all of a sweep runs on; None if it runs on several, or was not looked at."""
    pieces = sweep.known_heights()
    if not pieces:
        return None
    height = np.concatenate([piece.height for piece in pieces])
    count = np.bincount(np.abs(height[:, None] - levels).argmin(axis=1), minlength=len(levels))
    return int(count.argmax()) if count.max() > _KEEPS * len(height) else None


def _middle(sweep: LaidSweep) -> FloatArray:
    return np.asarray(np.median(sweep.trace.centers, axis=0))
