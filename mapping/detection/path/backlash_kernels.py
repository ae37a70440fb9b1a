"""Play of an axis: it follows only when it is pulled, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def hang_behind(path, half):  # type: ignore[no-untyped-def]
    """(N, 3) by how much a stage whose axes have a play of 2 `half`, m, is off a path (N, 3); it begins midway."""
    behind = path * 0.0
    for i in range(1, len(path)):
        for k in range(3):
            moved = behind[i - 1, k] + path[i - 1, k] - path[i, k]
            behind[i, k] = min(max(moved, -half), half)
    return behind


@njit(cache=True)
def heights_of_caps(s, crests):  # type: ignore[no-untyped-def]
    """(n,) heights, m, of caps (K, 3) of a height, place and half-width at arclengths s (n,)."""
    out = np.zeros(len(s))
    for k in range(len(crests)):
        for i in range(len(s)):
            out[i] += crests[k, 0] * max(1.0 - ((s[i] - crests[k, 1]) / crests[k, 2]) ** 2, 0.0)
    return out


@njit(cache=True)
def lowered_by(level, normals, caps, half):  # type: ignore[no-untyped-def]
    """(n,) by how much a play of 2 `half` shifts along the normals (n, 3) what runs over `level` (n, 3) and caps, m."""
    path = np.empty_like(level)
    for i in range(len(level)):
        for k in range(3):
            path[i, k] = level[i, k] + caps[i] * normals[i, k]
    behind, out = hang_behind(path, half), np.empty(len(level))
    for i in range(len(level)):
        out[i] = behind[i, 0] * normals[i, 0] + behind[i, 1] * normals[i, 1] + behind[i, 2] * normals[i, 2]
    return out
