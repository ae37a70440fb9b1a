"""Polylines: lengths, middles and directions of feature axes."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, lengths


def arclengths(points: FloatArray) -> FloatArray:
    """(K,) distance from the first of the points (K, 3) along the polyline, m."""
    steps = lengths(np.diff(points, axis=0))
    return np.concatenate([[0.0], np.cumsum(steps)])


def middle(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The point (3,) half way along (K, 3), and the unit direction there; zero if it has no length."""
    s = arclengths(points)
    if s[-1] == 0.0:
        return points[0].copy(), np.zeros(3)
    half = 0.5 * s[-1]
    point = np.array([np.interp(half, s, points[:, i]) for i in range(3)])
    leg = min(int(np.searchsorted(s, half, side="right")), len(points) - 1)
    along = points[leg] - points[leg - 1]
    return point, np.asarray(along / np.linalg.norm(along))


def directions(points: FloatArray) -> FloatArray:
    """(K, 3) unit tangents at the points: central differences; wrapped if first and last are equal."""
    if len(points) < 2:
        return np.zeros_like(points)
    ahead, behind = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
    if len(points) > 2 and np.array_equal(points[0], points[-1]):
        ahead[-1], behind[0] = points[1], points[-2]
    else:
        ahead[-1], behind[0] = points[-1], points[0]
    along = ahead - behind
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(np.divide(along, length, out=np.zeros_like(along), where=length > 0))


def resample(points: FloatArray, count: int) -> FloatArray:
    """(count, 3) points at equal arclengths along the polyline; the ends are kept exactly."""
    s = arclengths(points)
    even = np.linspace(0.0, s[-1], count)
    out = np.column_stack([np.interp(even, s, points[:, i]) for i in range(points.shape[1])])
    out[0], out[-1] = points[0], points[-1]
    return out


def nearest_on(points: FloatArray, polyline: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The nearest point (N, D) of a polyline (K, D) to each of (N, D) points, and its arclength (N,), m; D = 2, 3."""
    if len(polyline) == 1:
        return np.broadcast_to(polyline[0], points.shape).copy(), np.zeros(len(points))
    from mapping.geometry.mesh.nearest_kernels import nearest_on_legs

    size = points.shape[1]
    at, line = (np.zeros((len(each), 3)) for each in (points, polyline))  # in the plane there is no third coordinate
    at[:, :size], line[:, :size] = points, polyline
    on, along = np.empty(at.shape), np.empty(len(at))
    nearest_on_legs(at, line, arclengths(line), on, along)
    return on[:, :size], along


def distances(points: FloatArray, axis: FloatArray) -> FloatArray:
    """(N,) distances of points (N, 3) from a polyline (K, 3), m."""
    return lengths(points - nearest_on(points, axis)[0])
