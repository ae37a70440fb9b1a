"""Where the cubic pieces of a sweep's curve cross planes, compiled."""

from __future__ import annotations

import numpy as np

from mapping.geometry.mesh import borrowing, dot, inlined, nearest_from, scaled, sub, vector

PLANE_CROSSING_ROUNDS = 6


@borrowing
def plane_crossings(nodes, boxes, arriving, leaving, points, normals, waiting, out):  # type: ignore[no-untyped-def]
    """Write (N, 3) where the curve crosses the plane through each point; NaN where it does not.

    From the node nearest to a point a secant finds the segment, then Newton's rule the place on its cubic. Points that
    follow one another, as along a sweep, have their nearest nodes found at once.

    Args:
        nodes, arriving, leaving: (M, 3) of the curve.
        boxes: about the nodes, of `boxes_about`.
        points, normals: (N, 3) of the planes.
        waiting: (MOST_WAITING,) to work in.
        out: (N, 3).
    """
    last, nearest = len(nodes) - 2, 0
    for q in range(len(points)):
        p, n = vector(points, q), vector(normals, q)
        nearest = nearest_from(nodes, boxes, nearest, p, np.inf, waiting)[1]
        i = min(nearest, last)
        start = dot(sub(vector(nodes, i), p), n)
        stop = dot(sub(vector(nodes, i + 1), p), n)
        for _ in range(PLANE_CROSSING_ROUNDS):
            step = -start / (stop - start) if stop != start else 0.0
            there = int(min(max(i + np.floor(min(max(step, -1e6), 1e6)), 0), last))
            if there == i:
                break
            i = there
            start = dot(sub(vector(nodes, i), p), n)
            stop = dot(sub(vector(nodes, i + 1), p), n)
        if np.sign(start) * np.sign(stop) > 0:
            out[q] = np.nan
            continue
        way = sub(vector(nodes, i + 1), vector(nodes, i))
        length = np.sqrt(dot(way, way))
        leave, arrive = scaled(length, vector(leaving, i)), scaled(length, vector(arriving, i + 1))
        # heights over the plane are a cubic of their own
        u, v = dot(leave, n), dot(arrive, n)
        t = start / (start - stop) if start != stop else 0.0
        for _ in range(PLANE_CROSSING_ROUNDS):
            height, rise = _cubic(start, stop - start, u, v, t)
            before, t = t, min(max(t - (height / rise if rise != 0 else 0.0), 0.0), 1.0)
            if t == before:
                break
        for k in range(3):
            out[q, k] = _cubic(nodes[i, k], way[k], leave[k], arrive[k], t)[0]


@inlined
def _cubic(a, way, u, v, t):  # type: ignore[no-untyped-def]
    """A Hermite cubic from a to a + way, with the derivatives u and v there, at the share t, and its derivative."""
    place = a + way * t * t * (3 - 2 * t) + u * t * (1 - t) ** 2 - v * t * t * (1 - t)
    slope = way * 6 * t * (1 - t) + u * (1 - t) * (1 - 3 * t) + v * t * (3 * t - 2)
    return place, slope
