"""The reference of the contact tests: every face, edge and vertex of a mesh in plain float64, none left out."""

from __future__ import annotations

import numpy as np

from mapping.arrays import FloatArray


def first_contact_distance(corners: FloatArray, origin: FloatArray, d: FloatArray, radius: float) -> float:
    """Way until a ball starting free at the origin enters the dilation of any triangle (F, 3, 3); inf if never."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    times = [face_entry(a, b, c, origin, d, radius)]
    times += [edge_entry(p, q, origin, d, radius) for p, q in ((a, b), (b, c), (c, a))]
    times += [vertex_entry(corners.reshape(-1, 3), origin, d, radius)]
    every = np.concatenate(times)
    return float(np.min(every[every >= 0], initial=np.inf))


def vertex_entry(p: FloatArray, origin: FloatArray, d: FloatArray, radius: float) -> FloatArray:
    middle = (p - origin) @ d
    miss = np.linalg.norm(p - origin - middle[:, None] * d, axis=1)
    return np.where(miss < radius, middle - np.sqrt(np.maximum(radius**2 - miss**2, 0)), np.inf)


def edge_entry(p: FloatArray, q: FloatArray, origin: FloatArray, d: FloatArray, radius: float) -> FloatArray:
    e, w = q - p, origin - p
    along = np.cross(d, e)
    shift = np.cross(w, e)
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = (along**2).sum(1), 2 * (along * shift).sum(1), (shift**2).sum(1) - radius**2 * (e**2).sum(1)
        root = squares[1] ** 2 - 4 * squares[0] * squares[2]
        t = (-squares[1] - np.sqrt(root)) / (2 * squares[0])
        u = ((w + t[:, None] * d) * e).sum(1) / (e**2).sum(1)
        return np.where((root > 0) & (u >= 0) & (u <= 1), t, np.inf)


def face_entry(
    a: FloatArray, b: FloatArray, c: FloatArray, origin: FloatArray, d: FloatArray, radius: float
) -> FloatArray:
    n = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        n = n / np.linalg.norm(n, axis=1, keepdims=True)
        n = np.where((n @ d > 0)[:, None], -n, n)  # the side that the ball comes from
        t = (((a - origin) * n).sum(1) + radius) / (n @ d)
        p = origin + t[:, None] * d - radius * n
        inside = np.isfinite(t)
        for u, v in ((a, b), (b, c), (c, a)):
            side = (np.cross(v - u, p - u) * np.cross(b - a, c - a)).sum(1)
            inside &= side >= 0
    return np.where(inside, t, np.inf)


def distances(corners: FloatArray, points: FloatArray) -> FloatArray:
    """(N,) distance of each point (N, 3) from the nearest of the triangles (F, 3, 3)."""
    return np.array([distance(corners, p) for p in points])


def distance(corners: FloatArray, point: FloatArray) -> float:
    a, b, c = corners[:, 0] - point, corners[:, 1] - point, corners[:, 2] - point
    best = min(segment_distance(p, q).min() for p, q in ((a, b), (b, c), (c, a)))
    n = np.cross(b - a, c - a)
    length = np.linalg.norm(n, axis=1, keepdims=True)
    n = np.divide(n, length, out=np.zeros_like(n), where=length > 0)
    height = (a * n).sum(1)
    foot = height[:, None] * n
    inside = length[:, 0] > 0
    for u, v in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(v - u, foot - u) * n).sum(1) >= 0
    return float(min(best, np.abs(height[inside]).min(initial=np.inf)))


def segment_distance(p: FloatArray, q: FloatArray) -> FloatArray:
    e = q - p
    square = (e**2).sum(1)
    u = np.divide(-(p * e).sum(1), square, out=np.zeros_like(square), where=square > 0)
    return np.asarray(np.linalg.norm(p + np.clip(u, 0, 1)[:, None] * e, axis=1))
