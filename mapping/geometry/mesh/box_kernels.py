"""Boxes about points of which neighbours follow one another, and about such boxes, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

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
