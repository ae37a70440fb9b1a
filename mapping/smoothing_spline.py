"""The cubic smoothing spline."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

FloatArray = NDArray[np.float64]


def smoothing_spline(x: FloatArray, y: FloatArray, weight: NDArray[np.int64], lam: float) -> CubicHermiteSpline:
    """The curve f that minimises sum weight (y - f)^2 + lam times the integral of f''^2: a natural cubic spline.

    Args:
        x: (N,) places, increasing, N at least 3.
        y: (N, D) values.
        weight: (N,) positive.
        lam: 0 interpolates.

    Reference: Reinsch 1967; Green and Silverman 1994, section 2.3.3.
    """
    from scipy.interpolate import CubicHermiteSpline
    from scipy.linalg import solveh_banded

    h, own = np.diff(x), 1.0 / weight
    # columns of Q: second differences; R: the integral of the product of two hats
    before, after = 1 / h[:-1], 1 / h[1:]
    middle = -before - after
    band = np.zeros((3, len(x) - 2))
    band[2] = (h[:-1] + h[1:]) / 3 + lam * (before**2 * own[:-2] + middle**2 * own[1:-1] + after**2 * own[2:])
    band[1, 1:] = h[1:-1] / 6 + lam * (after[:-1] * middle[1:] * own[2:-1] + middle[:-1] * before[1:] * own[1:-2])
    band[0, 2:] = lam * after[:-2] * before[2:] * own[2:-2]
    bend = np.zeros_like(y)
    bend[1:-1] = solveh_banded(band, np.diff(np.diff(y, axis=0) / h[:, None], axis=0))
    value = y - lam * own[:, None] * _second_differences(bend[1:-1], before, middle, after)
    slope = np.empty_like(y)
    chord = np.diff(value, axis=0) / h[:, None]
    slope[:-1] = chord - h[:, None] * (2 * bend[:-1] + bend[1:]) / 6
    slope[-1] = chord[-1] + h[-1] * bend[-2] / 6
    return CubicHermiteSpline(x, value, slope)


def _second_differences(bend: FloatArray, before: FloatArray, middle: FloatArray, after: FloatArray) -> FloatArray:
    """(N, D) product of Q with (N - 2, D)."""
    out = np.zeros((len(bend) + 2, bend.shape[1]))
    out[:-2] += before[:, None] * bend
    out[1:-1] += middle[:, None] * bend
    out[2:] += after[:, None] * bend
    return out
