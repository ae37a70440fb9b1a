"""The nearest of many triangles to given points (numba), in the frame of a TriangleTree."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from mapping.geometry.mesh.borrowing_kernels import borrowing
from mapping.geometry.mesh.bvh_kernels import BOX_ROUNDING, STACK, WIDTH, push_lanes
from mapping.geometry.mesh.triangle_row_kernels import QUERIES_PER_BLOCK, closest
from mapping.geometry.mesh.vector_kernels import dot, moved, sub, vector


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


@njit(cache=True, error_model="numpy", nogil=True)
def places_on_faces(vertices, faces, face_normals, edge_normals, vertex_normals, border,  # type: ignore[no-untyped-def]
                    queries, points, face, barycentric, normals, distance, side):  # fmt: skip
    """Write where the nearest points lie in their faces, the pseudonormals there, distances, and sides of the queries.

    A barycentric coordinate below `border` counts as zero: the point lies on an edge, or on a vertex. In one pass: as
    operations on whole arrays this took as long as the search.
    """
    w = np.empty(3)
    for q in range(len(queries)):
        f = face[q]
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        corner, p, o = vector(vertices, a), vector(points, q), vector(queries, q)
        u, v, to = sub(vector(vertices, b), corner), sub(vector(vertices, c), corner), sub(p, corner)
        uu, uv, vv, wu, wv = _product(u, u), _product(u, v), _product(v, v), _product(to, u), _product(to, v)
        det = uu * vv - uv * uv
        second = (vv * wu - uv * wv) / det if det > 0.0 else 0.0
        third = (uu * wv - uv * wu) / det if det > 0.0 else 0.0
        w[0], w[1], w[2] = 1.0 - second - third, second, third
        for k in range(3):
            w[k] = min(max(w[k], 0.0), 1.0)
        total, zeros, zero, most = w[0] + w[1] + w[2], 0, 0, 0
        for k in range(3):
            barycentric[q, k] = w[k] / total
        for k in range(2, -1, -1):  # downwards, so that of several the first stays
            if barycentric[q, k] < border:
                zeros, zero = zeros + 1, k
            if barycentric[q, k] >= barycentric[q, most]:
                most = k
        n = vector(face_normals, f)
        if zeros == 1:
            n = (edge_normals[f, zero, 0], edge_normals[f, zero, 1], edge_normals[f, zero, 2])
        elif zeros == 2:
            n = vector(vertex_normals, faces[f, most])
        normals[q, 0], normals[q, 1], normals[q, 2] = n
        off = sub(o, p)
        side[q] = 1.0 if _product(off, n) >= 0.0 else -1.0
        distance[q] = sqrt(dot(off, off))


@borrowing
def _product(a, b):  # type: ignore[no-untyped-def]
    """Scalar product, its terms added as numpy's einsum adds those of rows."""
    return a[0] * b[0] + a[2] * b[2] + a[1] * b[1]
