"""Envelope of balls under a profile: the exact morphological erosion of its trace, in O(n).

Penetration: how deep points lie inside balls where no body can be.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from mapping import EnvelopeError, FloatArray, IntArray
from mapping.geometry.mesh import BoxedPoints

# Share by which the bound of a search is widened: its rounding, and that of distances, is some 1e-16
BOUND_ROUNDING = 1e-12


def envelope_heights(
    x: ArrayLike, z: ArrayLike, tip_radius: float, at: ArrayLike | None = None
) -> tuple[FloatArray, IntArray]:
    """Highest body that balls centred at (x, z) allow.

    e(x') = min over i of z_i - sqrt(r^2 - (x' - x_i)^2), each ball where it reaches.

    Args:
        x, z: (N,) ball centres, m, in any order.
        tip_radius: r, m.
        at: (M,) abscissae x', m; None takes x.

    Returns:
        (M,) heights, +inf where no ball reaches, and (M,) indices of the balls that bound them, -1 for none.

    Raises:
        EnvelopeError: arrays of different lengths, values that are not finite, a radius that is not positive.

    Reference: ISO 16610-41:2015 (erosion by a disc); theory equation 1.3.
    """
    centers = np.array([np.asarray(x, dtype=np.float64), np.asarray(z, dtype=np.float64)])
    query = centers[0] if at is None else np.asarray(at, dtype=np.float64)
    if centers.ndim != 2 or not np.isfinite(centers).all() or not np.isfinite(query).all():
        raise EnvelopeError(f"a profile's envelope needs finite x and z of shape (N,); found {centers.shape[1:]}")
    if not (np.isfinite(tip_radius) and tip_radius > 0):
        raise EnvelopeError(f"tip radius must be a positive length in metres; found {tip_radius!r}")
    if centers.shape[1] == 0:
        return np.full(len(query), np.inf), np.full(len(query), -1, dtype=np.int64)
    from mapping.estimate.envelope.envelope_kernels import envelope_at, lower_envelope

    order, sorted_x, sorted_z = _sorted(centers[0], centers[1])
    owners, starts = lower_envelope(sorted_x, sorted_z, float(tip_radius))
    query_order, sorted_query, _ = _sorted(query, query)
    heights, indices = np.empty(len(query)), np.empty(len(query), dtype=np.int64)
    found, owner = envelope_at(sorted_x, sorted_z, float(tip_radius), owners, starts, sorted_query)
    heights[query_order] = found
    indices[query_order] = np.where(owner < 0, -1, order[owner])
    return heights, indices


def _sorted(x: FloatArray, z: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    if (np.diff(x) >= 0).all():
        return np.arange(len(x)), np.ascontiguousarray(x), np.ascontiguousarray(z)
    order = np.argsort(x, kind="stable")
    return order, x[order], z[order]


def penetration_below(centers: FloatArray, tip_radius: float) -> Callable[[FloatArray, float], FloatArray]:
    """What gives the depth of points (N, 3) below the surface of the deepest of the balls at `centers` (M, 3), m.

    Positive inside a ball, where no body can be; negative outside all of them. Points of a profile (all y of one
    value) are judged by the profile's envelope in O(n), others by boxes about pieces of the sweeps, laid out once;
    centres in no order are put in one first. The second argument is the least depth that matters, m: points less deep
    may be given -inf. A search that knows how near a ball must be looks at few, for most points touch one ball and lie
    in none.
    """
    one_row = np.ptp(centers[:, 1]) == 0 and bool((np.diff(centers[:, 0]) > 0).all())

    @cache
    def boxed() -> BoxedPoints:
        return BoxedPoints(centers)

    def depth(points: FloatArray, least: float) -> FloatArray:
        if len(points) == 0:
            return np.zeros(0)
        if one_row and (points[:, 1] == centers[0, 1]).all():
            return _below_profile(points, centers, tip_radius)
        near = max((tip_radius - least) * (1.0 + BOUND_ROUNDING), 0.0)
        return tip_radius - boxed().nearest(points, near)[0]

    return depth


def _below_profile(points: FloatArray, centers: FloatArray, tip_radius: float) -> FloatArray:
    order = np.argsort(points[:, 0], kind="stable")
    owner = np.empty(len(points), dtype=np.int64)
    owner[order] = envelope_heights(centers[:, 0], centers[:, 2], tip_radius, points[order, 0])[1]
    distance = np.linalg.norm(points - centers[owner], axis=1)
    return np.where(owner < 0, -np.inf, tip_radius - distance)
