"""Compiled axes of many curves about one chart at once (what Chart.at and CurveModes say one by one)."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray


@njit(cache=True)
def lateral_at(coefficients, x, reach):  # type: ignore[no-untyped-def]
    """Lateral distance of an open axis at x, the place over `reach` from the middle (CurveModes.basis), m."""
    inside = min(max(x, -1.0), 1.0)
    total = coefficients[0]
    if len(coefficients) > 1:
        total += coefficients[1] * x * reach
    value, before, slope, slope_before = inside, 1.0, 1.0, 0.0
    for k in range(1, len(coefficients) - 1):
        value, before = ((2 * k + 1) * inside * value - k * before) / (k + 1), value
        slope, slope_before = slope_before + (2 * k + 1) * before, slope
        total += coefficients[k + 1] * (value + (x - inside) * slope)
    return total


@njit(cache=True)
def lifted(point, lateral, normal, bend, aside, lift, out):  # type: ignore[no-untyped-def]
    """A point `aside` of the chart along the base (to second order in its bend) and `lift` above it, to `out`."""
    over = aside * (1.0 + lift * bend)
    up = lift - 0.5 * bend * aside * aside
    for c in range(3):
        out[c] = point[c] + over * lateral[c] + up * normal[c]


@njit(cache=True, nogil=True)
def axes_about(
    s: FloatArray,
    points: FloatArray,
    laterals: FloatArray,
    normals: FloatArray,
    bend: FloatArray,
    basis: FloatArray,
    middle: float,
    reach: float,
    coefficients: FloatArray,
    lift: FloatArray,
    ends: FloatArray,
) -> FloatArray:
    """(W, K, 3) axes at `lift` (W,) over the chart; vertices beyond an end stand at the end, m.

    Args:
        s to bend: of the chart (K, ...).
        basis: (count, K) lateral distance of each mode at `s`.
        middle, reach: of the modes, m.
        coefficients: (W, count).
        ends: (W, 2) places along the chart where each axis begins and ends, or (0, 2): closed.
    """
    walkers, count = coefficients.shape
    size = len(s)
    out = np.empty((walkers, size, 3))
    end = np.empty(3)
    for w in range(walkers):
        for j in range(size):
            aside = 0.0
            for c in range(count):
                aside += coefficients[w, c] * basis[c, j]
            lifted(points[j], laterals[j], normals[j], bend[j], aside, lift[w], out[w, j])
        if len(ends) == 0:
            continue
        for side in range(2):
            place = ends[w, side]
            leg = min(max(np.searchsorted(s, place, side="right") - 1, 0), size - 2)
            share = (place - s[leg]) / (s[leg + 1] - s[leg])
            aside = lateral_at(coefficients[w], (place - middle) / reach, reach)
            lifted(
                (1.0 - share) * points[leg] + share * points[leg + 1],
                (1.0 - share) * laterals[leg] + share * laterals[leg + 1],
                (1.0 - share) * normals[leg] + share * normals[leg + 1],
                (1.0 - share) * bend[leg] + share * bend[leg + 1],
                aside,
                lift[w],
                end,
            )
            for j in range(size):
                if (side == 0 and s[j] < place) or (side == 1 and s[j] > place):
                    out[w, j] = end
    return out
