"""Tangents along one sweep to fourth order, without looking across its kinks."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, IntArray, lengths

STENCIL = 5
# A window of points must be smoother than the central one by this factor to displace it.
OFF_CENTRE_PENALTY = 4.0


def chord_lengths(points: FloatArray) -> FloatArray:
    """(N,) distance along the polyline (N, 3) since its first point, m."""
    steps = lengths(np.diff(points, axis=0))
    return np.concatenate([[0.0], np.cumsum(steps)])


def lagrange(nodes: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weights (K, m) of the interpolating polynomial's value and derivative at `at` (K,) for nodes (K, m)."""
    from mapping.estimate.sweeps.tangent_kernels import lagrange_weights

    value, slope = np.empty(nodes.shape), np.empty(nodes.shape)
    lagrange_weights(nodes, at, value, slope)
    return value, slope


def tangents(points: FloatArray, cuts: IntArray) -> FloatArray:
    """(N, 3) unit tangents of a sweep (N, 3) whose smooth pieces begin at `cuts` (sorted, without 0).

    Each tangent is that of the quartic through five points of its own piece, chosen as ENO schemes do
    (Harten et al., ENO III, 1987): the central five, unless others are much smoother, so that a jump of curvature
    spoils none of them. Pieces of fewer points use what they have.
    """
    from mapping.estimate.sweeps.tangent_kernels import sweep_tangents as kernel

    count = len(points)
    s = chord_lengths(points)
    begin = np.repeat(np.r_[0, cuts], np.diff(np.r_[0, cuts, count]))
    end = np.repeat(np.r_[cuts, count], np.diff(np.r_[0, cuts, count]))
    result = np.zeros((count, 3))
    result = kernel(np.ascontiguousarray(points), s, begin, end, STENCIL, OFF_CENTRE_PENALTY)
    for i in np.flatnonzero(end - begin == 1):
        result[i] = points[np.minimum(i + 1, count - 1)] - points[np.maximum(i - 1, 0)]
    return unit(result)


def unit(vectors: FloatArray) -> FloatArray:
    """Rows scaled to length one; rows of no length stay zero."""
    length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0))
