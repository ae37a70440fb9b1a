"""Parallel surface: a surface displaced along its normals, and the caustic points where it folds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mapping import BoolArray, FloatArray, IntArray, ParallelError, Surface


@dataclass(frozen=True, eq=False)
class ParallelSurface:
    """The parallel surface f + r z of a mesh (the paper's equation 4; theory equation 1.1).

    Args:
        surface: the displaced mesh, same faces. It is the traced surface where nothing folds and nothing else
            is in the ball's way.
        stretch: (V, 2) factors 1 + r k by which the two principal directions are stretched; negative where the
            surface has turned inside out and the ball cannot be.
        caustics: (M, 3) caustic points, m: on the displaced edges along which a factor changes sign.
        edges: (M, 2) those edges, as pairs of vertices.
    """

    surface: Surface
    stretch: FloatArray
    caustics: FloatArray
    edges: IntArray

    @property
    def reachable(self) -> BoolArray:
        """(V,) whether the ball can touch the vertex as far as its neighbourhood says."""
        return np.asarray((self.stretch >= 0).all(axis=1))


def parallel_surface(
    surface: Surface, tip_radius: float, normals: ArrayLike, k1: ArrayLike, k2: ArrayLike
) -> ParallelSurface:
    """The parallel surface at a distance, with its caustic points.

    Args:
        tip_radius: distance r, m; negative for the inner parallel surface.
        normals: (V, 3) outward unit normals at the vertices.
        k1, k2: (V,) principal curvatures, 1/m, positive where the body bulges out; for a mesh without a formula
            take mapping.principal_curvatures.

    Raises:
        ParallelError: shapes that do not match the vertices, or values that are not finite.

    Reference: the paper, equation 4 and its discussion of caustic points; theory sections 1 and 3.
    """
    z, k = np.asarray(normals, dtype=np.float64), np.column_stack([np.ravel(k1), np.ravel(k2)]).astype(np.float64)
    count = len(surface.vertices)
    if z.shape != (count, 3) or k.shape != (count, 2):
        raise ParallelError(
            f"normals and curvatures must belong to the {count} vertices; found {z.shape} and {k.shape[0]}"
        )
    if not (np.isfinite(z).all() and np.isfinite(k).all() and np.isfinite(tip_radius)):
        raise ParallelError("normals, curvatures and distance must be finite; find a surface's invalid vertices first")
    stretch = 1 + tip_radius * k
    displaced = surface.vertices + tip_radius * z
    edges = np.unique(np.sort(surface.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    points, folded = [], []
    for factor in stretch.T:
        start, stop = factor[edges[:, 0]], factor[edges[:, 1]]
        crossing = (start < 0) != (stop < 0)
        share = (start[crossing] / (start[crossing] - stop[crossing]))[:, None]
        ends = displaced[edges[crossing]]
        points.append(ends[:, 0] * (1 - share) + ends[:, 1] * share)
        folded.append(edges[crossing])
    return ParallelSurface(
        Surface(displaced, surface.faces), stretch, np.concatenate(points), np.concatenate(folded).astype(np.int64)
    )
