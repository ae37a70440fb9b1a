"""Crest trace: the height of the ball over the base at places beside a supposed axis."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray

# Share of a crest by which an ideal shape may be wrong about a real detail.
SHAPE_ERROR = 0.04
# Places that contradict a shape by more than this many standard deviations belong to something else.
CREST_OUTLIER_SDS = 5.0


def crest_trace(distance: FloatArray, height: float, half_width: float) -> FloatArray:
    """Heights at distances from the axis, m: a cap over a crest, the flanks of two rims over a hollow.

    The small-height limits of `shapes.cap_height` and `rim_height`: H (1 - (d/w)^2) and H (1 - |d|/w)^2.
    """
    u = np.minimum(np.abs(distance) / half_width, 1.0)
    return np.asarray(height * (1.0 - u**2 if height > 0 else (1.0 - u) ** 2))


def robust_cost(residual: FloatArray, sd: FloatArray, height: float) -> FloatArray:
    """Squares of residuals in standard deviations, none counted as more than an outlier."""
    return np.asarray(np.minimum((residual / np.hypot(sd, SHAPE_ERROR * height)) ** 2, CREST_OUTLIER_SDS**2))
