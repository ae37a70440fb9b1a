"""The cubic smoothing spline, and the length over which it must average so that 1/r stands out of the noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mapping import FloatArray, IntArray
from mapping.instrument import Noise

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline


def smoothing_spline(x: FloatArray, y: FloatArray, weight: IntArray, lam: float) -> CubicHermiteSpline:
    """The curve f that minimises sum weight (y - f)^2 + lam times the integral of f''^2: a natural cubic spline.

    Args:
        x: (N,) places, increasing, N at least 3.
        y: (N, D) values.
        weight: (N,) positive.
        lam: 0 interpolates.

    Reference: Reinsch, Smoothing by spline functions, Numerische Mathematik 10, 1967; Green and Silverman,
    Nonparametric Regression and Generalized Linear Models, 1994, section 2.3.3.
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


# Curvature must stand this many standard deviations out of its noise: theory section 6.2 takes three.
CONFIDENCE = 3.0


def smoothing_length(noise: Noise, spacing: float, tip_radius: float) -> float:
    """The smoothing length h at which the curvature's noise is 1/(3 r), m."""
    from scipy.optimize import brentq

    def excess(log_h: float) -> float:
        return float(np.log(curvature_sd(noise, spacing, np.exp(log_h)) * tip_radius * CONFIDENCE))

    low, high = np.log(1e-9 * tip_radius), np.log(1e9 * max(tip_radius, noise.sd, noise.length, noise.longest))
    if excess(low) <= 0:
        return float(np.exp(low))
    return float(np.exp(brentq(excess, low, high, xtol=1e-6)))


def curvature_sd(noise: Noise, spacing: float, h: float) -> float:
    """Standard deviation that noise leaves in the second derivative of a spline of smoothing length h, 1/m."""
    return _remaining(noise, spacing, h, 4)


def position_sd(noise: Noise, spacing: float, h: float) -> float:
    """Standard deviation that noise leaves in a position, m."""
    return _remaining(noise, spacing, h, 0)


def _remaining(noise: Noise, spacing: float, h: float, power: int) -> float:
    """Root of the spectrum's integral: a smoothing spline damps the frequency w by 1 / (1 + (h w)^4).

    Reference: theory equation 6.6.
    """
    x = np.geomspace(1e-6, 1e3, 2000)  # x = h w
    integrand = noise.density(x / h, spacing) * x**power / (1 + x**4) ** 2
    return float(np.sqrt(np.trapezoid(integrand * x, np.log(x)) / (np.pi * h ** (power + 1))))
