"""Compiled means of many caps over the bins of one even grid."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray


@njit(cache=True, inline="always")
def _integral(x, edge, flat):  # type: ignore[no-untyped-def]
    size = abs(x)
    u = min(max((size - flat) / edge, 0.0), 1.0)
    area = min(size, flat) + edge * (u - u * u * u / 3.0)
    return area if x >= 0.0 else -area


@njit(cache=True, error_model="numpy", nogil=True)
def caps(
    first: float, step: float, count: int, place: FloatArray, half_width: FloatArray, flat: FloatArray
) -> FloatArray:
    """(C, count) means of caps of unit height over bins of `step` whose first has its middle at `first`, m.

    Args:
        place, half_width: (C,) m.
        flat: (C,) half-lengths of the flat tops, m; the flanks are parabolic.
    """
    out = np.empty((len(place), count))
    for c in range(len(place)):
        edge = half_width[c] - flat[c]
        begin = _integral(first - 0.5 * step - place[c], edge, flat[c])
        for i in range(count):
            end = _integral(first + (i + 0.5) * step - place[c], edge, flat[c])
            out[c, i] = (end - begin) / step
            begin = end
    return out
