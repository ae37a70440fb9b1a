"""Room: bounds on how far a place is from a body, told by a grid of distances without asking the body."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mapping import FloatArray, Surface
from mapping.base import Base

# Nodes of the grid, which is made before anything moves: 40 000 take 0.1 CPU s. How far it reaches beyond the body, in
# sizes of that: farther out the body's box is bound enough
ROOM_NODES, GRID_MARGIN = 40_000, 0.05


@dataclass(frozen=True, eq=False)
class Room:
    """Signed distances from a closed body at the nodes of a grid, m.

    No place is nearer to the body than another by more than the two lie apart: the nearest node tells the distance of a
    place to within that, and most places that are asked about are far in the open or deep in the body.

    Args:
        low: (3,) the first node, m.
        spacing: of the nodes, m.
        distances: (I, J, K) at the nodes, m, positive outside.
        box: (2, 3) corners of the body's box, m.
    """

    low: FloatArray
    spacing: float
    distances: FloatArray
    box: FloatArray

    def bounds(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N,) least and greatest distance that each of the places (N, 3) may have from the body, m."""
        from planners.paths.room_kernels import distance_bounds

        least, most = np.empty(len(places)), np.empty(len(places))
        distance_bounds(np.ascontiguousarray(places), self.low, self.spacing, self.distances, self.box, least, most)
        return least, most


@lru_cache(maxsize=4)
def room_about(base: Base) -> Room | None:
    """The room about a body, made once; None about an open sheet, round whose border one comes to the other side, and
    where heights are over no surface but off it."""
    if base.offset or not _is_closed(base.surface):
        return None
    box = np.asarray(base.surface.bounds)
    low, high = box + GRID_MARGIN * base.surface.size * np.array([[-1.0], [1.0]])
    spacing = float(((high - low).prod() / ROOM_NODES) ** (1.0 / 3.0))
    axes = [a + spacing * np.arange(1 + int(np.ceil((b - a) / spacing))) for a, b in zip(low, high, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    distances = base.foot(nodes.reshape(-1, 3), 0.0).height
    return Room(low, spacing, distances.reshape(nodes.shape[:3]), box)


def _is_closed(surface: Surface) -> bool:
    """True if every edge has a face on either side, which run along it in opposite directions."""
    edges = surface.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    forward, backward = (edges @ np.array(way) for way in ([len(surface.vertices), 1], [1, len(surface.vertices)]))
    forward = np.sort(forward)
    return bool((np.diff(forward) > 0).all() and np.array_equal(forward, np.sort(backward)))
