"""How deep balls sink into a mesh on their way, judged in long double by distances of segments from triangles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from mapping.arrays import BoolArray, FloatArray, IntArray
from mapping.surface import Surface

PIECE = 500  # ways that are judged at once


def sunk(body: Surface, radius: float, starts: FloatArray, ends: FloatArray) -> FloatArray:
    """(N,) how deep the body sticks into each ball at the worst place of its straight way, m; below 0: free."""
    deepest = np.full(len(starts), -np.inf)
    corners = body.vertices[body.faces]
    for first in range(0, len(starts), PIECE):
        p, u = starts[first : first + PIECE], ends[first : first + PIECE] - starts[first : first + PIECE]
        for way, face in near(corners, radius, p, u):
            rough = segment_triangle(p[way], u[way], *np.moveaxis(corners[face], 1, 0))
            close = rough < radius * (1.0 + 1e-6)
            way, face = way[close], face[close]
            exact = [array.astype(np.longdouble) for array in (p[way], u[way], *np.moveaxis(corners[face], 1, 0))]
            depth = np.longdouble(radius) - segment_triangle(*exact)
            np.maximum.at(deepest, first + way, depth.astype(np.float64))
    return deepest


def near(corners: FloatArray, radius: float, p: FloatArray, u: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Pairs (way, face) that may come within the radius: small faces and large ones are sought apart."""
    middles = corners.mean(axis=1)
    sizes = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    for faces in np.array_split(np.argsort(sizes), 6):
        if not len(faces):
            continue
        step = sizes[faces].max() + radius
        pieces = np.maximum(np.ceil(np.linalg.norm(u, axis=1) / step), 1).astype(int)
        way = np.repeat(np.arange(len(p)), pieces)
        share = (np.concatenate([np.arange(k) for k in pieces]) + 0.5) / pieces[way]
        found = cKDTree(middles[faces]).query_ball_point(p[way] + share[:, None] * u[way], 1.6 * step)
        counts = np.array([len(some) for some in found])
        if counts.any():
            face = faces[np.concatenate([np.asarray(some, dtype=np.int64) for some in found])]
            pairs = np.unique(np.repeat(way, counts) * len(corners) + face)
            yield pairs // len(corners), pairs % len(corners)


def segment_triangle(p: FloatArray, u: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(N,) distance of the segments p .. p + u from the triangles; 0 where they cross."""
    sides = ((a, b), (b, c), (c, a))
    square = np.minimum(point_triangle(p, a, b, c), point_triangle(p + u, a, b, c))
    for x, y in sides:
        square = np.minimum(square, segment_segment(p, u, x, y - x))
    n = cross(b - a, c - a)
    before, after = dot(p - a, n), dot(p + u - a, n)
    crossed = before * after < 0
    f = p + quotient(before, before - after, crossed)[:, None] * u
    return np.sqrt(np.where(crossed & holds(sides, n, f), 0.0, square))


def point_triangle(p: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(N,) squared distance."""
    sides = ((a, b), (b, c), (c, a))
    n = cross(b - a, c - a)
    area, height = dot(n, n), dot(a - p, n)
    foot = p + quotient(height, area, area > 0)[:, None] * n
    flat = np.where((area > 0) & holds(sides, n, foot), quotient(height * height, area, area > 0), np.inf)
    borders = [point_segment(p, x, y - x) for x, y in sides]
    return np.minimum.reduce([flat, *borders])


def point_segment(p: FloatArray, q: FloatArray, v: FloatArray) -> FloatArray:
    """(N,) squared distance."""
    square = dot(v, v)
    w = q + np.clip(quotient(dot(p - q, v), square, square > 0), 0, 1)[:, None] * v - p
    return dot(w, w)


def segment_segment(p: FloatArray, u: FloatArray, q: FloatArray, v: FloatArray) -> FloatArray:
    """(N,) squared distance: the least of the lines' nearest points, where both segments hold them, and of the ends."""
    w = p - q
    a, b, c, d, e = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    spread = a * c - b * b
    s = np.clip(quotient(b * e - c * d, spread, spread > 0), 0, 1)
    t = np.clip(quotient(b * s + e, c, c > 0), 0, 1)
    gap = w + s[:, None] * u - t[:, None] * v
    ends = [point_segment(p, q, v), point_segment(p + u, q, v), point_segment(q, p, u), point_segment(q + v, p, u)]
    return np.minimum.reduce([dot(gap, gap), *ends])


def holds(sides: tuple[tuple[FloatArray, FloatArray], ...], n: FloatArray, f: FloatArray) -> BoolArray:
    """(N,) True where the triangle holds the point f of its plane."""
    return np.logical_and.reduce([dot(np.cross(y - x, f - x), n) >= 0 for x, y in sides])


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """(N, 3) vector products, each component exact to rounding of its own: else the planes of thin triangles tilt."""
    (x, y, z), (u, v, w) = a.T, b.T
    return np.stack([less(y, w, z, v), less(z, u, x, w), less(x, v, y, u)], axis=1)


def less(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """(N,) a b - c d with what rounding takes from both products (Jeannerod, Louvet and Muller 2013)."""
    return (a * b - c * d) + (lost(a, b) - lost(c, d))


def lost(a: FloatArray, b: FloatArray) -> FloatArray:
    """(N,) what rounding takes from a b, exactly: the factors in halves (Dekker 1971)."""
    (high, low), (tall, short) = halves(a), halves(b)
    return ((high * tall - a * b) + high * short + low * tall) + low * short


def halves(a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both halves of the digits."""
    far = a * a.dtype.type(2 ** (np.finfo(a.dtype).nmant // 2 + 1) + 1)
    high = far - (far - a)
    return high, a - high


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return (a * b).sum(axis=-1)


def quotient(a: FloatArray, b: FloatArray, where: BoolArray) -> FloatArray:
    return np.divide(a, b, out=np.zeros_like(a), where=where)
