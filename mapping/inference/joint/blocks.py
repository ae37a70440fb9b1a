"""Blocks: a crowd of features cut into parts that are worked out at once, each of those that lie nearest together."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mapping import Feature, FloatArray
from mapping.geometry.mesh import distances


def gaps(features: Sequence[Feature], reach: Sequence[float]) -> FloatArray:
    """(N, N) distances between what features disturb, m; less than 0 where that touches.

    Args:
        features: which.
        reach: (N,) half-widths of what they disturb, m.
    """
    apart = np.array([[float(distances(one.axis, other.axis).min()) for other in features] for one in features])
    apart = apart.reshape(len(features), len(features))
    return np.asarray(np.minimum(apart, apart.T) - np.add.outer(reach, reach))


def felt_together(gap: FloatArray) -> list[list[int]]:
    """Numbers of what touches, directly or by others between (N, N) gaps, m."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    count, label = connected_components(csr_array((gap < 0.0).astype(np.float64)), directed=False)
    return [[int(k) for k in np.flatnonzero(label == number)] for number in range(count)]


def blocks_of(gap: FloatArray, order: Sequence[int], too_many: Callable[[Sequence[int]], bool]) -> list[list[int]]:
    """Numbers cut into blocks: each grows from the first one left by whatever is nearest to it and touches it.

    Args:
        gap: (N, N) between what they disturb, m.
        order: of them, those first that blocks begin with.
        too_many: True of numbers that are no block together.
    """
    left, blocks = list(order), list[list[int]]()
    while left:
        block = [left.pop(0)]
        while left:
            nearest = min(left, key=lambda k: float(gap[k, block].min()))
            if gap[nearest, block].min() >= 0.0 or too_many([*block, nearest]):
                break
            left.remove(nearest)
            block.append(nearest)
        blocks.append(block)
    return blocks
