"""Normals of the traced surface at the points of its sweeps, from positions alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapping.contact_row import ContactRow
from mapping.cross_slope import CrossSlope, cross_slope
from mapping.estimate import TOUCHED
from mapping.sweep_curve import SweepCurve
from mapping.sweep_rows import parallel_rows, pitch, thinned
from mapping.sweep_tangents import lagrange, unit
from mapping.trace import Trace

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Samples whose neighbourhoods are fitted together: a bound on the memory that they take
AT_ONCE = 16_384


def surface_normals(trace: Trace, row: ContactRow, outward: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Outward unit normals (M, 3) at the points of `row`, curvature across (M,), 1/m, and doubt of the slope (M,), rad.

    A single sweep knows its slope along itself only: its normals stay in the plane of tangent and outward
    direction, as of a profile. Parallel sweeps add the slope across; other arrangements take it from local fits.
    """
    if len(np.unique(trace.sweep)) < 2:
        return row.normals, np.full(len(row.normals), np.nan), np.zeros(len(row.normals))
    along = np.zeros_like(trace.centers)
    own = row.sample >= 0
    along[row.sample[own]] = row.tangents[own]
    rows = parallel_rows(trace.centers, trace.sweep)
    unknown = np.full(len(trace), np.nan)
    slope = (
        CrossSlope(along.copy(), unknown, unknown.copy())
        if rows is None
        else cross_slope(trace.centers, along, outward, rows, _curves(trace, row, rows))
    )
    lost = np.flatnonzero(np.isnan(slope.doubt))
    slope.tangents[lost], slope.doubt[lost] = _fitted(trace, lost, along[lost], outward[lost])
    across = slope.tangents[row.nearest]
    ends, continued = at_kinks(trace, row, slope.tangents)
    across[ends] = continued
    normals = unit(np.cross(row.tangents, across))
    side = np.sign(np.einsum("ij,ij->i", normals, outward[row.nearest]))
    normals = np.where((side == 0)[:, None], row.normals, normals * side[:, None])
    return normals, slope.curvature[row.nearest], slope.doubt[row.nearest]


def at_kinks(trace: Trace, row: ContactRow, directions: FloatArray) -> tuple[IntArray, FloatArray]:
    """Unit directions (N, 3) of the samples continued to both sides of each interference point, from its own side.

    Returns:
        (K,) indices of the contacts at interference points, and (K, 3) directions there.
    """
    ends = np.flatnonzero((row.sample < 0) & (row.labels == TOUCHED))
    way = np.where(row.sample[ends - 1] >= 0, -1, 1)  # the first contact of a fan follows a sample
    samples = row.nearest[ends][:, None] + way[:, None] * np.arange(4)
    held = (samples >= 0) & (samples < len(trace))
    samples = np.asarray(np.clip(samples, 0, len(trace) - 1), dtype=np.int64)
    held &= trace.sweep[samples] == trace.sweep[samples[:, :1]]
    points = trace.centers[samples]
    s = np.cumsum(np.linalg.norm(np.diff(points, axis=1, prepend=points[:, :1]), axis=2), axis=1)
    before = -np.linalg.norm(row.centers[ends] - points[:, 0], axis=1)
    # A kink beside the kink leaves too few samples: then the nearest must do.
    straight = held.all(axis=1) & (np.abs(before) < 2 * s[:, 1]) & (np.diff(s, axis=1) > 0).all(axis=1)
    safe = np.where(straight[:, None], s, np.arange(4.0))
    weights = np.where(straight[:, None], lagrange(safe, before)[0], np.eye(4)[0])
    return np.asarray(ends, dtype=np.int64), unit(np.einsum("km,kmc->kc", weights, directions[samples]))


def _curves(trace: Trace, row: ContactRow, rows: list[IntArray]) -> list[SweepCurve]:
    """The curve of each of `rows`."""
    sweep = trace.sweep[row.nearest]
    return [SweepCurve.of(row.select(np.flatnonzero(sweep == trace.sweep[own[0]]))) for own in rows]


def _fitted(
    trace: Trace, samples: IntArray, along: FloatArray, outward: FloatArray, neighbours: int = 24
) -> tuple[FloatArray, FloatArray]:
    """Tangents across the sweeps, and their doubt, from quadratic fits to the nearest samples of the thinned trace.

    The doubt is three times the residual over the width; it is a right angle where the neighbours lie on one line.
    """
    from scipy.spatial import cKDTree

    cloud = trace.centers[thinned(trace.centers, trace.sweep, pitch(trace.centers, trace.sweep))]
    tree, count = cKDTree(cloud), min(neighbours, len(cloud))
    tangents, doubt = np.empty((len(samples), 3)), np.empty(len(samples))
    for start in range(0, len(samples), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        distance, index = (
            np.asarray(found) for found in tree.query(trace.centers[samples[part]], [*range(1, count + 1)])
        )
        arm = cloud[index] - trace.centers[samples[part], None]
        tangents[part], doubt[part] = _across(arm, distance, along[part], outward[part])
    return tangents, doubt


def _across(
    arm: FloatArray, distance: FloatArray, along: FloatArray, outward: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Tangents across and their doubt from the ways (N, K, 3) to the neighbours of each sample, and their lengths."""
    across = unit(np.cross(outward, along))
    up = unit(np.cross(along, across))
    up *= np.where(np.einsum("ij,ij->i", up, outward) < 0, -1.0, 1.0)[:, None]
    scale = np.maximum(distance[:, -1:], 1e-300)
    arm = arm / scale[..., None]
    u, v, w = (np.einsum("nkc,nc->nk", arm, axis) for axis in (along, across, up))
    columns = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    weight = np.exp(-2.0 * (distance / scale) ** 2)[..., None]
    fit = np.linalg.pinv(columns * weight, rcond=1e-9) @ (w[..., None] * weight)
    residual = np.sqrt((weight * (w[..., None] - columns @ fit) ** 2).mean(axis=(1, 2)))
    width = np.sqrt((weight[..., 0] * v**2).mean(axis=1))
    doubt = np.where(width > 1e-3, 3 * residual / np.maximum(width, 1e-3), np.pi / 2)
    return unit(across + fit[:, 2] * up), doubt
