"""Vectors as tuples of three floats: registers, not arrays, inside numba kernels."""

from __future__ import annotations

from mapping.geometry.mesh.borrowing_kernels import borrowing


@borrowing
def dot(a, b):  # type: ignore[no-untyped-def]
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@borrowing
def cross(a, b):  # type: ignore[no-untyped-def]
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@borrowing
def sub(a, b):  # type: ignore[no-untyped-def]
    """a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@borrowing
def scaled(s, a):  # type: ignore[no-untyped-def]
    """s a."""
    return (s * a[0], s * a[1], s * a[2])


@borrowing
def moved(a, s, b):  # type: ignore[no-untyped-def]
    """a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@borrowing
def vector(array, i):  # type: ignore[no-untyped-def]
    """Row i of an (N, 3) array."""
    return (array[i, 0], array[i, 1], array[i, 2])
