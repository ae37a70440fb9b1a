"""Linking: which crossings of different sweeps belong to one line on the base, and in which order."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapping.crossing import Crossing
from mapping.inspection import Inspection

FloatArray = NDArray[np.float64]

# Crossings further apart than this many sweep distances are not linked, whatever lies between.
LONGEST_LINK = 6.0
# Linked crossings differ in height by less than this factor: sweeps beside an end see less of it.
HEIGHT_RATIO = 0.2
# A place so near to a supposed line, in half-widths, must have felt it.
FELT = 0.4


def groups(crossings: Sequence[Crossing], inspection: Inspection, scale: float) -> list[list[int]]:
    """Connected components of the crossings under `linked` (indices), by a minimum spanning forest."""
    parent = list(range(len(crossings)))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    points = np.array([c.point for c in crossings])
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    reach = LONGEST_LINK * max(min(inspection.pitch, 1e300), scale)
    first, second = np.nonzero(np.triu(distance <= reach, 1))
    for k in np.argsort(distance[first, second], kind="stable"):
        i, j = int(first[k]), int(second[k])
        if root(i) != root(j) and linked(crossings[i], crossings[j], inspection, scale):
            parent[root(i)] = root(j)
    members: dict[int, list[int]] = {}
    for i in range(len(crossings)):
        members.setdefault(root(i), []).append(i)
    return sorted(members.values())


def linked(a: Crossing, b: Crossing, inspection: Inspection, scale: float) -> bool:
    """True if both may be the same line: like heights, and no place between them denies it."""
    low, high = sorted((abs(a.height), abs(b.height)))
    if low < HEIGHT_RATIO * high or a.normal @ b.normal < 0:
        return False
    if a.kind.startswith("step") and uphill(a) @ uphill(b) < 0:
        return False
    if a.kind.startswith("step") and low < 0.5 * high:
        return False
    if a.kind.startswith("step"):
        return True
    return not inspection.denies(_between(a.point, b.point, scale), np.sign(a.height) * low, FELT * scale)


def uphill(crossing: Crossing) -> FloatArray:
    """(3,) direction along the sweep in which a step rises."""
    return crossing.tangent if crossing.kind == "step up" else -crossing.tangent


def order(points: FloatArray) -> tuple[list[int], list[list[int]]]:
    """The longest path through the minimum spanning tree of points (K, 3), and the branches that leave it."""
    count = len(points)
    if count == 1:
        return [0], []
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    neighbours: list[list[int]] = [[] for _ in range(count)]
    nearest, best = np.zeros(count, dtype=int), distance[0].copy()
    outside = set(range(1, count))
    while outside:
        new = min(outside, key=lambda i: float(best[i]))
        neighbours[new].append(int(nearest[new]))
        neighbours[int(nearest[new])].append(new)
        outside.remove(new)
        closer = distance[new] < best
        nearest[closer], best = new, np.minimum(best, distance[new])
    far = _farthest(neighbours, distance, 0, set())[-1]
    main = _farthest(neighbours, distance, far, set())
    branches: list[list[int]] = []
    used = set(main)
    while True:
        stems = [(i, j) for i in used for j in neighbours[i] if j not in used]
        if not stems:
            return main, branches
        longest = max(
            ([i, *_farthest(neighbours, distance, j, {i})] for i, j in stems), key=lambda p: _path_length(distance, p)
        )
        branches.append(longest)
        used |= set(longest)


def _farthest(neighbours: list[list[int]], distance: FloatArray, start: int, banned: set[int]) -> list[int]:
    """The path from start to the node of its tree with the greatest distance along the tree."""
    best_path, best_length = [start], 0.0
    stack = [([start], 0.0)]
    while stack:
        path, length = stack.pop()
        if length > best_length:
            best_path, best_length = path, length
        for node in neighbours[path[-1]]:
            if node not in banned and (len(path) < 2 or node != path[-2]):
                stack.append(([*path, node], length + float(distance[path[-1], node])))
    return best_path


def _path_length(distance: FloatArray, path: list[int]) -> float:
    return float(sum(distance[i, j] for i, j in itertools.pairwise(path)))


def _between(start: FloatArray, stop: FloatArray, scale: float) -> FloatArray:
    """Points of the segment, half a half-width off its ends."""
    length = float(np.linalg.norm(stop - start))
    off = 0.5 * scale
    if length <= 2 * off:
        return np.zeros((0, 3))
    at = np.linspace(off, length - off, max(2, int((length - 2 * off) / (0.25 * scale)) + 1)) / length
    return np.asarray(start + at[:, None] * (stop - start))
