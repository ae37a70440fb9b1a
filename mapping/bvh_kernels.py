"""A tree of bounding boxes over triangles, built top down in place (numba)."""

from __future__ import annotations

from math import inf

import numpy as np
from numba import njit

LEAF = 4  # triangles per leaf: below, boxes cost more than triangles
DEPTH = 64  # deeper splits halve by number, so that no tree is deeper than STACK
STACK = 128


@njit(cache=True, error_model="numpy")
def build_tree(corners):  # type: ignore[no-untyped-def]
    """Split triangles (F, 3, 3) at the middle of their centroids' longest extent.

    Returns:
        order: (F,) int32, triangles in the order of the leaves.
        boxes: (M, 6) smallest and largest coordinates of each node.
        links: (M, 2) int32: (first child, 0) of an inner node, whose children are neighbours;
            (first triangle in the order, number of triangles) of a leaf.
    """
    count = len(corners)
    order = np.arange(count).astype(np.int32)
    boxes = np.empty((2 * count, 6))
    links = np.empty((2 * count, 2), np.int32)
    todo = np.empty((STACK, 4), np.int64)  # node, first, last + 1, depth
    todo[0, 0], todo[0, 1], todo[0, 2], todo[0, 3] = 0, 0, count, 0
    waiting, used = 1, 1
    while waiting > 0:
        waiting -= 1
        node, first, end, depth = todo[waiting, 0], todo[waiting, 1], todo[waiting, 2], todo[waiting, 3]
        axis, middle, extent = bound(corners, order, first, end, boxes[node])
        if end - first <= LEAF:
            links[node, 0], links[node, 1] = first, end - first
            continue
        cut = first
        if depth < DEPTH and extent > 0.0:
            cut = partition(corners, order, first, end, axis, middle)
        if cut in (first, end):
            cut = (first + end) // 2
        links[node, 0], links[node, 1] = used, 0
        for child, low, high in ((used, first, cut), (used + 1, cut, end)):
            todo[waiting, 0], todo[waiting, 1], todo[waiting, 2], todo[waiting, 3] = child, low, high, depth + 1
            waiting += 1
        used += 2
    return order, boxes[:used].copy(), links[:used].copy()


@njit(cache=True, error_model="numpy")
def bound(corners, order, first, end, box):  # type: ignore[no-untyped-def]
    """Write the triangles' box; return where to split: axis, middle (three times, as centroids) and extent."""
    axis, middle, extent = 0, 0.0, -1.0
    for k in range(3):
        low, high, centre_low, centre_high = inf, -inf, inf, -inf
        for i in range(first, end):
            j = order[i]
            a, b, c = corners[j, 0, k], corners[j, 1, k], corners[j, 2, k]
            low, high = min(low, a, b, c), max(high, a, b, c)
            centre_low, centre_high = min(centre_low, a + b + c), max(centre_high, a + b + c)
        box[k], box[3 + k] = low, high
        if centre_high - centre_low > extent:
            axis, middle, extent = k, 0.5 * (centre_low + centre_high), centre_high - centre_low
    return axis, middle, extent


@njit(cache=True, error_model="numpy")
def partition(corners, order, first, end, axis, middle):  # type: ignore[no-untyped-def]
    """Move triangles below the middle to the front; return where the others begin."""
    i, j = first, end - 1
    while i <= j:
        t = order[i]
        if corners[t, 0, axis] + corners[t, 1, axis] + corners[t, 2, axis] < middle:
            i += 1
        else:
            order[i], order[j] = order[j], t
            j -= 1
    return i
