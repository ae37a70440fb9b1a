"""Reach: which places of a body a ball with its stem can touch at all."""

from __future__ import annotations

import numpy as np

from mapping import BoolArray, FloatArray
from planners.paths.carrier import MOST_SINKING, Carrier
from planners.paths.sound import MOST_TURNED


def reachable(points: FloatArray, normals: FloatArray, carrier: Carrier) -> BoolArray:
    """(N,) True where a ball can rest on a place of the body without sinking elsewhere, some stem behind it being free.

    A bound that no path enters: a place inside a closed cavity counts as reachable.

    Args:
        points, normals: (N, 3) places, m, and the outward unit normals there.
        carrier: the stem, the ball's radius, and the body.
    """
    centers = points + carrier.tip_radius * normals
    fits = carrier.base.foot(centers, carrier.tip_radius).height >= -MOST_SINKING * carrier.tip_radius
    blocked = np.flatnonzero(fits)[~carrier.is_free(centers[fits], -normals[fits])]
    for direction in carrier.lattice:
        if not len(blocked):
            break
        tried = blocked[-normals[blocked] @ direction >= np.cos(MOST_TURNED)]
        ways = np.tile(direction, (len(tried), 1))
        blocked = np.setdiff1d(blocked, tried[carrier.is_free(centers[tried], ways)])
    fits[blocked] = False
    return np.asarray(fits)
