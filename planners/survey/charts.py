"""Charts: parts of a mesh without creases, each surveyed by its own family of sweeps."""

from __future__ import annotations

import numpy as np

from mapping import IntArray, Surface

CREASE_ANGLE = float(np.radians(30.0))


def crease_charts(surface: Surface, crease: float = CREASE_ANGLE) -> list[IntArray]:
    """Faces grouped into charts whose neighbours turn by less than `crease` rad, largest area first.

    Degenerate faces belong to no chart.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(surface.faces)
    wanted = surface.face_areas > 0
    first, second = surface.neighbours
    turn = (surface.face_normals[first] * surface.face_normals[second]).sum(axis=1)
    smooth = (turn > np.cos(crease)) & wanted[first] & wanted[second]
    graph = coo_matrix((np.ones(smooth.sum()), (first[smooth], second[smooth])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    members = np.flatnonzero(wanted)
    order = members[np.argsort(label[members], kind="stable")]
    groups = np.split(order, np.flatnonzero(np.diff(label[order])) + 1) if len(order) else []
    return sorted(groups, key=lambda group: (-float(surface.face_areas[group].sum()), int(group[0])))
