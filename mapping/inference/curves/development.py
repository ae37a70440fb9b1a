"""Development: a curve on a base, unrolled into the plane; a geodesic becomes a straight line (theory section 10.4)."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray
from mapping.base import Base, onto_base
from mapping.geometry.mesh import arclengths, directions, nearest_on, resample
from mapping.inference.curves.smooth_axis import smooth_axis

# Points that follow a curve over the base: to a half-width of the feature, and in all
DENSE, FEWEST_CURVE_POINTS, MOST_CURVE_POINTS = 10.0, 64, 400
# Normals that differ by less are those of a plane
PLANE = 1e-9
# Height from which a point's own face is looked for, in tip radii
FACE_LOOKUP_HEIGHT = 1e-3
UNROLLING_ROUNDS = 2


def developed(points: FloatArray, normals: FloatArray) -> FloatArray:
    """(K, 2) a dense polyline on a surface rolled into the plane: its lengths and turns within the surface are kept.

    The tangent plane is turned from point to point by the smallest rotation between its normals, about a fold itself
    where the surface is folded.

    Args:
        points: (K, 3) on the surface, m.
        normals: (K, 3) unit normals there.
    """
    legs = _unfolded(np.diff(points, axis=0), normals[:-1], normals[1:])
    turned, rolled = np.eye(3), np.zeros_like(legs)
    for k, back in enumerate(_rotations(normals[1:], normals[:-1])):
        rolled[k] = turned @ legs[k]
        turned = turned @ back
    along = rolled[0] - (rolled[0] @ normals[0]) * normals[0]
    along /= np.linalg.norm(along)
    places = np.vstack([np.zeros(3), np.cumsum(rolled, axis=0)])
    return np.asarray(places @ np.stack([along, np.cross(normals[0], along)], axis=1))


def _unfolded(legs: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """(K, 3) chords between two planes with unit normals (K, 3), unfolded about their common lines onto the first.

    With the angle t between the planes the chord of a way a on one and b on the other, square to their line, has
    (a + b) cos(t / 2) along the plane that halves them; unfolded the way is a + b, wherever the fold crosses it.
    """
    halving = (start + end) / np.linalg.norm(start + end, axis=1, keepdims=True)
    flat = np.einsum("kij,kj->ki", _rotations(halving, start), legs)
    flat = flat - _dots(flat, start) * start
    folds = np.cross(start, end)
    folds /= np.maximum(np.linalg.norm(folds, axis=1, keepdims=True), np.finfo(float).tiny)
    return np.asarray(flat + (1.0 / _dots(halving, start) - 1.0) * (flat - _dots(flat, folds) * folds))


def _rotations(start: FloatArray, to: FloatArray) -> FloatArray:
    """(K, 3, 3) the smallest rotations from unit vectors (K, 3) to others that are not opposite (Rodrigues)."""
    x, y, z = np.cross(start, to).T
    none = np.zeros_like(x)
    cross = np.array([[none, -z, y], [z, none, -x], [-y, x, none]]).transpose(2, 0, 1)
    return np.asarray(np.eye(3) + cross + cross @ cross / np.maximum(1.0 + _dots(start, to), 1e-6)[:, :, None])


def _dots(one: FloatArray, other: FloatArray) -> FloatArray:
    """(K, 1) products of vectors (K, 3)."""
    return np.asarray(np.einsum("ki,ki->k", one, other)[:, None])


def smooth_on_base(
    axis: FloatArray,
    normals: FloatArray,
    sd: float,
    most: int,
    least: int,
    base: Base,
    tip_radius: float,
    half_width: float,
) -> tuple[FloatArray, int]:
    """The smooth axis of a line, smooth within the base: where that is folded, so is the line.

    Args:
        axis: (K, 3) crossings in order, m; first equals last if closed: a closed line is smoothed in space.
        normals: (K, 3) outward unit normals of the base there.
        sd: standard deviation of a crossing, m.
        most, least: degrees to try.
        base: the global model.
        tip_radius: m.
        half_width: of the line's disturbance, m.

    Returns:
        A polyline and its degree, as `smooth_axis`.
    """
    line, degree = smooth_axis(axis, sd, most, least)
    if np.array_equal(axis[0], axis[-1]) or len(axis) < 3:
        return line, degree
    count = int(np.clip(np.ceil(DENSE * arclengths(line)[-1] / half_width), FEWEST_CURVE_POINTS, MOST_CURVE_POINTS))
    for _ in range(UNROLLING_ROUNDS):
        dense = resample(line, count)
        points, lift = onto_base(dense, normals_along(dense, axis, normals), base, tip_radius)
        # the ball itself would rest on a fold while its foot goes from one side to the other
        up = base.foot(points + FACE_LOOKUP_HEIGHT * tip_radius * lift, tip_radius).normals
        if np.ptp(up, axis=0).max() < PLANE:
            return line, degree
        line, degree = _smoothed(points, up, axis, sd, most, least)
    return line, degree


def _smoothed(
    points: FloatArray, up: FloatArray, axis: FloatArray, sd: float, most: int, least: int
) -> tuple[FloatArray, int]:
    """A curve (K, 3) on the base moved aside to where crossings beside it lie on a smooth curve of its development."""
    keep = np.append(True, np.diff(arclengths(points)) > 0.0)
    points, up = points[keep], up[keep]
    flat, aside = developed(points, up), np.cross(up, directions(points))
    s, ways = arclengths(flat), directions(flat)
    foot, at = nearest_on(axis, points)
    share = np.interp(at, arclengths(points), np.arange(len(points)))
    leg = np.round(share).astype(int)
    off = np.einsum("ij,ij->i", axis - foot, aside[leg])
    place = np.column_stack([np.interp(share, np.arange(len(s)), flat[:, i]) for i in range(2)])
    crossings = place + off[:, None] * np.column_stack([-ways[leg, 1], ways[leg, 0]])
    smooth, degree = smooth_axis(crossings, sd, most, least)
    goal = nearest_on(flat, smooth)[0] - flat
    shift = goal[:, 1] * ways[:, 0] - goal[:, 0] * ways[:, 1]
    return points + shift[:, None] * aside, degree


def normals_along(points: FloatArray, axis: FloatArray, normals: FloatArray) -> FloatArray:
    """(N, 3) for points (N, 3) the normals (K, 3) of the nearest points of an axis (K, 3)."""
    from scipy.spatial import cKDTree

    return np.asarray(normals[cKDTree(axis).query(points)[1]])
