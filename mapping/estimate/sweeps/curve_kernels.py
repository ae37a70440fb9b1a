"""Where the cubic pieces of a sweep's curve cross planes, compiled."""

from __future__ import annotations

import numpy as np

from mapping.geometry.mesh import borrowing, dot, inlined, sub, vector

PLANE_CROSSING_ROUNDS = 6


@borrowing
def plane_crossings(nodes, arriving, leaving, nearest, points, normals, out):  # type: ignore[no-untyped-def]
    """Write (N, 3) where the curve crosses the plane through each point; NaN where it does not.

    From the node `nearest` to a point a secant finds the segment, then Newton's rule the place on its cubic.
    """
    last = len(nodes) - 2
    for q in range(len(points)):
        p, n = vector(points, q), vector(normals, q)
        i = min(max(nearest[q], 0), last)
        start = dot(sub(vector(nodes, i), p), n)
        stop = dot(sub(vector(nodes, i + 1), p), n)
        for _ in range(PLANE_CROSSING_ROUNDS):
            step = -start / (stop - start) if stop != start else 0.0
            i = int(min(max(i + np.floor(min(max(step, -1e6), 1e6)), 0), last))
            start = dot(sub(vector(nodes, i), p), n)
            stop = dot(sub(vector(nodes, i + 1), p), n)
        if np.sign(start) * np.sign(stop) > 0:
            out[q] = np.nan
            continue
        t = start / (start - stop) if start != stop else 0.0
        for _ in range(PLANE_CROSSING_ROUNDS):
            height, rise = 0.0, 0.0
            for k in range(3):
                place, slope = _cubic(nodes, arriving, leaving, i, k, t)
                height += (place - p[k]) * n[k]
                rise += slope * n[k]
            t = min(max(t - (height / rise if rise != 0 else 0.0), 0.0), 1.0)
        for k in range(3):
            out[q, k] = _cubic(nodes, arriving, leaving, i, k, t)[0]


@inlined
def _cubic(nodes, arriving, leaving, i, k, t):  # type: ignore[no-untyped-def]
    """One coordinate of segment i at the share t of its way, and its derivative."""
    chord = 0.0
    for axis in range(3):
        chord += (nodes[i + 1, axis] - nodes[i, axis]) ** 2
    length = np.sqrt(chord)
    a, way = nodes[i, k], nodes[i + 1, k] - nodes[i, k]
    u, v = leaving[i, k] * length, arriving[i + 1, k] * length
    place = a + way * t * t * (3 - 2 * t) + u * t * (1 - t) ** 2 - v * t * t * (1 - t)
    slope = way * 6 * t * (1 - t) + u * (1 - t) * (1 - 3 * t) + v * t * (3 * t - 2)
    return place, slope
