"""Compiled search for the shortest way over a roadmap."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

from heapq import heappop, heappush
from typing import Any

import numpy as np
from numba import njit

from mapping import FloatArray, IntArray


@njit(cache=True, error_model="numpy", nogil=True)
def shortest_way(
    starts: IntArray, others: IntArray, lengths: FloatArray, points: FloatArray, source: int, target: int
) -> IntArray:
    """Numbers (K,) of the nodes on the shortest way from one node to another; none if there is none.

    A* (Hart, Nilsson and Raphael 1968) with the straight distance as what is left at least: only nodes near the way are
    looked at. Of ways as long as each other that is taken whose nodes were reached first.

    Args:
        starts: (N + 1,) first edge of each node, and past the last.
        others: (E,) the node that each edge leads to.
        lengths: (E,) m, no shorter than the edge is straight.
        points: (N, 3) m.
    """
    count = len(points)
    known, before = np.full(count, np.inf), np.full(count, -1)
    done = np.zeros(count, dtype=np.bool_)
    known[source] = 0.0
    heap: list[Any] = [(0.0, source)]
    while len(heap):
        node = heappop(heap)[1]
        if done[node]:
            continue
        if node == target:
            break
        done[node] = True
        for edge in range(starts[node], starts[node + 1]):
            other = np.int64(others[edge])
            length = known[node] + lengths[edge]
            if length < known[other]:
                known[other], before[other] = length, node
                left = 0.0
                for axis in range(3):
                    left += (points[other, axis] - points[target, axis]) ** 2
                heappush(heap, (length + np.sqrt(left), other))
    if not np.isfinite(known[target]):
        return np.zeros(0, dtype=np.int64)
    way = [target]
    while way[-1] != source:
        way.append(before[way[-1]])
    return np.array(way[::-1])
