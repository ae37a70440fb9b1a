"""Penetration: how deep points lie inside balls where no body can be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapping.profile_envelope import envelope_heights

FloatArray = NDArray[np.float64]


def penetration(points: FloatArray, centers: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) depth of points (N, 3) below the surface of the deepest of the balls at `centers` (M, 3), m.

    Positive inside a ball, where no body can be; negative outside all of them. Points of a profile (all y of
    one value) are judged by the profile's envelope in O(n), others by a k-d tree.
    """
    if len(points) == 0:
        return np.zeros(0)
    if np.ptp(centers[:, 1]) == 0 and (points[:, 1] == centers[0, 1]).all() and (np.diff(centers[:, 0]) > 0).all():
        return _below_profile(points, centers, tip_radius)
    from scipy.spatial import cKDTree

    return np.asarray(tip_radius - cKDTree(centers).query(points)[0])


def _below_profile(points: FloatArray, centers: FloatArray, tip_radius: float) -> FloatArray:
    order = np.argsort(points[:, 0], kind="stable")
    owner = np.empty(len(points), dtype=np.int64)
    owner[order] = envelope_heights(centers[:, 0], centers[:, 2], tip_radius, points[order, 0])[1]
    distance = np.linalg.norm(points - centers[owner], axis=1)
    return np.where(owner < 0, -np.inf, tip_radius - distance)
