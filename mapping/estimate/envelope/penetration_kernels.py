"""Nearest of many ball centres along sweeps, compiled: boxes about pieces of the sweeps, and a tree over them."""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray
from mapping.geometry.mesh import borrowing, inlined

# Centres to a box. Neighbours along a sweep lie in small boxes without any sorting; of 8, 16 and 32 on a raster of 1e5
# samples, 16 took least time
CENTERS_PER_BOX = 16
MOST_WAITING = 64  # one box a level at most, and fewer levels than bits of a number


@njit(cache=True, error_model="numpy", nogil=True)
def boxes_of(centers: FloatArray) -> FloatArray:
    """(2 M, 6) lower and upper corners: leaf m of M, a power of two, is box M + m; box k holds 2 k and 2 k + 1."""
    leaves = 1
    while leaves * CENTERS_PER_BOX < len(centers):
        leaves *= 2
    boxes = np.empty((2 * leaves, 6))
    boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
    for i in range(len(centers)):
        box = leaves + i // CENTERS_PER_BOX
        for c in range(3):
            boxes[box, c] = min(boxes[box, c], centers[i, c])
            boxes[box, 3 + c] = max(boxes[box, 3 + c], centers[i, c])
    for box in range(leaves - 1, 0, -1):
        for c in range(3):
            boxes[box, c] = min(boxes[2 * box, c], boxes[2 * box + 1, c])
            boxes[box, 3 + c] = max(boxes[2 * box, 3 + c], boxes[2 * box + 1, 3 + c])
    return boxes


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
        start = (box - leaves) * CENTERS_PER_BOX
        for i in range(start, min(start + CENTERS_PER_BOX, len(centers))):
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
