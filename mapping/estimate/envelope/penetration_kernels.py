"""Nearest of many ball centres along sweeps, compiled: boxes about pieces of the sweeps, and a tree over them."""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray
from mapping.geometry.mesh import MOST_WAITING, POINTS_PER_BOX, borrowing, inlined


@njit(cache=True, error_model="numpy", nogil=True)
def nearest_within(centers: FloatArray, boxes: FloatArray, points: FloatArray, reach: float) -> FloatArray:
    """(N,) distance of each point (N, 3) from the nearest centre (M, 3) that is nearer than `reach`, else infinite."""
    out = np.empty(len(points))
    waiting = np.empty(MOST_WAITING, np.int64)
    for n in range(len(points)):
        out[n] = np.inf
        square, found = nearest_center(centers, boxes, points[n, 0], points[n, 1], points[n, 2], reach * reach, waiting)
        if found >= 0:
            out[n] = np.sqrt(square)
    return out


@borrowing
def nearest_center(centers, boxes, x, y, z, best, waiting):  # type: ignore[no-untyped-def]
    """(squared distance, index) of the centre nearest to a point, of those whose square is below `best`; else -1.

    `waiting`: (MOST_WAITING,) to work in.
    """
    leaves, found = len(boxes) // 2, -1
    top, waiting[0] = 1, 1
    while top:
        top -= 1
        box = waiting[top]
        if _apart(boxes, box, x, y, z) >= best:
            continue
        if box < leaves:
            first, second = 2 * box, 2 * box + 1
            if _apart(boxes, second, x, y, z) < _apart(boxes, first, x, y, z):
                first, second = second, first
            waiting[top], waiting[top + 1] = second, first  # the nearer next
            top += 2
            continue
        start = (box - leaves) * POINTS_PER_BOX
        for i in range(start, min(start + POINTS_PER_BOX, len(centers))):
            square = (centers[i, 0] - x) ** 2 + (centers[i, 1] - y) ** 2 + (centers[i, 2] - z) ** 2
            if square < best:
                best, found = square, i
    return best, found


@inlined
def _apart(boxes, box, x, y, z):  # type: ignore[no-untyped-def]
    """Squared distance of a point from a box."""
    u = max(boxes[box, 0] - x, 0.0, x - boxes[box, 3])
    v = max(boxes[box, 1] - y, 0.0, y - boxes[box, 4])
    w = max(boxes[box, 2] - z, 0.0, z - boxes[box, 5])
    return u * u + v * v + w * w
