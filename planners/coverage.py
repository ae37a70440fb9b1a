"""Coverage: which share of each face lies within the strips that sweeps inspect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.surface import Surface

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Coverage:
    """How much of a mesh was inspected.

    Args:
        share: (F,) inspected share of each face, 0 to 1.
        fraction: inspected share of the area of all faces (of the region).
        reach: distance from a sweep up to which a feature is seen, m.
    """

    share: FloatArray
    fraction: float
    reach: float


def coverage(surface: Surface, touched: FloatArray, reach: float, region: NDArray[np.bool_] | None = None) -> Coverage:
    """Coverage of a mesh by the points (N, 3) that sweeps touched.

    Every face is sampled three times as finely as `reach`; a sample is inspected if a touched point lies within
    `reach` of it in space.

    Args:
        region: (F,) faces that were to be inspected; all if None.
    """
    from scipy.spatial import cKDTree

    points, owner = face_samples(surface, reach / 3.0)
    near = np.zeros(len(points), dtype=bool)
    if len(touched):
        distance, _ = cKDTree(touched).query(points, distance_upper_bound=reach)
        near = np.isfinite(distance)
    count = len(surface.faces)
    share = np.bincount(owner, weights=near, minlength=count) / np.bincount(owner, minlength=count)
    areas = surface.face_areas if region is None else surface.face_areas * region
    total = float(areas.sum())
    return Coverage(share, float((share * areas).sum() / total) if total > 0 else 0.0, reach)


def face_samples(surface: Surface, spacing: float) -> tuple[FloatArray, NDArray[np.int64]]:
    """Points (N, 3) spread evenly over every face, at most about `spacing` apart, and the face of each."""
    corners = surface.vertices[surface.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    # a face of 200 subdivisions already has 40 000 samples
    parts = np.clip(np.ceil(longest / spacing), 1, 200).astype(np.int64)
    points, owner = [], []
    for n in np.unique(parts):
        faces = np.flatnonzero(parts == n)
        i, j = np.divmod(np.arange(n * n), n)
        flip = i + j >= n
        u = np.where(flip, n - i - 1 / 3, i + 1 / 3) / n
        v = np.where(flip, n - j - 1 / 3, j + 1 / 3) / n
        weights = np.column_stack([1 - u - v, u, v])
        points.append(np.einsum("sk,fkx->fsx", weights, corners[faces]).reshape(-1, 3))
        owner.append(np.repeat(faces, n * n))
    return np.concatenate(points), np.concatenate(owner)
