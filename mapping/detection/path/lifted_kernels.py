"""Samples far enough apart along a path, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def set_apart(places, spacing):  # type: ignore[no-untyped-def]
    """Indices of places (N, 3), m: the first, and each that is `spacing` or more from the one taken before it."""
    taken = np.empty(len(places), np.int64)
    taken[0], count = 0, 1
    for i in range(1, len(places)):
        away = 0.0
        for k in range(3):
            away += (places[i, k] - places[taken[count - 1], k]) ** 2
        if away >= spacing * spacing:
            taken[count] = i
            count += 1
    return taken[:count]
