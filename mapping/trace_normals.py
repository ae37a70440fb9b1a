"""Normals of the traced surface at the points of its sweeps, from positions alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapping.contact_row import ContactRow
from mapping.cross_slope import cross_tangents
from mapping.sweep_mesh import parallel_rows
from mapping.sweep_tangents import unit
from mapping.trace import Trace

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def surface_normals(trace: Trace, row: ContactRow, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Outward unit normals (M, 3) at the points of `row`, and the curvature (M,) across, 1/m, NaN where unknown.

    A single sweep knows its slope along itself only: its normals stay in the plane of tangent and outward
    direction. Parallel sweeps add the slope across; any other arrangement gets it from local fits.
    """
    if len(np.unique(trace.sweep)) < 2:
        return row.normals, np.full(len(row.normals), np.nan)
    along = np.zeros_like(trace.centers)
    own = row.sample >= 0
    along[row.sample[own]] = row.tangents[own]
    rows = parallel_rows(trace.centers, trace.sweep)
    if rows is None:
        across, bend = _fitted(trace, trace.centers, along, outward), np.full(len(trace), np.nan)
    else:
        across, bend = cross_tangents(trace.centers, along, outward, rows)
        lost = np.isnan(bend)
        across[lost] = _fitted(trace, trace.centers[lost], along[lost], outward[lost])
    normals = unit(np.cross(row.tangents, across[row.nearest]))
    side = np.sign(np.einsum("ij,ij->i", normals, outward[row.nearest]))
    return np.where((side == 0)[:, None], row.normals, normals * side[:, None]), bend[row.nearest]


def _fitted(
    trace: Trace, points: FloatArray, along: FloatArray, outward: FloatArray, neighbours: int = 24
) -> FloatArray:
    """Tangents across the sweeps at `points` from quadratic fits to the nearest samples of the thinned trace."""
    from scipy.spatial import cKDTree

    from mapping.sweep_mesh import pitch, thinned

    kept = thinned(trace.centers, trace.sweep, pitch(trace.centers, trace.sweep))
    cloud = trace.centers[kept]
    across = unit(np.cross(outward, along))
    up = unit(np.cross(along, across))
    up *= np.where(np.einsum("ij,ij->i", up, outward) < 0, -1.0, 1.0)[:, None]
    count = min(neighbours, len(cloud))
    distance, index = (np.asarray(found) for found in cKDTree(cloud).query(points, k=[*range(1, count + 1)]))
    scale = np.maximum(distance[:, -1:], 1e-300)
    arm = (cloud[index] - points[:, None]) / scale[..., None]
    u, v, w = (np.einsum("nkc,nc->nk", arm, axis) for axis in (along, across, up))
    columns = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    weight = np.exp(-2.0 * (distance / scale) ** 2)[..., None]
    fit = np.linalg.pinv(columns * weight, rcond=1e-9) @ (w[..., None] * weight)
    return unit(across + fit[:, 2] * up)
