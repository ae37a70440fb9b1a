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
