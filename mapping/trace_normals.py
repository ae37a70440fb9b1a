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


def surface_normals(
    trace: Trace, row: ContactRow, sample: IntArray, nearest: IntArray, outward: FloatArray
) -> FloatArray:
    """(M, 3) outward unit normals at the points of `row`.

    A single sweep knows its slope along itself only: its normals stay in the plane of tangent and outward
    direction. Parallel sweeps add the slope across; any other arrangement gets it from local fits.
    """
    if len(np.unique(trace.sweep)) < 2:
        return row.normals
    along = np.zeros_like(trace.centers)
    along[sample[sample >= 0]] = row.tangents[sample >= 0]
    rows = parallel_rows(trace.centers, trace.sweep)
    if rows is None:
        across = _fitted(trace, trace.centers, along, outward)
    else:
        across, bend = cross_tangents(trace.centers, along, outward, rows)
        lost = np.isnan(bend)
        across[lost] = _fitted(trace, trace.centers[lost], along[lost], outward[lost])
    normals = unit(np.cross(row.tangents, across[nearest]))
    side = np.sign(np.einsum("ij,ij->i", normals, outward[nearest]))
    return np.where((side == 0)[:, None], row.normals, normals * side[:, None])


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
    distance, index = cKDTree(cloud).query(points, k=count)
    scale = np.maximum(distance[:, -1:], 1e-300)
    arm = (cloud[index] - points[:, None]) / scale[..., None]
    u, v, w = (np.einsum("nkc,nc->nk", arm, axis) for axis in (along, across, up))
    columns = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    weight = np.exp(-2.0 * (distance / scale) ** 2)[..., None]
    fit = np.linalg.pinv(columns * weight, rcond=1e-9) @ (w[..., None] * weight)
    return unit(across + fit[:, 2] * up)
