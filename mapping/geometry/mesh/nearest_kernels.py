"""The nearest of many triangles to given points (numba), in the frame of a TriangleTree."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from mapping.geometry.mesh.borrowing_kernels import borrowing
from mapping.geometry.mesh.bvh_kernels import BOX_ROUNDING, STACK, WIDTH, push_lanes
from mapping.geometry.mesh.triangle_row_kernels import QUERIES_PER_BLOCK, closest
from mapping.geometry.mesh.vector_kernels import dot, moved, vector


@njit(cache=True, error_model="numpy", nogil=True)
def nearest_points(rows, order, leaves, boxes, links, queries, points, face):  # type: ignore[no-untyped-def]
    """Write the nearest point of each query and the number of its face, the lowest of equally near ones."""
    stack = np.empty(STACK, np.int32)
    apart, late = np.empty(WIDTH, np.float32), np.empty(WIDTH, np.float32)
    guess = 0
    for q in range(len(queries)):
        if q % QUERIES_PER_BLOCK == 0:
            guess = 0
        o = vector(queries, q)
        guess = nearest_triangle(rows, order, leaves, boxes, links, o, guess, stack, apart, late)
        p = moved(o, 1.0, closest(rows, guess, o))
        p = moved(p, 1.0, closest(rows, guess, p))  # back onto the face, should o be far away
        points[q, 0], points[q, 1], points[q, 2] = p
        face[q] = order[guess]


@borrowing
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
