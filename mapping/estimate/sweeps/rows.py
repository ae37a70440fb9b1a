"""Rows: which sweeps run side by side, how far apart, and how to thin them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mapping import BoolArray, FloatArray, IntArray


def parallel_rows(points: FloatArray, sweep: IntArray) -> list[IntArray] | None:
    """Indices of each sweep, neighbours next to each other, if consecutive sweeps run side by side; else None."""
    rows = _of_each(sweep)
    if len(rows) < 2 or min(len(row) for row in rows) < 2:
        return None
    found = []
    for order in (rows, _across(points, rows)):
        distances = [_distance_beside(points[first], points[second]) for first, second in pairwise(order)]
        if not np.isnan(distances).any():
            found.append((sum(distances) * (1 - 1e-9 * (order is rows)), order))
    return min(found, key=lambda pair: pair[0])[1] if found else None


def _of_each(sweep: IntArray) -> list[IntArray]:
    """Indices of the samples of each sweep, in the order in which the sweeps begin."""
    first, counts = np.unique(sweep, return_index=True, return_counts=True)[1:]
    each = np.split(np.argsort(sweep, kind="stable"), np.cumsum(counts)[:-1])
    return [each[k] for k in np.argsort(first)]


def _across(points: FloatArray, rows: list[IntArray]) -> list[IntArray]:
    """Rows sorted by their middle along the direction in which the middles spread most."""
    middles = np.array([points[row].mean(axis=0) for row in rows])
    spread = np.linalg.svd(middles - middles.mean(axis=0), full_matrices=False)[2][0]
    return [rows[k] for k in np.argsort(middles @ spread, kind="stable")]


def _distance_beside(first: FloatArray, second: FloatArray) -> float:
    """Usual distance of two polylines that run side by side; NaN if they do not keep one distance or meet."""
    from scipy.spatial import cKDTree

    probes = first[np.linspace(0, len(first) - 1, min(len(first), 65)).astype(int)]
    distance = cKDTree(second).query(probes)[0]
    usual = float(np.median(distance))
    back = cKDTree(first).query(second[np.linspace(0, len(second) - 1, min(len(second), 65)).astype(int)])[0]
    near, far = min(np.min(distance), np.min(back)), max(np.quantile(distance, 0.8), np.quantile(back, 0.8))
    reach = np.linalg.norm(first[-1] - first[0])
    beside = usual > 0 and near > 0.2 * usual and far < 2.5 * usual and (reach == 0 or usual < 2 * reach + far)
    return usual if beside else float("nan")


def pitch(points: FloatArray, sweep: IntArray) -> float:
    """Usual distance from a sample to the nearest sample of another sweep, m; 0 for a single sweep."""
    from scipy.spatial import cKDTree

    rows = _of_each(sweep)
    if len(rows) < 2:
        return 0.0
    distances = []
    for own, following in pairwise(rows):
        probes = points[own[np.linspace(0, len(own) - 1, min(len(own), 33)).astype(int)]]
        distances.append(float(np.median(cKDTree(points[following]).query(probes)[0])))
    return float(np.median(distances))


def thinned(points: FloatArray, sweep: IntArray, spacing: float, keep: BoolArray | None = None) -> IntArray:
    """Indices of samples at least `spacing` apart along each sweep, with its ends and whatever `keep` marks."""
    if spacing <= 0:
        return np.arange(len(points))
    steps = np.linalg.norm(np.diff(points, axis=0, prepend=points[:1]), axis=1)
    border = np.r_[True, np.diff(sweep) != 0]
    length = np.cumsum(np.where(border, 0.0, steps))
    # A sweep is cut into equal cells of its length; the first sample of each cell stays.
    start = np.maximum.accumulate(np.where(border, np.arange(len(points)), 0))
    cell = np.floor((length - length[start]) / spacing * (1 + 1e-12))
    chosen = border | np.r_[border[1:], True] | np.r_[True, np.diff(cell) != 0]
    return np.flatnonzero(chosen if keep is None else chosen | keep)
