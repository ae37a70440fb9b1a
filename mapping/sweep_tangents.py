"""Tangents along one sweep to fourth order, without looking across its kinks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

STENCIL = 5


def chord_lengths(points: FloatArray) -> FloatArray:
    """(N,) distance along the polyline (N, 3) since its first point, m."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def lagrange(nodes: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weights (K, m) of the interpolating polynomial's value and derivative at `at` (K,) for nodes (K, m)."""
    count = nodes.shape[1]
    value, slope = np.zeros_like(nodes), np.zeros_like(nodes)
    for j in range(count):
        others = [k for k in range(count) if k != j]
        gaps = [nodes[:, j] - nodes[:, k] for k in others]
        rises = [at - nodes[:, k] for k in others]
        value[:, j] = np.prod([rise / gap for rise, gap in zip(rises, gaps, strict=True)], axis=0)
        for skip in range(len(others)):
            factors = [1.0 / gaps[k] if k == skip else rises[k] / gaps[k] for k in range(len(others))]
            slope[:, j] += np.prod(factors, axis=0)
    return value, slope


def tangents(points: FloatArray, cuts: IntArray) -> FloatArray:
    """(N, 3) unit tangents of a sweep (N, 3) whose smooth pieces begin at `cuts` (sorted, without 0).

    Each tangent is that of the quartic through five points of its own piece, chosen as ENO schemes do
    (Harten et al. 1987): the central five, unless others are much smoother, so that a jump of curvature
    spoils none of them. Pieces of fewer points use what they have.
    """
    count = len(points)
    s = chord_lengths(points)
    begin = np.repeat(np.r_[0, cuts], np.diff(np.r_[0, cuts, count]))
    end = np.repeat(np.r_[cuts, count], np.diff(np.r_[0, cuts, count]))
    result = np.zeros((count, 3))
    size = np.minimum(end - begin, STENCIL)
    first = np.clip(np.arange(count) - STENCIL // 2, begin, np.maximum(end - size, begin))
    full = np.flatnonzero(size == STENCIL)
    first[full] = _smoothest(points, s, full, begin[full], end[full])
    for m in range(2, STENCIL + 1):
        chosen = np.flatnonzero(size == m)
        index = first[chosen][:, None] + np.arange(m)
        offset = s[index] - s[chosen][:, None]
        slope = lagrange(offset, np.zeros(len(chosen)))[1]
        result[chosen] = np.einsum("km,kmc->kc", slope, points[index] - points[chosen][:, None])
    for i in np.flatnonzero(size == 1):
        result[i] = points[min(i + 1, count - 1)] - points[max(i - 1, 0)]
    return unit(result)


def _smoothest(points: FloatArray, s: FloatArray, samples: IntArray, begin: IntArray, end: IntArray) -> IntArray:
    """First index of the five points to differentiate at each sample."""
    difference, order = points, 0
    for order in range(1, STENCIL):
        difference = np.diff(difference, axis=0) / (s[order:] - s[:-order])[:, None]
    roughness = np.linalg.norm(difference, axis=1)
    # A window must be four times smoother before it displaces the central one.
    best = np.clip(samples - STENCIL // 2, begin, end - STENCIL)
    score = roughness[best] / 4
    for shift in range(STENCIL):
        window = samples - shift
        inside = (window >= begin) & (window + STENCIL <= end)
        value = np.where(inside, roughness[np.clip(window, 0, len(roughness) - 1)], np.inf)
        best, score = np.where(value < score, window, best), np.minimum(score, value)
    return np.asarray(best)


def unit(vectors: FloatArray) -> FloatArray:
    """Rows scaled to length one; rows of no length stay zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0))
