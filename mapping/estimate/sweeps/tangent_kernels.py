"""Tangents along sweeps (numba)."""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray, IntArray


@njit(cache=True)
def sweep_tangents(
    points: FloatArray, s: FloatArray, begin: IntArray, end: IntArray, most: int, bias: float
) -> FloatArray:
    """Derivative at each point of the polynomial through up to `most` points of its piece [begin, end).

    Of the windows that hold the point, the one of the smallest highest divided difference is taken; the
    central one is kept unless another is smoother by the factor `bias`.
    """
    count = len(points)
    result = np.zeros((count, 3))
    # Highest divided difference of every full window, up to a common factor of its spacing.
    rough = np.full(count, np.inf)
    weight = np.empty(most)
    for w in range(count - most + 1):
        if begin[w] != begin[w + most - 1]:
            continue
        total = np.zeros(3)
        for j in range(most):
            product = 1.0
            for k in range(most):
                if k != j:
                    product *= (s[w + j] - s[w + k]) / (s[w + most - 1] - s[w])
            for c in range(3):
                total[c] += (points[w + j, c] - points[w, c]) / product
        rough[w] = np.sqrt(total[0] ** 2 + total[1] ** 2 + total[2] ** 2)
        rough[w] /= (s[w + most - 1] - s[w]) ** (most - 1)
    for i in range(count):
        size = min(most, end[i] - begin[i])
        first = min(max(i - most // 2, begin[i]), end[i] - size)
        if size == most:
            best = rough[first] / bias
            for w in range(max(begin[i], i - most + 1), min(i, end[i] - most) + 1):
                if rough[w] < best:
                    best, first = rough[w], w
        for j in range(size):
            weight[j] = 0.0
            if first + j == i:
                continue
            for skip in range(size):
                if skip == j:
                    continue
                product = 1.0 / (s[first + j] - s[first + skip])
                for k in range(size):
                    if k != j and k != skip:
                        product *= (s[i] - s[first + k]) / (s[first + j] - s[first + k])
                weight[j] += product
            for c in range(3):
                result[i, c] += weight[j] * (points[first + j, c] - points[i, c])
    return result
