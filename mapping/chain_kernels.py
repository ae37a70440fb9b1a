"""Compiled heights of a ball over many capsule chains at once (the exact envelope of shapes.chain_height)."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@njit(cache=True, inline="always")
def _exit(ox, oy, oz, nx, ny, nz, total):  # type: ignore[no-untyped-def]
    """Largest t with |o + t n| = total, or -1e300."""
    square = nx * nx + ny * ny + nz * nz
    along = ox * nx + oy * ny + oz * nz
    distance = np.sqrt(ox * ox + oy * oy + oz * oz)
    gap = (distance - total) * (distance + total)
    discriminant = along * along - square * gap
    if discriminant < 0.0 or square < 1e-300:
        return -1e300
    root = np.sqrt(discriminant)
    if along > 0.0:
        return -gap / (along + root)
    return (root - along) / square


@njit(cache=True)
def chain_heights(
    feet: FloatArray,
    normals: FloatArray,
    tangents: FloatArray,
    half_bin: FloatArray,
    first: IntArray,
    last: IntArray,
    chains: FloatArray,
    radii: FloatArray,
    tip_radius: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W chains (W, K, 3) over n bins, averaged over each bin; written to `out`.

    Bin i looks at the vertices first[i] to last[i] alone. The floor at 0 is averaged over the bin: a straight
    flank that changes by 2 d over it gives (s + d)^2 / (4 d) where it crosses 0.
    """
    walkers, bins = out.shape
    for w in range(walkers):
        total = radii[w] + tip_radius
        for i in range(bins):
            nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
            qx = feet[i, 0] + tip_radius * nx
            qy = feet[i, 1] + tip_radius * ny
            qz = feet[i, 2] + tip_radius * nz
            best, mx, my, mz = -1e300, 0.0, 0.0, 0.0
            for k in range(first[i], last[i] + 1):
                px, py, pz = chains[w, k, 0], chains[w, k, 1], chains[w, k, 2]
                ox, oy, oz = qx - px, qy - py, qz - pz
                t = _exit(ox, oy, oz, nx, ny, nz, total)
                if t > best:
                    best, mx, my, mz = t, ox + t * nx, oy + t * ny, oz + t * nz
                if k == last[i]:
                    break
                ux, uy, uz = chains[w, k + 1, 0] - px, chains[w, k + 1, 1] - py, chains[w, k + 1, 2] - pz
                length = np.sqrt(ux * ux + uy * uy + uz * uz)
                if length < 1e-300:
                    continue
                ux, uy, uz = ux / length, uy / length, uz / length
                o_along = ox * ux + oy * uy + oz * uz
                n_along = nx * ux + ny * uy + nz * uz
                ax, ay, az = ox - o_along * ux, oy - o_along * uy, oz - o_along * uz
                bx, by, bz = nx - n_along * ux, ny - n_along * uy, nz - n_along * uz
                t = _exit(ax, ay, az, bx, by, bz, total)
                if t <= best:
                    continue
                place = o_along + t * n_along
                if place >= 0.0 and place <= length:
                    best, mx, my, mz = t, ax + t * bx, ay + t * by, az + t * bz
            if best < -1e299:
                out[w, i] = 0.0
                continue
            rise = mx * nx + my * ny + mz * nz
            run = abs(mx * tangents[i, 0] + my * tangents[i, 1] + mz * tangents[i, 2])
            # Near the horizon of the chain the flank is vertical; the slope of 45 degrees is steep enough there.
            d = half_bin[i] * (run / rise if run < rise else 1.0)
            if best >= d:
                out[w, i] = best
            elif best <= -d:
                out[w, i] = 0.0
            else:
                out[w, i] = (best + d) * (best + d) / (4.0 * d)
