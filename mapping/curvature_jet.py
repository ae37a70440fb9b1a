"""Curvature by local jets that choose their own degree and neighbourhood from the noise."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from mapping.curvature import Curvature, from_operators
from mapping.surface import Surface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Neighbourhoods from which a point chooses; 25 is the square of a regular grid, whose symmetry cancels odd errors.
SIZES = (25, 36, 54, 81, 122, 183, 274, 411, 616)
CONFIDENCE = 3.0
SAMPLE = 3000
# Neighbour indices held at once by one thread: keeps a million points under a gigabyte.
CHUNK_VALUES = 4_000_000
SMOOTHING = 24
# Share of the residual that counts as noise even where all of it seems to be the polynomial's misfit.
NOISE_FLOOR = 1e-3


def jet_curvature(body: Surface | FloatArray, normals: FloatArray | None, noise: float | None = None) -> Curvature:
    """Curvature from polynomials of degree 4 or 2 over the nearest points, by Lepski's rule for each point.

    The noise is the residual of quartic fits over the smallest neighbourhoods; a sample of points tells which
    sizes are ever chosen, and only these are tried on all.

    Args:
        body: mesh or points (N, 3), m.
        normals: (N, 3) outward normals, or None.
        noise: standard deviation of the points along the normal, m, or None: estimated.
    """
    from scipy.spatial import cKDTree

    from mapping.jet_kernels import fit_jets

    points, rough, used = _oriented(body, normals)
    count = len(points)
    if used.sum() < 8:
        nothing = np.full(count, np.nan)
        return from_operators(
            np.full((count, 3), np.nan), np.full((count, 2, 3), np.nan), nothing, np.zeros(count, dtype=bool)
        )
    index = np.flatnonzero(used)
    place = points[index] - points[index].mean(axis=0)
    size = float(np.abs(place).max()) or 1.0
    place = place / size
    tree = cKDTree(place)
    smooth = _smoothed_normals(place, rough[index], tree)
    sizes = np.array([s for s in SIZES if s <= max(len(index), SIZES[0])])
    sample = np.linspace(0, len(index) - 1, min(SAMPLE, len(index))).astype(np.int64)

    def fit(chosen: IntArray, which: IntArray, level: float) -> tuple[FloatArray, ...]:
        near = np.asarray(tree.query(place[chosen], k=int(which[-1]))[1], dtype=np.int64)
        return tuple(fit_jets(place, smooth, smooth, near, chosen, which, level, CONFIDENCE))

    level = noise / size if noise is not None else _noise(*(fit(sample, np.array([s]), -1.0)[3] for s in SIZES[:2]))
    taken, degrees = fit(sample, sizes, level)[4:6]
    low, high = np.quantile(taken[degrees > 0], [0.02, 0.98]) if (degrees > 0).any() else (sizes[0], sizes[-1])
    wanted = sizes[(sizes >= 0.9 * low) & (sizes <= 1.1 * high)]
    wanted = wanted if len(wanted) else sizes
    operators, bases = np.full((count, 3), np.nan), np.full((count, 2, 3), np.nan)
    sd, valid = np.full(count, np.nan), np.zeros(count, dtype=bool)
    parts = np.array_split(np.arange(len(index)), max(4, len(index) * int(wanted[-1]) // CHUNK_VALUES))
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        for part, jets in zip(parts, threads.map(lambda p: fit(p, wanted, level), parts), strict=True):
            found, basis, spread, _, _, degree = jets
            operators[index[part]], bases[index[part]] = found / size, basis
            sd[index[part]], valid[index[part]] = spread / size, degree > 0
    return from_operators(operators, bases, sd, valid)


def _noise(small: FloatArray, large: FloatArray) -> float:
    """Noise level from residuals of quartic fits over the two smallest neighbourhoods.

    Noise leaves the same residual in both; what the polynomial cannot follow grows with the fifth power of the
    radius. The median ignores the few points where the surface is not smooth.
    """
    known = np.isfinite(small) & np.isfinite(large)
    if not known.any():
        return 0.0
    first, second = float(np.median(small[known])), float(np.median(large[known]))
    growth = (SIZES[1] / SIZES[0]) ** 5
    square = (growth * first**2 - second**2) / (growth - 1)
    return float(np.sqrt(max(square, (NOISE_FLOOR * first) ** 2)))


def _oriented(
    body: Surface | FloatArray, normals: FloatArray | None
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Points, outward normals, and which points belong to a body at all."""
    if isinstance(body, Surface):
        points = body.vertices
        area = body.face_normals * body.face_areas[:, None]
        total = np.zeros_like(points)
        for corner in range(3):
            np.add.at(total, body.faces[:, corner], area)
        rough = total if normals is None else normals
    else:
        points = body
        rough = points - points.mean(axis=0) if normals is None else normals
    length = np.linalg.norm(rough, axis=1)
    used = length > 0
    return points, np.divide(rough, length[:, None], out=np.zeros_like(rough), where=used[:, None]), used


def _smoothed_normals(place: FloatArray, rough: FloatArray, tree: object) -> FloatArray:
    """Mean normals over the nearest points: noise tilts single triangles."""
    smooth = np.empty_like(rough)
    for part in np.array_split(np.arange(len(place)), max(1, len(place) * SMOOTHING // CHUNK_VALUES)):
        near = tree.query(place[part], k=min(SMOOTHING, len(place)), workers=-1)[1]  # type: ignore[attr-defined]
        same = np.einsum("ijk,ik->ij", rough[near], rough[part]) > 0
        smooth[part] = np.einsum("ijk,ij->ik", rough[near], same.astype(np.float64))
    length = np.linalg.norm(smooth, axis=1, keepdims=True)
    return np.where(length > 0, smooth / np.where(length > 0, length, 1.0), rough)
