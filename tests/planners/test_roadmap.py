"""Roadmap: the shortest way over it is as short as Dijkstra's, and none is made up."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from planners.paths.roadmap_kernels import shortest_way


@pytest.mark.parametrize("seed", range(4))
def test_a_way_is_as_short_as_dijkstra_s(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(400, 3))
    pairs = cKDTree(points).query_pairs(0.14, output_type="ndarray")
    ends = np.concatenate([pairs, pairs[:, ::-1]])
    lengths = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    graph = csr_array((lengths, (ends[:, 0], ends[:, 1])), shape=(400, 400))
    shortest = dijkstra(graph, indices=0)
    assert 0 < np.isinf(shortest).sum() < 200  # some are out of reach
    for target in range(400):
        way = shortest_way(graph.indptr, graph.indices, graph.data, points, 0, target)
        if np.isinf(shortest[target]):
            assert len(way) == 0
            continue
        assert (way[0], way[-1]) == (0, target)
        steps = np.array([graph[a, b] for a, b in pairwise(way)])
        assert (steps > 0).all()  # every one of them is an edge
        assert steps.sum() == pytest.approx(shortest[target])
