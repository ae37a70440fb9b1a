"""The nearest of many triangles, in the frame of a TriangleTree, or of a polyline's legs to given points (numba)."""

from __future__ import annotations

from math import inf, nan, sqrt

import numpy as np
from numba import njit

from mapping.geometry.mesh.borrowing_kernels import borrowing, inlined
from mapping.geometry.mesh.bvh_kernels import BOX_ROUNDING, STACK, lanes, push_lanes
from mapping.geometry.mesh.triangle_row_kernels import QUERIES_PER_BLOCK, closest, corners
from mapping.geometry.mesh.vector_kernels import dot, moved, sub, vector

# A barycentric coordinate below this counts as zero: the point lies on an edge or a vertex
ON_BORDER = 1e-9
# What a point lies in, as the kernels tell it: from the first of each on, one for each corner of the face
INSIDE, ON_EDGE, ON_VERTEX = 0, 1, 4


@njit(cache=True, error_model="numpy", nogil=True)
def nearest_points(  # type: ignore[no-untyped-def]
    rows, order, leaves, boxes, links, queries, points, distance, face, barycentric, part
):  # fmt: skip
    """Write what is nearest to each query (N, 3): all lengths in the tree's frame.

    Args:
        points, distance: (N, 3) nearest points, and (N,) how far they are.
        face: (N,) number of the face that holds it, the lowest of equally near ones.
        barycentric: (N, 3) the point's coordinates in that face.
        part: (N,) INSIDE of it, or ON_EDGE and the number of the corner opposite, or ON_VERTEX and that of the corner.
    """
    stack = np.empty(STACK, np.int32)
    found = lanes(2)
    apart, late = found[0], found[1]
    guess = 0
    for q in range(len(queries)):
        if q % QUERIES_PER_BLOCK == 0:
            guess = 0
        o = vector(queries, q)
        guess = nearest_triangle(rows, order, leaves, boxes, links, o, guess, stack, apart, late)
        p = moved(o, 1.0, closest(rows, guess, o))
        p = moved(p, 1.0, closest(rows, guess, p))  # back onto the face, should o be far away
        points[q, 0], points[q, 1], points[q, 2] = p
        away = sub(o, p)
        distance[q] = sqrt(dot(away, away))
        face[q] = order[guess]
        weights = shares_of(rows, guess, p)
        barycentric[q, 0], barycentric[q, 1], barycentric[q, 2] = weights
        part[q] = part_of(weights)


@njit(cache=True, error_model="numpy", nogil=True)
def nearer_than(rows, leaves, boxes, links, queries, reach, near):  # type: ignore[no-untyped-def]
    """Write to (N,) whether a triangle is nearer than `reach` to each query (N, 3), in the tree's frame: the first that
    is found ends the search."""
    stack = np.empty(STACK, np.int32)
    found = lanes(2)
    apart, late = found[0], found[1]
    still = (0.0, 0.0, 0.0)
    for q in range(len(queries)):
        o = vector(queries, q)
        within = reach + BOX_ROUNDING * sqrt(dot(o, o))
        near[q] = False
        stack[0] = len(links) - 1
        waiting = 1
        while waiting > 0 and not near[q]:
            i = -1 - stack[waiting - 1]
            if i < 0:
                waiting = push_lanes(leaves, boxes, links, stack, waiting, o, o, still, 0.0, within, apart, late)
                continue
            waiting -= 1
            p = closest(rows, i, o)
            near[q] = dot(p, p) < reach * reach


@borrowing
def shares_of(rows, i, p):  # type: ignore[no-untyped-def]
    """Barycentric coordinates in a triangle of its point p, none below zero; all at its first corner if it is flat."""
    a, b, c, _ = corners(rows, i, (0.0, 0.0, 0.0))
    u, v, w = sub(b, a), sub(c, a), sub(p, a)
    uu, uv, vv, wu, wv = dot(u, u), dot(u, v), dot(v, v), dot(w, u), dot(w, v)
    det = uu * vv - uv * uv
    second, third = 0.0, 0.0
    if det > 0.0:
        second, third = (vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det
    first = min(max(1.0 - second - third, 0.0), 1.0)
    second, third = min(max(second, 0.0), 1.0), min(max(third, 0.0), 1.0)
    total = first + second + third
    return (first / total, second / total, third / total)


@borrowing
def part_of(weights):  # type: ignore[no-untyped-def]
    """The smallest part of a triangle that holds the point of so many shares."""
    zeros, out, most = 0, 0, 0
    for k in range(3):
        if weights[k] < ON_BORDER:
            zeros, out = zeros + 1, k
        if weights[k] > weights[most]:
            most = k
    return INSIDE if zeros == 0 else ON_EDGE + out if zeros == 1 else ON_VERTEX + most


@inlined
def nearest_triangle(rows, order, leaves, boxes, links, o, guess, stack, apart, late):  # type: ignore[no-untyped-def]
    """The triangle nearest to o, looked for in the neighbourhood that the distance of `guess` leaves."""
    best, still = guess, (0.0, 0.0, 0.0)
    p = closest(rows, guess, o)
    least = dot(p, p)
    slack = BOX_ROUNDING * sqrt(dot(o, o))  # float32 has fewer digits for points far from the body
    stack[0] = len(links) - 1
    waiting = 1
    while waiting > 0:
        i = -1 - stack[waiting - 1]
        if i < 0:
            waiting = push_lanes(
                leaves, boxes, links, stack, waiting, o, o, still, 0.0, sqrt(least) + slack, apart, late
            )
            continue
        waiting -= 1
        p = closest(rows, i, o)
        square = dot(p, p)
        if square < least or (square == least and order[i] < order[best]):
            best, least = i, square
    return best


@borrowing
def nearest_on_legs(points, polyline, lengths, on, along):  # type: ignore[no-untyped-def]
    """Write the nearest point of a polyline to each point, on the first of equally near legs, and its arclength.

    Args:
        points: (N, 3) m.
        polyline: (K, 3) m, two points or more.
        lengths: (K,) arclength of each of its points, m.
        on, along: (N, 3) and (N,) m.
    """
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        least = inf
        on[n, 0] = on[n, 1] = on[n, 2] = along[n] = nan
        for k in range(len(polyline) - 1):
            ax, ay, az = polyline[k, 0], polyline[k, 1], polyline[k, 2]
            u, v, w = polyline[k + 1, 0] - ax, polyline[k + 1, 1] - ay, polyline[k + 1, 2] - az
            square = u * u + v * v + w * w
            share = (x - ax) * u + (y - ay) * v + (z - az) * w
            share = min(max(share / square, 0.0), 1.0) if square > 0.0 else 0.0
            px, py, pz = ax + share * u, ay + share * v, az + share * w
            apart = (x - px) * (x - px) + (y - py) * (y - py) + (z - pz) * (z - pz)
            if apart < least:
                least = apart
                on[n, 0], on[n, 1], on[n, 2] = px, py, pz
                along[n] = lengths[k] + share * sqrt(square)
