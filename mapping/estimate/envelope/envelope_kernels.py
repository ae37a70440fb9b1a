"""Compiled loops of the estimated surface: the envelope of balls."""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray, IntArray


@njit(cache=True)
def takeover(xi: float, zi: float, xj: float, zj: float, r: float) -> float:
    """Abscissa from which the lower arc of disc j (xj > xi) lies below that of disc i.

    Two equal lower arcs cross at most once where both exist, for f_i - f_j grows along their common domain.
    """
    half_x, half_z = 0.5 * (xj - xi), 0.5 * (zj - zi)
    left, right = xj - r, xi + r
    if left >= right:
        return right
    if zi - np.sqrt(max((r - (left - xi)) * (r + (left - xi)), 0.0)) >= zj:
        return left
    if zj - np.sqrt(max((r - (right - xj)) * (r + (right - xj)), 0.0)) >= zi:
        return right
    d = np.hypot(half_x, half_z)
    h = np.sqrt(max((r - d) * (r + d), 0.0))
    return float(0.5 * (xi + xj) + h * half_z / d)


@njit(cache=True)
def lower_envelope(x: FloatArray, z: FloatArray, r: float) -> tuple[IntArray, FloatArray]:
    """Discs that show in the lower envelope of discs sorted by x, and where each begins to: (owners, starts).

    The order of the discs along the envelope is their order in x, so one stack suffices: every disc is
    pushed once and popped at most once.
    """
    owners = np.empty(len(x), np.int64)
    starts = np.empty(len(x), np.float64)
    top = -1
    for j in range(len(x)):
        hidden = False
        start = x[j] - r
        while top >= 0:
            i = owners[top]
            if x[j] == x[i]:
                if z[j] >= z[i]:
                    hidden = True
                    break
                top -= 1
                continue
            start = takeover(x[i], z[i], x[j], z[j], r)
            if start > starts[top]:
                break
            top -= 1
        if hidden:
            continue
        top += 1
        owners[top] = j
        starts[top] = x[j] - r if top == 0 else start
    return owners[: top + 1].copy(), starts[: top + 1].copy()


@njit(cache=True)
def envelope_at(
    x: FloatArray, z: FloatArray, r: float, owners: IntArray, starts: FloatArray, at: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Height and owner of the envelope at sorted abscissae; +inf and -1 where no disc reaches."""
    height = np.full(len(at), np.inf)
    owner = np.full(len(at), -1, np.int64)
    k = 0
    for m in range(len(at)):
        while k + 1 < len(owners) and starts[k + 1] <= at[m]:
            k += 1
        i = owners[k]
        d = at[m] - x[i]
        if abs(d) <= r:
            height[m] = z[i] - np.sqrt((r - d) * (r + d))
            owner[m] = i
    return height, owner
