"""The borders of a mesh."""

import numpy as np

from mapping.surface import Surface


def border_loops(surface: Surface):
    """Number of loops of edges that belong to one face only; -1 where an edge has more than two faces."""
    edges = np.sort(surface.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    if count.max() > 2:
        return -1
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    border = unique[count == 1]
    if len(border) == 0:
        return 0
    size = len(surface.vertices)
    graph = coo_matrix((np.ones(len(border)), border.T), shape=(size, size))
    parts = connected_components(graph, directed=False)[1]
    return len(np.unique(parts[border]))
