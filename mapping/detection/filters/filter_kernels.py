"""Matched filters along a profile, compiled."""

from __future__ import annotations

from numba import njit


@njit(cache=True, error_model="numpy", nogil=True)
def filtered(bins, weights, edge, out):  # type: ignore[no-untyped-def]
    """Write the filter's weighted sum at each of the bins (n,); beyond the profile's ends there is nothing.

    Args:
        bins: (n,).
        weights: (2 M + 1,) of a window all of which exists.
        edge: (M, 2 M + 1) weights where only i bins exist before the middle; mirrored at the far end.
        out: (n,).
    """
    count, reach = len(bins), len(weights) // 2
    short = min(len(edge), count)
    for i in range(short):
        _sum_at(i, edge[i], reach, bins, out)
    for i in range(count - short, count):
        _sum_at(i, edge[count - 1 - i, ::-1], reach, bins, out)
    middle = out[short : max(short, count - short)]
    middle[:] = 0.0
    for k in range(len(weights)):
        weight, part = weights[k], bins[short - reach + k :]
        for i in range(len(middle)):
            middle[i] += weight * part[i]


@njit(cache=True, error_model="numpy", nogil=True)
def _sum_at(i, weights, reach, bins, out):  # type: ignore[no-untyped-def]
    out[i] = 0.0
    for k in range(max(0, reach - i), min(len(weights), reach + len(bins) - i)):
        out[i] += weights[k] * bins[i - reach + k]
