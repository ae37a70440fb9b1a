"""Bends of a path over blocks of its samples, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import BoolArray, FloatArray


@njit(cache=True, error_model="numpy", nogil=True)
def block_bends(
    sums: FloatArray, up: FloatArray, size: int, stride: int, step: float, steepest: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """By how much the mean of each block stands above the chord through those right before and behind it.

    Args:
        sums: (N + 1, 3) running sums of the samples, m.
        up: (N, 3) or (1, 3) unit directions out of the base.
        size, stride: of a block, and from one to the next, in samples; the stride divides the size.
        step: usual distance of the samples, m.
        steepest: rise over run.

    Returns:
        Of K blocks: the height above the chord, across it, m; the product of the distances to both neighbours, m^2;
        False where the path is steep, turns to the side, or samples are missing.
    """
    count = max(0, (len(sums) - 1 - 3 * size) // stride + 1)
    rise, product, usable = np.empty(count), np.empty(count), np.zeros(count, np.bool_)
    share = 1.0 / size
    for k in range(count):
        i = k * stride
        n = up[0] if len(up) == 1 else up[i + size + size // 2]
        a = b = across = climb = fall = 0.0
        for c in range(3):
            low, high = sums[i + size, c], sums[i + 2 * size, c]
            before = share * (high - 2.0 * low + sums[i, c])
            behind = share * (sums[i + 3 * size, c] - 2.0 * high + low)
            a += before * before
            b += behind * behind
            across += before * behind
            climb += before * n[c]
            fall -= behind * n[c]
        chord = a + b + 2.0 * across
        a, b = np.sqrt(a), np.sqrt(b)
        rise[k] = product[k] = 0.0
        if a + b == 0.0 or chord <= 0.0:
            continue
        lean = (climb - fall) ** 2 / chord
        rise[k] = (climb * b + fall * a) / (a + b) * np.sqrt(max(0.0, 1.0 - lean))
        product[k] = a * b
        level = abs(climb) < steepest * a and abs(fall) < steepest * b
        even = min(a, b) > 0.5 * size * step and max(a, b) < 2.0 * size * step
        bend = 2.0 * a * b * (a * b - across) / (a + b) ** 2  # its square, whichever way it goes
        usable[k] = level and even and bend < 2.0 * rise[k] ** 2
    return rise, product, usable
