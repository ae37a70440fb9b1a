"""Linking: single linkage of crossings that belong to one detail on the base, with a veto by what was inspected.

Reference: Gower and Ross, Minimum spanning trees and single linkage cluster analysis, Applied Statistics 18, 1969;
theory section 5.2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapping import FloatArray
from mapping.assembly.linking.inspection import Inspection
from mapping.detection import Crossing

# Crossings further apart than this many sweep distances are not linked, whatever lies between.
LONGEST_LINK = 6.0
# A line crossed at a slant lies no farther aside of the sweep than so many times what the crossing's width says: once,
# of a straight line of the usual height. Grooves and bars at 2.9 to 60 degrees are linked with 1.2 to 6; with 3 two
# ridges of one log are one group
AS_SLANTED = 1.5
# Linked crossings differ in height by less than this factor: sweeps beside an end see less of it.
HEIGHT_RATIO = 0.2
# A place so near to a supposed line, in half-widths, must have felt it.
FELT_REACH = 0.4


def groups(crossings: Sequence[Crossing], inspection: Inspection, scale: float) -> list[list[int]]:
    """Connected components of the crossings under `linked` (indices), by a minimum spanning forest."""
    parent = list(range(len(crossings)))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    points = np.array([c.point for c in crossings])
    # the next sweep meets a line that is crossed at a slant as many times farther on as the crossing is wider
    slant = np.array([max(c.half_width / scale, 1.0) for c in crossings])
    along = np.array([c.tangent for c in crossings])
    pairs = _pairs(points, along, LONGEST_LINK * max(min(inspection.pitch, 1e300), scale), slant)
    for i, j in pairs:
        if root(i) != root(j) and linked(crossings[i], crossings[j], inspection, scale):
            parent[root(i)] = root(j)
    members: dict[int, list[int]] = {}
    for i in range(len(crossings)):
        members.setdefault(root(i), []).append(i)
    return sorted(members.values())


def _pairs(points: FloatArray, along: FloatArray, reach: float, slant: FloatArray) -> list[tuple[int, int]]:
    """Pairs of points (N, 3) no further apart than `reach`, m, or, on sweeps that went along (N, 3), as many times that
    as both are slanted (N,), and as near to either sweep as a line at that slant; the nearest first."""
    from scipy.spatial import cKDTree

    # each within its own reach: one that is slanted most would else pair all with all
    near_each = cKDTree(points).query_ball_point(points, reach * slant)
    first = np.repeat(np.arange(len(points)), [len(each) for each in near_each])
    pairs = np.column_stack([first, np.concatenate(near_each).astype(np.int64)])
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    way = points[pairs[:, 1]] - points[pairs[:, 0]]
    distance = np.linalg.norm(way, axis=1)
    far = np.ones(len(pairs), dtype=bool)
    for own in pairs.T:
        aside = np.linalg.norm(np.cross(way, along[own]), axis=1)
        far &= (distance <= reach * slant[own]) & (aside * slant[own] <= AS_SLANTED * distance)
    near = (distance <= reach) | far
    pairs, distance = pairs[near], distance[near]
    return [(int(i), int(j)) for i, j in pairs[np.lexsort((pairs[:, 1], pairs[:, 0], distance))]]


def linked(a: Crossing, b: Crossing, inspection: Inspection, scale: float) -> bool:
    """True if both may be the same line: like heights, and no inspected place between them is clearly lower; steps that
    rise from one level."""
    low, high = sorted((abs(a.height), abs(b.height)))
    if low < HEIGHT_RATIO * high or a.normal @ b.normal < 0:
        return False
    if a.is_step and uphill(a) @ uphill(b) < 0:
        return False
    if a.is_step and low < 0.5 * high:
        return False
    if a.is_step:
        return abs(_foot_of_step(a, inspection) - _foot_of_step(b, inspection)) < 0.5 * low
    return not inspection.denies(between(a.point, b.point, scale), np.sign(a.height) * low, FELT_REACH * scale)


def _foot_of_step(step: Crossing, inspection: Inspection) -> float:
    """Height that a step rises from, m: of its sweep's places before it, as far off as it was disturbed and once more,
    or of the nearest of them."""
    own = inspection.of_sweep(step.sweep)
    before = (step.point - inspection.points[own]) @ uphill(step) - step.half_width
    own, before = own[before > 0.0], before[before > 0.0]
    if not len(own):
        return 0.0
    return float(np.median(inspection.height[own[before <= max(step.half_width, before.min())]]))


def uphill(crossing: Crossing) -> FloatArray:
    """(3,) direction along the sweep in which a step rises."""
    return crossing.tangent if crossing.kind == "step up" else -crossing.tangent


def between(start: FloatArray, stop: FloatArray, scale: float) -> FloatArray:
    """Points of the segment, half a half-width off its ends."""
    length = float(np.linalg.norm(stop - start))
    off = 0.5 * scale
    if length <= 2 * off:
        return np.zeros((0, 3))
    at = np.linspace(off, length - off, max(2, int((length - 2 * off) / (0.25 * scale)) + 1)) / length
    return np.asarray(start + at[:, None] * (stop - start))
