"""Line ends: how far a ridge or groove goes beyond its last crossing, and whether it closes on its own beginning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, Interval
from mapping.assembly.linking.inspection import Inspection
from mapping.geometry.mesh import arclengths
from mapping.geometry.templates import crest_trace, robust_cost

# Rise of the misfit (twice the log-likelihood) at the ends of a central 90 % interval, and where a line may be said
# not to go on.
INTERVAL_MISFIT_RISE, END_MISFIT_RISE = 2.7, 9.0
# In half-widths: how far back from the last crossing the end may lie, and places so far aside that tell of it.
END_REACH_BACK, END_REACH_ASIDE = 1.2, 1.3
END_SEARCH_STEPS = 120


@dataclass(frozen=True, eq=False)
class LineEnd:
    """The end of an axis.

    Args:
        point: (3,) m.
        low, high: how much shorter and longer the line may be than to the point, m (90 % interval).
        seen: False if nothing was inspected that could have shown the end: the point is as far as it certainly goes.
        dropped: number of the axis' points that lie beyond it.
    """

    point: FloatArray
    low: float
    high: float
    seen: bool
    dropped: int


def line_end(axis: FloatArray, height: float, half_width: float, inspection: Inspection, longest: float) -> LineEnd:
    """The last end of an axis (K, 3), K > 1.

    Args:
        axis: points of the crest in order, m.
        height: signed height of the crest, m.
        half_width: of the disturbance, m.
        inspection: heights of the inspected places.
        longest: distance beyond the last point up to which the line may go unseen, m.
    """
    anchor, way, length = _last_leg(axis, END_REACH_BACK * half_width)
    farthest = anchor + (length + longest + half_width) * way
    places = inspection.near(np.stack([anchor, farthest]), END_REACH_ASIDE * half_width)
    offset = inspection.points[places] - anchor
    along = offset @ way
    across = np.linalg.norm(offset - np.outer(along, way), axis=1)
    step = (length + longest) / END_SEARCH_STEPS
    near = (along > 0) & (along < length + longest + half_width) & (across < END_REACH_ASIDE * half_width)
    reach = step * np.arange(1, END_SEARCH_STEPS + 1)
    beyond = np.maximum(along[near][:, None] - reach, 0.0)
    model = crest_trace(np.hypot(beyond, across[near][:, None]), height, half_width)
    rise = robust_cost(inspection.height[places[near]][:, None] - model, inspection.sd[places[near], None], height).sum(
        axis=0
    )
    rise -= rise.min()
    likely = reach[rise <= INTERVAL_MISFIT_RISE]
    seen = bool(rise[-1] > END_MISFIT_RISE)
    best = float(0.5 * (likely[0] + likely[-1]) if seen else likely[0])
    # the ball leaves a hollow's floor line half a width before the rim at its end
    rim = half_width if height < 0 else 0.0
    beyond_end = int(((axis - anchor) @ way > best + rim)[_index_of(axis, anchor) :].sum())
    return LineEnd(anchor + (best + rim) * way, best - float(likely[0]), float(likely[-1]) - best, seen, beyond_end)


def ended_length(axis: FloatArray, ends: list[LineEnd]) -> Interval:
    """Length of an axis (K, 3) with its ends: at least so much where one was not seen, m."""
    length = float(arclengths(axis)[-1])
    shorter = float(np.hypot.reduce([end.low for end in ends])) if ends else 0.0
    longer = float(np.hypot.reduce([end.high for end in ends])) if ends else 0.0
    return Interval(length, max(length - shorter, 0.0), length + longer, not all(end.seen for end in ends))


def _last_leg(axis: FloatArray, back: float) -> tuple[FloatArray, FloatArray, float]:
    """The axis point at least `back` before the last one (or the first of all), the way and the distance from it."""
    s = arclengths(axis)
    k = max(0, int(np.searchsorted(s, s[-1] - back, side="right")) - 1)
    leg = axis[-1] - axis[k]
    length = float(np.linalg.norm(leg))
    return axis[k], leg / max(length, np.finfo(float).tiny), length


def _index_of(axis: FloatArray, point: FloatArray) -> int:
    return int(np.linalg.norm(axis - point, axis=1).argmin())


# A gap longer than this share of the line, or than so many half-widths of its disturbance, does not close.
LONGEST_SHARE, LONGEST_CLOSING_GAP = 0.5, 6.0
# How much longer than the gap the arc over it is, for one that turns by a right angle.
ARC = 1.3


def closes(axis: FloatArray, height: float, half_width: float, inspection: Inspection) -> bool:
    """True if a smooth arc from the end of an axis (K, 3) back to its start meets no place found clearly lower."""
    gap = float(np.linalg.norm(axis[-1] - axis[0]))
    if len(axis) < 4 or gap > min(LONGEST_SHARE * arclengths(axis)[-1], LONGEST_CLOSING_GAP * half_width):
        return False
    out, back = axis[-1] - axis[-2], axis[1] - axis[0]
    out, back = ARC * gap * out / np.linalg.norm(out), ARC * gap * back / np.linalg.norm(back)
    t = np.linspace(0.0, 1.0, 25)[2:-2, None]
    # Hermite's cubic between the ends, along the headings there
    arc = (2 * t**3 - 3 * t**2 + 1) * axis[-1] + (t**3 - 2 * t**2 + t) * out
    arc += (3 * t**2 - 2 * t**3) * axis[0] + (t**3 - t**2) * back
    return not inspection.denies(arc, height, 0.25 * half_width)
