"""Rows of triangles: corners and unit normal of each, laid out in the order of the tree (numba)."""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping.geometry.mesh.borrowing_kernels import inlined
from mapping.geometry.mesh.triangle_kernels import closest_on_triangle, unit_normal

QUERIES_PER_BLOCK = 1024  # queries that share their guesses: threads that take whole blocks give the same answers


@njit(cache=True, error_model="numpy")
def lay_out(vertices, faces, order):  # type: ignore[no-untyped-def]
    """(F, 12) rows of the faces in the given order."""
    rows = np.empty((len(order), 12))
    for i in range(len(order)):
        for j in range(3):
            for k in range(3):
                rows[i, 3 * j + k] = vertices[faces[order[i], j], k]
        a, b, c, _ = corners(rows, i, (0.0, 0.0, 0.0))
        rows[i, 9], rows[i, 10], rows[i, 11] = unit_normal(a, b, c)
    return rows


@inlined
def corners(rows, i, o):  # type: ignore[no-untyped-def]
    """Corners of a triangle relative to o, and its normal."""
    a = (rows[i, 0] - o[0], rows[i, 1] - o[1], rows[i, 2] - o[2])
    b = (rows[i, 3] - o[0], rows[i, 4] - o[1], rows[i, 5] - o[2])
    c = (rows[i, 6] - o[0], rows[i, 7] - o[1], rows[i, 8] - o[2])
    return a, b, c, (rows[i, 9], rows[i, 10], rows[i, 11])


@inlined
def closest(rows, i, o):  # type: ignore[no-untyped-def]
    """Point of a triangle closest to o, relative to o."""
    a, b, c, n = corners(rows, i, o)
    return closest_on_triangle(a, b, c, n)
