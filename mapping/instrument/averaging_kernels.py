"""Means of neighbours, compiled: a search asks for them thousands of times, of some hundred values each."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray, IntArray


@njit(cache=True, error_model="numpy", nogil=True)
def means_about(values: FloatArray, halves: IntArray) -> FloatArray:
    """(K, N) means over 2 half + 1 values (N,) for each of K halves, over fewer at the ends."""
    count = len(values)
    sums, means = np.zeros(count + 1), np.empty((len(halves), count))
    for i in range(count):
        sums[i + 1] = sums[i] + values[i]
    for k in range(len(halves)):
        for i in range(count):
            low, high = max(i - halves[k], 0), min(i + halves[k] + 1, count)
            means[k, i] = (sums[high] - sums[low]) / (high - low)
    return means


@njit(cache=True, error_model="numpy", nogil=True)
def at_middles(means, occupied, place):  # type: ignore[no-untyped-def]
    """(n, C) values in the middles of bins, from means (n, C) over their samples.

    Args:
        means: (n, C).
        occupied: (n,) numbers of the bins, ascending.
        place: (n,) numbers of bins at whose middles the means are.
    """
    moved = means.copy()
    for i in range(1, len(means) - 1):
        if occupied[i + 1] - occupied[i - 1] != 2:
            continue
        aside, back, on = occupied[i] - place[i], place[i] - place[i - 1], place[i + 1] - place[i]
        for c in range(means.shape[1]):
            behind, ahead = (means[i, c] - means[i - 1, c]) / back, (means[i + 1, c] - means[i, c]) / on
            if behind * ahead > 0.0:
                steepest = 2.0 * min(abs(behind), abs(ahead))
                across = (means[i + 1, c] - means[i - 1, c]) / (place[i + 1] - place[i - 1])
                moved[i, c] += aside * min(max(across, -steepest), steepest)
    return moved
