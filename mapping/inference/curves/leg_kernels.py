"""Compiled search for the leg of a polyline that is nearest to each of many points."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray, IntArray


@njit(cache=True, nogil=True)
def nearest_legs(points: FloatArray, line: FloatArray) -> IntArray:
    """(n,) number of the leg of a polyline (K, 3) that is nearest to each point (n, 3), m; the first of equals."""
    legs = len(line) - 1
    way, square = np.empty((legs, 3)), np.empty(legs)
    for k in range(legs):
        square[k] = 0.0
        for c in range(3):
            way[k, c] = line[k + 1, c] - line[k, c]
            square[k] += way[k, c] ** 2
        square[k] = max(square[k], 1e-300)
    nearest = np.zeros(len(points), dtype=np.int64)
    for n in range(len(points)):
        least = np.inf
        for k in range(legs):
            x, y, z = points[n, 0] - line[k, 0], points[n, 1] - line[k, 1], points[n, 2] - line[k, 2]
            share = (x * way[k, 0] + y * way[k, 1] + z * way[k, 2]) / square[k]
            share = min(max(share, 0.0), 1.0)
            x, y, z = x - share * way[k, 0], y - share * way[k, 1], z - share * way[k, 2]
            gap = x * x + y * y + z * z
            if gap < least:
                least, nearest[n] = gap, k
    return nearest
