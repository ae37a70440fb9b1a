"""Levinson's recursion for symmetric Toeplitz systems, compiled: every leading block on the way to the whole."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, fastmath={"reassoc", "contract"})
def leading_solutions(first, columns, smallest):  # type: ignore[no-untyped-def]
    """Solutions of T[:k, :k] x = columns[:k] for k = smallest to n; (n + 1 - smallest, n, P), zero beyond k.

    Args:
        first: (n,) first row of the symmetric positive definite Toeplitz matrix T.
        columns: (n, P) right-hand sides.
        smallest: the smallest k that is kept.

    Reference: Golub and Van Loan, Matrix Computations, third edition 1996, algorithm 4.7.2 (Levinson).
    """
    n, count = columns.shape
    kept = np.zeros((n + 1 - smallest, n, count))
    right = np.ascontiguousarray(columns.T)
    solution = np.zeros((count, n))
    backward = first[::-1].copy()
    # prediction coefficients of order k: T[:k, :k] turned[::-1] = -first[1 : k + 1]
    turned = np.zeros(n)
    forward = np.zeros(n)
    solution[:, 0] = right[:, 0] / first[0]
    error = first[0]
    for k in range(1, n + 1):
        if k >= smallest:
            kept[k - smallest, :k] = solution[:, :k].T
        if k == n:
            break
        total = first[k]
        for i in range(k - 1):
            total += backward[n - k + i] * forward[i]
        reflection = -total / error
        for i in range(k - 1):
            turned[1 + i] = forward[k - 2 - i]
        for i in range(k - 1):
            forward[i] += reflection * turned[1 + i]
        forward[k - 1] = reflection
        for i in range(k):
            turned[i] = forward[k - 1 - i]
        error *= 1.0 - reflection * reflection
        for p in range(count):
            missing = right[p, k]
            for i in range(k):
                missing -= backward[n - 1 - k + i] * solution[p, i]
            step = missing / error
            for i in range(k):
                solution[p, i] += step * turned[i]
            solution[p, k] = step
    return kept
