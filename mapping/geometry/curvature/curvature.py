"""Curvature: principal curvatures of a surface at its points, each with its standard deviation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Curvature:
    """Principal curvatures, positive where the body bulges outward.

    Args:
        k1, k2: (V,) curvatures, 1/m, k1 >= k2; NaN where there is no trustworthy value.
        d1, d2: (V, 3) unit principal directions; NaN where k1 and k2 differ by less than their noise (umbilics
            have no direction) or have no value.
        sd: (V,) standard deviation of the curvatures, 1/m; NaN where the method does not know.
        valid: (V,) True where the values can be trusted.
    """

    k1: FloatArray
    k2: FloatArray
    d1: FloatArray
    d2: FloatArray
    sd: FloatArray
    valid: BoolArray

    @property
    def largest(self) -> FloatArray:
        """(V,) the curvature of larger absolute value, 1/m."""
        return np.where(np.abs(self.k1) >= np.abs(self.k2), self.k1, self.k2)


def from_operators(operators: FloatArray, bases: FloatArray, sd: FloatArray, valid: BoolArray) -> Curvature:
    """Curvatures from symmetric shape operators (V, 3) = (a, b, c) in tangent bases (V, 2, 3)."""
    a, b, c = operators.T
    mean, half = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
    angle = 0.5 * np.arctan2(2 * b, a - c)
    d1 = np.cos(angle)[:, None] * bases[:, 0] + np.sin(angle)[:, None] * bases[:, 1]
    d2 = -np.sin(angle)[:, None] * bases[:, 0] + np.cos(angle)[:, None] * bases[:, 1]
    umbilic = ~(half > np.nan_to_num(sd, nan=0.0) + 0.5e-9 * np.abs(mean)) | ~valid
    d1[umbilic], d2[umbilic] = np.nan, np.nan
    k1, k2 = np.where(valid, mean + half, np.nan), np.where(valid, mean - half, np.nan)
    return Curvature(k1, k2, d1, d2, np.where(valid, sd, np.nan), valid)
