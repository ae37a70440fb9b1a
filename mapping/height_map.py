"""Height map under balls: the highest body that scattered ball centres allow, on a grid of nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapping.estimate import EnvelopeError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def envelope_map(
    centers: ArrayLike, tip_radius: float, corner: tuple[float, float], step: float, shape: tuple[int, int]
) -> tuple[FloatArray, IntArray]:
    """Envelope of balls at scattered centres, looked at along z: the erosion of the trace at every node.

    With centres on the nodes of a height map this is the erosion that surface metrology applies to stylus and AFM
    maps; centres may as well lie anywhere, as sweeps and clouds do.

    Args:
        centers: (N, 3) ball centres, m, z outward.
        tip_radius: r, m.
        corner: x and y of node (0, 0), m.
        step: distance between nodes, m.
        shape: numbers of nodes along y (rows) and x (columns).

    Returns:
        (rows, columns) heights, m, +inf where no ball reaches, and the indices of the bounding balls, -1 for none.

    Raises:
        EnvelopeError: centres that are not finite (N, 3), or a radius, step or shape that is not positive.

    Reference: Villarrubia 1997 (tip erosion); ISO 16610-85; theory section 1.
    """
    points = np.ascontiguousarray(centers, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise EnvelopeError(f"ball centres must be finite and of shape (N, 3); found shape {points.shape}")
    positive = {"tip radius": tip_radius, "step": step, "rows": shape[0], "columns": shape[1]}
    for name, value in positive.items():
        if not (np.isfinite(value) and value > 0):
            raise EnvelopeError(f"a height map needs a positive {name}; found {value!r}")
    from mapping.envelope_kernels import splat_balls

    x, y, z = np.ascontiguousarray(points.T)
    heights, owner = splat_balls(x, y, z, float(tip_radius), corner[0], corner[1], float(step), *shape)
    return heights, owner
