"""Spanning tree, cut: links of a tree of crest points that join two lines which only run side by side are removed."""

from __future__ import annotations

from itertools import combinations, permutations

import numpy as np

from mapping import FloatArray

# Neighbours of each point
Tree = dict[int, set[int]]

# A tie is longer than so many half-widths: what really joins two lines over such a way would have been crossed
SHORTEST_TIE = 1.5
# Cosine of the angle between the two ways on of a line that goes straight past a tie, at most
STRAIGHT_PAST = -0.85
# Cosine of the angle between a line that ends and a tie that turns back from its end, at least
TURN_BACK_COSINE = 0.3


def untied(tree: Tree, points: FloatArray, half_width: float) -> list[Tree]:
    """The trees that are left without ties.

    Where no sweep passed between two lines, no inspected place shows that they are two, and a tree of all points has a
    link across. At both its ends a line goes straight past it, or at one of them a line ends from which it turns back,
    and no crossing lies on it.

    Args:
        tree: of points (K, 3), m; not all points need be in it.
        half_width: of the disturbance, m.
    """
    tree = {i: set(near) for i, near in tree.items()}
    for i, j in [(one, other) for one in tree for other in tree[one] if one < other]:
        is_long = np.linalg.norm(points[i] - points[j]) > SHORTEST_TIE * half_width
        ends = [_passes(*way, tree, points, half_width) for way in ((i, j), (j, i))] if is_long else [False]
        if all(ends) or (any(ends) and any(_turns_back(*way, tree, points, half_width) for way in ((i, j), (j, i)))):
            tree[i].discard(j)
            tree[j].discard(i)
    return _parts(tree)


def way_from(i: int, first: int, tree: Tree, points: FloatArray, reach: float) -> FloatArray:
    """Unit direction (3,) in which the line goes from a point by way of a neighbour, over at least `reach` m."""
    path = [i, first]
    while len(tree[path[-1]]) == 2 and np.linalg.norm(points[path[-1]] - points[i]) < reach:
        path.append(next(j for j in tree[path[-1]] if j != path[-2]))
    way = points[path[-1]] - points[i]
    return np.asarray(way / max(float(np.linalg.norm(way)), np.finfo(float).tiny))


def _passes(i: int, tied: int, tree: Tree, points: FloatArray, half_width: float) -> bool:
    """True if a line goes straight on through a point, or close beside it, past its link to another one."""
    others = sorted(tree[i] - {tied})
    close = [near for near in others if np.linalg.norm(points[near] - points[i]) < half_width]
    return (
        _goes_on(i, tied, tree, points, half_width)
        or any(_goes_on(near, i, tree, points, half_width) for near in close)
        or any(_goes_beside(i, *pair, tree, points, half_width) for pair in permutations(others, 2))
    )


def _goes_on(i: int, tied: int, tree: Tree, points: FloatArray, half_width: float) -> bool:
    """True if a line goes straight on through a point, past its link to another one."""
    ways = [way_from(i, near, tree, points, half_width) for near in sorted(tree[i]) if near != tied]
    return any(float(a @ b) < STRAIGHT_PAST for a, b in combinations(ways, 2))


def _goes_beside(i: int, first: int, last: int, tree: Tree, points: FloatArray, half_width: float) -> bool:
    """True if a line goes straight on from one neighbour of a point to another, the point lying off it by chance."""
    leg = points[last] - points[first]
    leg = leg / max(float(np.linalg.norm(leg)), np.finfo(float).tiny)
    off = points[i] - points[first]
    if np.linalg.norm(off - (off @ leg) * leg) > half_width:
        return False
    before = [way_from(first, near, tree, points, half_width) for near in tree[first] if near != i]
    return any(float(way @ leg) < STRAIGHT_PAST for way in before)


def _turns_back(i: int, tied: int, tree: Tree, points: FloatArray, half_width: float) -> bool:
    """True if the one line that ends in a point comes to it from the side to which its link to another one leads."""
    ways = [way_from(i, near, tree, points, half_width) for near in sorted(tree[i]) if near != tied]
    return len(ways) == 1 and float(ways[0] @ way_from(i, tied, tree, points, half_width)) > TURN_BACK_COSINE


def _parts(tree: Tree) -> list[Tree]:
    """The connected parts of a forest."""
    left, parts = dict(tree), []
    while left:
        part, waiting = set[int](), [next(iter(left))]
        while waiting:
            i = waiting.pop()
            part.add(i)
            waiting += [j for j in tree[i] if j not in part]
        parts.append({i: left.pop(i) for i in sorted(part)})
    return parts
