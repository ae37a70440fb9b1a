"""Whether points come in rows, and their order along a Morton curve (numba)."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numba import njit

from mapping.geometry.mesh import borrowing


@njit(cache=True, error_model="numpy", nogil=True)
def in_rows(points, most):  # type: ignore[no-untyped-def]
    """True if the mean step from a point to the next is at most so many extents over the root of their number."""
    _, extent = corner_and_extent(points)
    total = 0.0
    for i in range(1, len(points)):
        square = 0.0
        for k in range(3):
            step = points[i, k] - points[i - 1, k]
            square += step * step
        total += sqrt(square)
    mean = total / (len(points) - 1)
    return not (extent < inf and mean * sqrt(len(points)) > most * extent)


@njit(cache=True, error_model="numpy", nogil=True)
def along_curve(points, bits):  # type: ignore[no-untyped-def]
    """(N,) the points along a Morton curve of cells with so many bits of each coordinate, by counting bit by bit."""
    low, extent = corner_and_extent(points)
    most, values = 2**bits - 1, 2**bits
    cell = values / extent
    codes, order = np.empty(len(points), np.uint32), np.arange(len(points))
    for i in range(len(points)):
        code = np.uint32(0)
        for k in range(3):
            code |= spread(np.uint32(min((points[i, k] - low[k]) * cell, float(most)))) << np.uint32(k)
        codes[i] = code
    after, counts = np.empty(len(points), np.int64), np.empty(values + 1, np.int64)
    for digit in range(3):
        shift = np.uint32(bits * digit)
        counts[:] = 0
        for i in range(len(codes)):
            counts[np.int64((codes[i] >> shift) & np.uint32(most)) + 1] += 1
        for i in range(values):
            counts[i + 1] += counts[i]
        for j in range(len(order)):
            value = np.int64((codes[order[j]] >> shift) & np.uint32(most))
            after[counts[value]] = order[j]
            counts[value] += 1
        order, after = after, order
    return order


@borrowing
def corner_and_extent(points):  # type: ignore[no-untyped-def]
    """The smallest coordinates, and the longest extent."""
    low, high = (inf, inf, inf), (-inf, -inf, -inf)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        low = (min(low[0], x), min(low[1], y), min(low[2], z))
        high = (max(high[0], x), max(high[1], y), max(high[2], z))
    return low, max(high[0] - low[0], high[1] - low[1], high[2] - low[2])


@borrowing
def spread(bits):  # type: ignore[no-untyped-def]
    """The ten low bits, each with two zeros before it."""
    bits = (bits | bits << np.uint32(16)) & np.uint32(0x030000FF)
    bits = (bits | bits << np.uint32(8)) & np.uint32(0x0300F00F)
    bits = (bits | bits << np.uint32(4)) & np.uint32(0x030C30C3)
    return (bits | bits << np.uint32(2)) & np.uint32(0x09249249)
