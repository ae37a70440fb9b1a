"""Bridging: points of the resting ball where the surface between neighbouring sweeps was not reached."""

from __future__ import annotations

import numpy as np

from mapping import BoolArray, FloatArray, IntArray
from mapping.estimate.sweeps import unit

# A concave turn between neighbours must exceed what their own curvature predicts by this factor.
CONCAVE_TURN_RATIO = 3.0
# Where no curvature is known, dents this close to the tip's own curvature are taken for kinks.
UNKNOWN_CURVATURE = 3.0


def bridged_faces(
    centers: FloatArray, normals: FloatArray, faces: IntArray, tip_radius: float, curvature: FloatArray
) -> BoolArray:
    """(F,) which faces of the traced mesh hold a kink that lies between their corners.

    Args:
        centers, normals: (V, 3) ball centres, m, and outward unit normals.
        curvature: (V,) curvature of the traced surface across the sweeps, 1/m; NaN where unknown.
    """
    dent = np.where(np.isnan(curvature), UNKNOWN_CURVATURE / tip_radius, np.maximum(-curvature, 0.0))
    flagged = np.zeros(len(faces), dtype=bool)
    for corner in range(3):
        i, k = faces[:, corner], faces[:, (corner + 1) % 3]
        way = centers[k] - centers[i]
        length = np.linalg.norm(way, axis=1)
        turn = np.linalg.norm(normals[k] - normals[i], axis=1)
        concave = np.einsum("ij,ij->i", normals[k] - normals[i], way) < -0.5 * turn * length
        predicted = np.maximum(dent[i], dent[k]) * length
        flagged |= concave & (turn > CONCAVE_TURN_RATIO * predicted) & (tip_radius * turn > 0.5 * length) & (length > 0)
    return flagged


def resting_points(centers: FloatArray, normals: FloatArray, faces: IntArray, tip_radius: float) -> FloatArray:
    """(F, 3) points at the tip's radius below the three centres of each face: where their balls meet.

    Faces whose centres coincide or lie too far apart have no such point; the mean ball serves.
    """
    a, b, c = (centers[faces[:, k]] for k in range(3))
    u, v = b - a, c - a
    cross = np.cross(u, v)
    area = np.einsum("ij,ij->i", cross, cross)
    size = np.maximum((u**2).sum(axis=1), (v**2).sum(axis=1))
    proper = area > 1e-12 * size**2
    safe = np.where(proper, area, 1.0)[:, None]
    arm = np.cross((u**2).sum(axis=1)[:, None] * v - (v**2).sum(axis=1)[:, None] * u, cross) / (2 * safe)
    depth = tip_radius**2 - (arm**2).sum(axis=1)
    proper &= depth > 0
    up = unit(normals[faces].sum(axis=1))
    axis = unit(cross)
    axis *= np.where(np.einsum("ij,ij->i", axis, up) < 0, -1.0, 1.0)[:, None]
    met = a + arm - np.sqrt(np.maximum(depth, 0.0))[:, None] * axis
    return np.where(proper[:, None], met, (a + b + c) / 3 - tip_radius * up)


def rest_between(points: FloatArray, centers: FloatArray, normals: FloatArray, faces: IntArray) -> BoolArray:
    """(F,) which resting points (F, 3) lie under their balls in directions between those in which the balls touched.

    A ball that comes to rest in a kink touches it in directions between those of its flanks. Where corners lie nearer
    to one another than their noise their plane may have any direction, and the ball at rest on it, too: it would stand
    on a body that nobody felt.
    """
    corner = normals[faces]
    up = unit(corner.sum(axis=1))
    widest = np.einsum("ij,ikj->ik", up, corner).min(axis=1)
    arm = unit(centers[faces].mean(axis=1) - points)
    return np.asarray(np.einsum("ij,ij->i", arm, up) >= widest)


def split(faces: IntArray, chosen: IntArray, first: int) -> IntArray:
    """Faces with those of indices `chosen` split in three about new vertices first, first + 1, ..."""
    rest = np.delete(faces, chosen, axis=0)
    apex = first + np.arange(len(chosen))
    a, b, c = faces[chosen].T
    parts = [np.column_stack(corners) for corners in ((a, b, apex), (b, c, apex), (c, a, apex))]
    return np.vstack([rest, *parts])
