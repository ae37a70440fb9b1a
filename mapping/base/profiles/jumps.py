"""Jumps: steps that a profile's base does not follow, so that it keeps to one of their levels."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, IntArray
from mapping.geometry.templates import contact_half_width
from mapping.instrument import robust_scale

# Of the length: what keeps to another level for less is a detail of the level beside it, and what is a detail is no
# longer (`assembly.free`). A 16th and a fifth find the same 18 steps and 20 slots of 20 each
SHORTEST_LEVEL = 1 / 8
# A difference between neighbours that leaves the usual ones by so many of their scatter may be an edge: noise does
# once in a million profiles of 480 places. Of 20 steps 4 finds 17, 6 and 8 18 (`explore3d bench profiles`, seeds 200
# to 219)
JUMP_SDS = 6.0
# Of that difference so much must be left between the medians of the levels on either side, and the same the other
# way: of a slope each difference is only a part. A half lets half of an edge lie in a cell of its own; 0.3 and 0.7 do
# the same
KEPT_SHARE = 0.5
# Edges that are looked at, the highest: a staircase has no more levels of the shortest length
MOST_JUMPS = 7
# Places that an edge may take, of which the narrowest over which it rises is taken: the ball rolls over the edge of a
# step on an arc that falls by x^2 / 2 r at x beside its top, so the lower half of the way makes three quarters of the
# height: one of doubled widths is between a half of the way and all of it. What rises over more is a slope
WIDTHS_OF_EDGE = (1, 2, 4, 8, 16, 32, 64, 128)
# Places beyond the last edge, or before the first, at least: what is there does not come back, so it is no detail
# however short it is, and its median bears one place on the edge itself
FEWEST_AT_END = 3


def possible_jumps(x: FloatArray, z: FloatArray, scale: float, tip_radius: float) -> IntArray:
    """Indices i between which and i + 1 a profile may step, for good, from one level to another; the highest first.

    Args:
        x, z: (N,) the profile in the order of x, m.
        scale: scatter of it from place to place, m.
        tip_radius: of the ball, m: over an edge it rises on an arc of its own radius.
    """
    side = int(0.5 * SHORTEST_LEVEL * len(z))
    if side < 3:
        return np.zeros(0, dtype=np.int64)
    found = list[tuple[float, int]]()
    for width in WIDTHS_OF_EDGE[: int(np.searchsorted(WIDTHS_OF_EDGE, side, side="right"))]:
        narrower = [i for _, i in found]
        told = rises(x, z, scale, tip_radius, width, side)
        found += [(rise, i) for rise, i in told if not _near(i, narrower, width)]
    return np.array([i for _, i in sorted(found, key=lambda each: -each[0])[: 2 * MOST_JUMPS]], dtype=np.int64)


def rises(
    x: FloatArray, z: FloatArray, scale: float, tip_radius: float | None, width: int, side: int
) -> list[tuple[float, int]]:
    """How high a profile rises for good over so many places, and after which index the middle of that lies.

    Args:
        x, z, scale: as for `possible_jumps`.
        tip_radius: of the ball that rolls over upright edges, m; None: climbs may be as gentle as they are.
        width: places.
        side: places of a level on either side.
    """
    rise, run = z[width:] - z[:-width], x[width:] - x[:-width]
    off = rise - np.median(rise)
    usual = max(robust_scale(off), np.sqrt(2.0) * scale, np.finfo(float).tiny)
    slope = np.median(np.diff(z) / np.maximum(np.diff(x), np.finfo(float).tiny))
    edge = np.abs(off) > JUMP_SDS * usual
    if width > 1 and tip_radius is not None:
        edge &= run <= contact_half_width(np.minimum(np.abs(off), tip_radius), 0.0, tip_radius)
    found = list[tuple[float, int]]()
    for i in sorted(np.flatnonzero(edge), key=lambda i: -abs(off[i])):
        middle = int(i) + (width - 1) // 2
        before, after = slice(max(i + 1 - side, 0), i + 1), slice(i + width, i + width + side)
        if min(i + 1, len(z) - i - width) < FEWEST_AT_END or _near(middle, [each for _, each in found], width):
            continue
        level = np.median(z[after] - slope * x[after]) - np.median(z[before] - slope * x[before])
        if KEPT_SHARE < level / off[i] < 1.0 / KEPT_SHARE:
            found.append((abs(off[i]), middle))
    return found


def _near(index: int, others: list[int], width: int) -> bool:
    """True of what lies within so many places of another, wider than one."""
    return width > 1 and any(abs(index - other) < width for other in others)


def told_apart(heights: FloatArray, within: float) -> FloatArray:
    """(L,) levels of heights over the base, m, the base's own first: those no farther from a lower one than is within
    the scatter of a place are that one. A profile that comes back to a level does so but for its noise."""
    levels = [0.0]
    for height in sorted(heights, key=abs):
        if min(abs(height - level) for level in levels) > within:
            levels.append(float(height))
    return np.array(levels)
