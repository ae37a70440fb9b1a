"""Compiled bounds on distances from a body by the nearest node of a grid."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray

# So much less than a bound, as a share of what it is made of, that rounding never decides
ROOM_ROUNDING = 1e-9


@njit(cache=True, error_model="numpy", nogil=True)
def distance_bounds(
    places: FloatArray,
    low: FloatArray,
    spacing: float,
    distances: FloatArray,
    box: FloatArray,
    least: FloatArray,
    most: FloatArray,
) -> None:
    """Bounds (N,) of the distances at places (N, 3); the other arguments as of planners.paths.room.Room, m."""
    node = np.empty(3, dtype=np.int64)
    for n in range(len(places)):
        square = outside = 0.0
        for axis in range(3):
            place = places[n, axis]
            number = int(np.rint((place - low[axis]) / spacing))
            node[axis] = min(max(number, 0), distances.shape[axis] - 1)
            square += (place - low[axis] - spacing * node[axis]) ** 2
            outside += max(box[0, axis] - place, place - box[1, axis], 0.0) ** 2
        away, there = np.sqrt(square), distances[node[0], node[1], node[2]]
        rounding = ROOM_ROUNDING * (away + abs(there))
        least[n] = there - away - rounding
        most[n] = there + away + rounding
        if outside > 0.0:
            least[n] = max(least[n], np.sqrt(outside) * (1.0 - ROOM_ROUNDING))
