"""The scale of smoothing: how long a spline must average so that the noise leaves the curvature 1/r standing out."""

from __future__ import annotations

import numpy as np

from mapping.noise import Noise

# Curvature must stand this many standard deviations out of its noise: theory section 6 takes three.
CONFIDENCE = 3.0


def smoothing_length(noise: Noise, spacing: float, tip_radius: float) -> float:
    """The smoothing length h at which the curvature's noise is 1/(3 r), m."""
    from scipy.optimize import brentq

    def excess(log_h: float) -> float:
        return float(np.log(curvature_sd(noise, spacing, np.exp(log_h)) * tip_radius * CONFIDENCE))

    low, high = np.log(1e-9 * tip_radius), np.log(1e9 * max(tip_radius, noise.sd, noise.length))
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
    """Root of the spectrum's integral: a smoothing spline damps the frequency w by 1 / (1 + (h w)^4)."""
    x = np.geomspace(1e-6, 1e3, 2000)  # x = h w
    density = noise.white**2 * spacing + 2 * noise.correlated**2 * noise.length / (1 + (x * noise.length / h) ** 2)
    integrand = density * x**power / (1 + x**4) ** 2
    return float(np.sqrt(np.trapezoid(integrand * x, np.log(x)) / (np.pi * h ** (power + 1))))
