"""The closed-form trace of a found feature over given points of the base."""

from __future__ import annotations

import itertools

import numpy as np

from mapping import Feature, FloatArray
from mapping.geometry.templates import chain_height, contact_half_width, radius_of_cap, rim_height

# A crest disturbs the trace up to its half-width over a flat base, and hardly further over a hollow one
CREST_TRACE_REACH = 1.5


def feature_trace(feature: Feature, feet: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) heights that the feature's median shape leaves on the trace, m; 0 for kinds without a closed form here.

    Args:
        feature: any feature; ridges and bumps are chains of capsules, bumps with a skirt the bells of their record,
            grooves and pits rest the ball on their rim.
        feet: (N, 3) points of the base, m.
        normals: (N, 3) outward unit normals there.
        tip_radius: radius of the fingertip, m.
    """
    height, width = feature.height.median, max(feature.width.median, 1e-12)
    if feature.details.exponent is not None:
        return _bell(feature, feet, tip_radius)
    if feature.kind in ("ridge", "bump") and height > 0.0:
        known = feature.details.radius
        radius = float(radius_of_cap(height, width) if known is None else known)
        # a low and wide one is a part of a large ball, which on a bent base comes out again elsewhere
        near = _distance(feet, feature.axis) < CREST_TRACE_REACH * contact_half_width(height, radius, tip_radius)
        crest = feature.axis + (height - radius) * feature.normals
        over = np.minimum(chain_height(feet, normals, crest, radius, tip_radius), height)
        return np.where(near, over, 0.0)
    if feature.kind in ("groove", "pit") and height < 0.0:
        return rim_height(0.5 * width - _distance(feet, feature.axis), tip_radius, -height)
    return np.zeros(len(feet))


def _bell(feature: Feature, feet: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) heights that a bump of revolution with the feature's scale and exponent leaves, m."""
    from mapping.geometry.templates import bell_heights

    away = np.linalg.norm(feet - feature.axis[0], axis=1)[:, None]
    height, scale = np.array([feature.height.median]), np.array([feature.details.scale], dtype=np.float64)
    exponent, out = np.array([feature.details.exponent], dtype=np.float64), np.empty((1, len(feet)))
    bell_heights(away, np.zeros_like(away), np.zeros((1, 2)), height, scale, exponent, tip_radius, out)
    return np.asarray(out[0])


def _distance(points: FloatArray, axis: FloatArray) -> FloatArray:
    """(N,) distances of points from a polyline (K, 3), m."""
    best = np.linalg.norm(points - axis[0], axis=1)
    for start, end in itertools.pairwise(axis):
        leg = end - start
        square = max(float(leg @ leg), np.finfo(float).tiny)
        share = np.clip((points - start) @ leg / square, 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - start - share[:, None] * leg, axis=1))
    return np.asarray(best)
