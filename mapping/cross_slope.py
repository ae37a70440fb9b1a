"""Slope of the traced surface across its sweeps, from the neighbouring rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapping.sweep_tangents import unit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

REACH = 2


def cross_tangents(points: FloatArray, along: FloatArray, outward: FloatArray, rows: list[IntArray]) -> FloatArray:
    """(N, 3) unit tangents of the traced surface across the sweeps `rows`.

    The surface is cut at each sample by the plane perpendicular to the sweep; the neighbouring rows cross
    it in up to five points, whose parabolas (left, central or right, the smoothest of them; the quartic where all
    agree) give the slope. A kink that runs along the sweeps therefore stays on its own side.
    """
    across = unit(np.cross(outward, along))
    up = np.cross(along, across)
    up *= np.sign(np.einsum("ij,ij->i", up, outward))[:, None]
    slope = np.zeros(len(points))
    for j, row in enumerate(rows):
        offsets = np.full((len(row), 2 * REACH + 1, 2), np.nan)
        offsets[:, REACH] = 0.0
        for shift in range(-REACH, REACH + 1):
            if shift and 0 <= j + shift < len(rows):
                hits = _crossings(points[row], along[row], points[rows[j + shift]])
                arm = hits - points[row]
                offsets[:, REACH + shift, 0] = np.einsum("ij,ij->i", arm, across[row])
                offsets[:, REACH + shift, 1] = np.einsum("ij,ij->i", arm, up[row])
        slope[row] = _slope(offsets)
    return unit(across + slope[:, None] * up)


def _crossings(points: FloatArray, normals: FloatArray, line: FloatArray) -> FloatArray:
    """Where a polyline (M, 3) crosses the planes through `points` with `normals` (N, 3); NaN if it ends before."""
    from scipy.spatial import cKDTree

    last = len(line) - 1
    if last < 2:
        return np.full_like(points, np.nan)
    middle = np.clip(cKDTree(line).query(points)[1], 1, last - 1)
    a, b, c = (line[middle + k] - points for k in (-1, 0, 1))
    fa, fb, fc = (np.einsum("ij,ij->i", x, normals) for x in (a, b, c))
    # Inverse interpolation: the place as a quadratic of the distance to the plane, at distance zero.
    spread = np.where((fa - fb) * (fb - fc) * (fc - fa) == 0, np.nan, 1.0)
    wa, wb, wc = fb * fc / ((fa - fb) * (fa - fc)), fa * fc / ((fb - fa) * (fb - fc)), fa * fb / ((fc - fa) * (fc - fb))
    found = (wa[:, None] * a + wb[:, None] * b + wc[:, None] * c) * spread[:, None]
    within = np.maximum(np.abs(fa), np.abs(fc)) * 2 >= np.minimum(np.minimum(np.abs(fa), np.abs(fb)), np.abs(fc))
    monotone = (fa - fb) * (fb - fc) > 0
    ended = (np.sign(fa) == np.sign(fc)) & (np.abs(fb) > np.abs(fa - fc))
    return np.where((within & monotone & ~ended)[:, None], found, np.nan) + points


def _slope(offsets: FloatArray) -> FloatArray:
    """Derivative at zero of heights w(v) given as (N, 5, 2) offsets, NaN where a row is missing."""
    v, w = offsets[..., 0], offsets[..., 1]
    slopes, bends = [], []
    with np.errstate(all="ignore"):  # missing rows are NaN, and every NaN is dealt with below
        first = (w[:, 1:] - w[:, :-1]) / (v[:, 1:] - v[:, :-1])
        for k in range(3):
            second = (first[:, k + 1] - first[:, k]) / (v[:, k + 2] - v[:, k])
            slopes.append(first[:, k] + second * (-v[:, k] - v[:, k + 1]))
            bends.append(np.abs(second))
        bend = np.where(np.isnan(np.stack(bends, 1)), np.inf, np.stack(bends, 1)) * np.array([3.0, 1.0, 3.0])
        best = np.stack(slopes, 1)[np.arange(len(v)), bend.argmin(axis=1)]
        quartic = _quartic_slope(v, w)
        smooth = np.stack(bends, 1).max(axis=1) < 2 * np.stack(bends, 1).min(axis=1)
        linear = np.where(np.isnan(first[:, REACH]), first[:, REACH - 1], first[:, REACH])
    slope = np.where(smooth & np.isfinite(quartic), quartic, np.where(np.isfinite(best), best, linear))
    return np.where(np.isfinite(slope), slope, 0.0)


def _quartic_slope(v: FloatArray, w: FloatArray) -> FloatArray:
    from mapping.sweep_tangents import lagrange

    return np.asarray(np.einsum("km,km->k", lagrange(v, np.zeros(len(v)))[1], w))
