"""The order in which queries are answered: each near the one before, whose part of the tree is at hand still."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, IntArray

# Bits of each coordinate: three times ten fill a number of 32. A cell is a thousandth of the longest extent; points of
# one cell, and of its neighbours, meet the same few leaves of the tree, in whatever order
BITS = 10
# A grid of N points, a in a row, steps by 1 / a of its extent, and as much again on the mean for the ways back to the
# next row: 2 extents / sqrt(N) where it is square, 4 where rows have a quarter as many points as there are rows. More
# than that is no order: points at random step by half an extent
IN_ROWS = 4.0


def morton_order(points: FloatArray) -> IntArray | None:
    """(N,) the points (N, 3) along a Morton curve (Morton 1966); None where they follow one another closely already."""
    if len(points) < 2:
        return None
    low, high = (np.array([end(column) for column in points.T]) for end in (np.min, np.max))  # numpy is slow along rows
    extent = float((high - low).max())
    steps = np.diff(points, axis=0)
    step = float(np.sqrt(np.einsum("ij,ij->i", steps, steps)).mean())
    if not np.isfinite(extent) or step * np.sqrt(len(points)) <= IN_ROWS * extent:
        return None
    cells = np.minimum((points - low) * (2**BITS / extent), 2**BITS - 1).astype(np.uint32)
    codes = _spread(cells[:, 0]) | _spread(cells[:, 1]) << np.uint32(1) | _spread(cells[:, 2]) << np.uint32(2)
    return np.argsort(codes, kind="stable")


def _spread(bits: np.ndarray) -> np.ndarray:
    """The ten low bits, each with two zeros before it."""
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        bits = (bits | bits << np.uint32(shift)) & np.uint32(mask)
    return bits
