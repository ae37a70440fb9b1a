"""Boxes about points of which neighbours follow one another, and about such boxes, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping.geometry.mesh.borrowing_kernels import borrowing, inlined
from mapping.geometry.mesh.vector_kernels import vector

# Points to a box. Neighbours along a sweep lie in small boxes without any sorting; of 8, 16 and 32 on a raster of 1e5
# samples, 16 took least time
POINTS_PER_BOX = 16
MOST_WAITING = 64  # one box a level at most, and fewer levels than bits of a number


@njit(cache=True, error_model="numpy", nogil=True)
def boxes_about(points):  # type: ignore[no-untyped-def]
    """(2 M, 6) lower and upper corners: leaf m of M, a power of two, is box M + m; box k holds 2 k and 2 k + 1."""
    leaves = 1
    while leaves * POINTS_PER_BOX < len(points):
        leaves *= 2
    boxes = np.empty((2 * leaves, 6))
    boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
    for i in range(len(points)):
        box = leaves + i // POINTS_PER_BOX
        for c in range(3):
            boxes[box, c] = min(boxes[box, c], points[i, c])
            boxes[box, 3 + c] = max(boxes[box, 3 + c], points[i, c])
    for box in range(leaves - 1, 0, -1):
        for c in range(3):
            boxes[box, c] = min(boxes[2 * box, c], boxes[2 * box + 1, c])
            boxes[box, 3 + c] = max(boxes[2 * box, 3 + c], boxes[2 * box + 1, 3 + c])
    return boxes


@njit(cache=True, error_model="numpy", nogil=True)
def nearest_within(points, boxes, places, reach, distance, number):  # type: ignore[no-untyped-def]
    """Write the number of the boxed point nearest to each place (N, 3), looked for from the one before on, and how far
    it is; len(points) and infinity where none is nearer than `reach`."""
    waiting, near = np.empty(MOST_WAITING, np.int64), 0
    for n in range(len(places)):
        square, found = nearest_from(points, boxes, near, vector(places, n), reach * reach, waiting)
        near = found if found >= 0 else near
        distance[n] = np.sqrt(square) if found >= 0 else np.inf
        number[n] = found if found >= 0 else len(points)


@borrowing
def nearest_boxed(points, boxes, within, place, best, waiting):  # type: ignore[no-untyped-def]
    """(squared distance, number) of the point nearest to a place in the box `within`, 1 for all; -1 if none is nearer
    than the root of `best`.

    `waiting`: (MOST_WAITING,) to work in.
    """
    (x, y, z), leaves, found = place, len(boxes) // 2, -1
    box, top = within if _apart(boxes, within, x, y, z) < best else 0, 0
    while box > 0:
        if box < leaves:
            first, second = 2 * box, 2 * box + 1
            here, there = _apart(boxes, first, x, y, z), _apart(boxes, second, x, y, z)
            if there < here:
                first, second, here, there = second, first, there, here
            if there < best:
                waiting[top] = second
                top += 1
            if here < best:  # the nearer next
                box = first
                continue
        else:
            start = (box - leaves) * POINTS_PER_BOX
            for i in range(start, min(start + POINTS_PER_BOX, len(points))):
                square = (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 + (points[i, 2] - z) ** 2
                if square < best:
                    best, found = square, i
        box = 0
        while top > 0 and box == 0:
            top -= 1
            box = waiting[top] if _apart(boxes, waiting[top], x, y, z) < best else 0
    return best, found


@borrowing
def nearest_from(points, boxes, start, place, best, waiting):  # type: ignore[no-untyped-def]
    """As `nearest_boxed`, of all points, looked for from the point `start` on: found at once if it is near.

    In the leaf of that point first, then in each box beside one that has been looked through, up to the root.
    """
    box = len(boxes) // 2 + start // POINTS_PER_BOX
    best, nearest = nearest_boxed(points, boxes, box, place, best, waiting)
    while box > 1:
        best, found = nearest_boxed(points, boxes, box ^ 1, place, best, waiting)
        if found >= 0:
            nearest = found
        box //= 2
    return best, nearest


@inlined
def _apart(boxes, box, x, y, z):  # type: ignore[no-untyped-def]
    """Squared distance of a place from a box."""
    u = max(boxes[box, 0] - x, 0.0, x - boxes[box, 3])
    v = max(boxes[box, 1] - y, 0.0, y - boxes[box, 4])
    w = max(boxes[box, 2] - z, 0.0, z - boxes[box, 5])
    return u * u + v * v + w * w
