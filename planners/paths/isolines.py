"""Isolines: the level sets of a field on a mesh, as polylines with the normals of the faces they cross."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Isoline:
    """A polyline on a mesh: `points` (K, 3) m on mesh edges, `faces` (K-1,) crossed between them."""

    points: FloatArray
    faces: IntArray

    @property
    def closed(self) -> bool:
        """True if it returns to its beginning."""
        return len(self.points) > 2 and bool(np.array_equal(self.points[0], self.points[-1]))

    @property
    def length(self) -> float:
        """Length, m."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def isolines(vertices: FloatArray, faces: IntArray, chart: IntArray, values: FloatArray, level: float) -> list[Isoline]:
    """Polylines where the linearly interpolated field has the value `level`.

    Marching triangles: a vertex exactly at the level counts as above it, so every crossed face has exactly
    two crossed edges.

    Args:
        vertices, faces: (V, 3) and (F, 3) of the mesh.
        chart: faces to look at.
        values: (V,) field.
    """
    above = values[faces[chart]] >= level
    crossed = above.any(axis=1) & ~above.all(axis=1)
    owner, above = chart[crossed], above[crossed]
    if len(owner) == 0:
        return []
    # of the three edges (k, k+1) of a crossed face, two change side
    change = above != np.roll(above, -1, axis=1)
    corner = np.argsort(~change, axis=1, kind="stable")[:, :2]
    rows = faces[owner]
    ends = np.stack(
        [np.take_along_axis(rows, corner, axis=1), np.take_along_axis(rows, (corner + 1) % 3, axis=1)], axis=2
    )
    edges, name = np.unique(np.sort(ends.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    low, high = values[edges[:, 0]], values[edges[:, 1]]
    weight = ((level - low) / (high - low))[:, None]
    points = (1.0 - weight) * vertices[edges[:, 0]] + weight * vertices[edges[:, 1]]
    pairs = name.reshape(-1, 2)
    return [Isoline(points[nodes], owner[used]) for nodes, used in _chains(pairs, len(points))]


def _chains(pairs: IntArray, count: int) -> Iterator[tuple[IntArray, IntArray]]:
    """Chains of segments (nodes, segment indices); open ones first, each begun at an end."""
    touching: list[list[int]] = [[] for _ in range(count)]
    for segment, (a, b) in enumerate(pairs.tolist()):
        touching[a].append(segment)
        touching[b].append(segment)
    used = np.zeros(len(pairs), dtype=bool)
    ends = [node for node, segments in enumerate(touching) if len(segments) == 1]
    for start in [*ends, *range(count)]:
        while any(not used[segment] for segment in touching[start]):
            yield _walk(start, pairs, touching, used)


def _walk(start: int, pairs: IntArray, touching: list[list[int]], used: BoolArray) -> tuple[IntArray, IntArray]:
    nodes, node = [start], start
    segments: list[int] = []
    while True:
        free = [segment for segment in touching[node] if not used[segment]]
        if not free:
            return np.array(nodes), np.array(segments)
        segment = free[0]
        used[segment] = True
        a, b = int(pairs[segment, 0]), int(pairs[segment, 1])
        node = b if node == a else a
        nodes.append(node)
        segments.append(segment)
