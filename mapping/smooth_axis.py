"""Smooth axis: the simplest curve through the crossings of a ridge that their uncertainty allows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

HIGHEST_DEGREE = 8
# A fit whose mean square residual exceeds this many variances follows the axis at no degree: the axis is kept.
POOR = 9.0


def smooth_axis(axis: FloatArray, sd: float, most: int = HIGHEST_DEGREE) -> tuple[FloatArray, int]:
    """A polyline (K', 3) along polynomials (closed axis: Fourier series) of the degree with the best evidence.

    Args:
        axis: (K, 3) crossings in order, m; first equals last if closed.
        sd: standard deviation of a crossing, m.
        most: highest degree to try; a single one is taken whether it fits or not.

    Returns:
        The smoothed polyline and its degree; the axis itself and the highest degree if none fits.
    """
    closed = len(axis) > 3 and bool(np.array_equal(axis[0], axis[-1]))
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1))])
    points = len(axis) - 1 if closed else len(axis)
    lowest = 1
    most = min((points - 2) // 2 if closed else points - 2, most)
    if most < lowest:
        return axis, lowest
    x = s / s[-1] * 2.0 - 1.0
    dense = np.linspace(-1.0, 1.0, max(2, 4 * len(axis), 65 if closed else 2))
    best, best_cost, best_misfit = lowest, np.inf, np.inf
    for degree in range(lowest, most + 1):
        design = _design(x[:points], degree, closed)
        coefficients = np.linalg.lstsq(design, axis[:points], rcond=None)[0]
        # Two of the three coordinates are across the axis; the third is the order of the crossings, not a datum.
        misfit = float(((axis[:points] - design @ coefficients) ** 2).sum()) / sd**2
        cost = misfit + 2.0 * design.shape[1] * float(np.log(points))
        if cost < best_cost:
            best, best_cost, best_misfit = degree, cost, misfit / (2 * points)
            curve = _design(dense, degree, closed) @ coefficients
    if best_misfit > POOR and most > lowest:
        return axis, most
    if closed:
        curve[-1] = curve[0]
    return curve, best


def _design(x: FloatArray, degree: int, closed: bool) -> FloatArray:
    if not closed:
        return np.asarray(np.polynomial.legendre.legvander(x, degree))
    waves = [f(np.pi * k * x) for k in range(1, degree + 1) for f in (np.cos, np.sin)]
    return np.column_stack([np.ones_like(x), *waves])
