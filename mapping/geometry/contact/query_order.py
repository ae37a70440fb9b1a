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


def morton_order(points: FloatArray) -> IntArray:
    """(N,) the points (N, 3) along a Morton curve (Morton 1966); none where they follow one another closely already."""
    from mapping.geometry.contact.order_kernels import along_curve, in_rows

    none = np.empty(0, dtype=np.int64)
    if len(points) < 2 or in_rows(points, IN_ROWS):
        return none
    return np.asarray(along_curve(points, BITS))
