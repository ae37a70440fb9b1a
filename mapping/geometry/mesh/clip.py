"""Clip: the part of a mesh inside a box, its triangles cut by the box's planes, and what of it faces some sides."""

from __future__ import annotations

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Surface

# A mesh file may hold 32-bit numbers: so near to a plane of the box (share of the greatest coordinate) a corner lies on
# it, and a face that was drawn in that plane belongs to the part
ON_PLANE = float(np.finfo(np.float32).eps)
# Cosine of the angle to the side from which a face is felt, at least: 60 degrees
FELT_SIDE_COSINE = 0.5


def asked_part(
    surface: Surface, region: tuple[FloatArray, FloatArray] | None = None, sides: FloatArray | None = None
) -> Surface | None:
    """The part of a mesh that is to be explored; None if there is none.

    Args:
        surface: the whole mesh.
        region: (low, high) corners (3,) of the box that it lies in, m; None: everywhere.
        sides: (S, 3) outward directions, one of which every face of it faces; None: all.
    """
    part = surface if region is None else clipped(surface, *region)
    if part is None or sides is None or (keep := faces_side(part.face_normals, sides)).all():
        return part
    return _of_faces(part, keep) if keep.any() else None


def faces_side(normals: FloatArray, sides: FloatArray) -> BoolArray:
    """(F,) True for unit normals (F, 3) within 60 degrees of one of the directions (S, 3)."""
    return np.asarray((normals @ sides.T > FELT_SIDE_COSINE).any(axis=1))


def clipped(surface: Surface, low: FloatArray, high: FloatArray) -> Surface | None:
    """The part of a mesh inside a box, its border included; None if there is none.

    Neighbours stay neighbours: the cut of a common edge is one vertex of both. Faces keep their winding and their
    normals, those that no plane cuts keep their corners to the bit, and a mesh that lies inside is returned as it is.

    Args:
        low, high: (3,) corners of the box, m.

    Reference: Sutherland and Hodgman, Reentrant polygon clipping, Communications of the ACM 17, 1974.
    """
    near = ON_PLANE * float(np.abs(surface.bounds).max())
    vertices, faces, parent = surface.vertices, surface.faces, np.arange(len(surface.faces))
    for axis in range(3):
        for sign, level in ((-1.0, low[axis]), (1.0, high[axis])):
            beyond = sign * (vertices[:, axis] - level)
            beyond[np.abs(beyond) <= near] = 0.0
            vertices, faces, own = _below(vertices, faces, beyond)
            parent = parent[own]
    if len(faces) == 0:
        return None
    if len(vertices) == len(surface.vertices) and len(faces) == len(surface.faces):
        return surface  # each cut adds vertices
    # a sliver's own corners tell its normal badly
    return _made(vertices, faces, surface.face_normals[parent])


def _of_faces(surface: Surface, keep: BoolArray) -> Surface:
    return _made(surface.vertices, surface.faces[keep], surface.face_normals[keep])


def _made(vertices: FloatArray, faces: IntArray, normals: FloatArray) -> Surface:
    """The mesh of these faces, whose normals are known, without the vertices that none uses."""
    used, corners = np.unique(faces, return_inverse=True)
    part = Surface(vertices[used], corners.reshape(-1, 3))
    part.__dict__["face_normals"] = normals
    return part


def _below(vertices: FloatArray, faces: IntArray, beyond: FloatArray) -> tuple[FloatArray, IntArray, IntArray]:
    """The part of faces where a coordinate (V,) is at most zero: vertices, faces, and the face each was a part of."""
    side = np.sign(beyond)[faces]
    whole = np.flatnonzero((side <= 0).all(axis=1))
    mixed = np.flatnonzero((side < 0).any(axis=1) & (side > 0).any(axis=1))
    side, rows = side[mixed], faces[mixed]
    after = np.roll(rows, -1, axis=1)
    is_cut = side * np.roll(side, -1, axis=1) < 0
    edges, number = np.unique(np.sort(np.stack([rows, after], axis=2)[is_cut], axis=1), axis=0, return_inverse=True)
    first, second = edges.T
    share = (beyond[first] / (beyond[first] - beyond[second]))[:, None]
    cuts = (1.0 - share) * vertices[first] + share * vertices[second]
    # around each face: a corner, the cut behind it, the next corner; three or four of these six are there
    around = np.full((len(rows), 6), -1)
    around[:, ::2] = np.where(side <= 0, rows, -1)
    around[:, 1::2][is_cut] = len(vertices) + number.ravel()
    around = np.take_along_axis(around, np.argsort(around < 0, axis=1, kind="stable"), axis=1)
    four = around[:, 3] >= 0
    return (
        np.concatenate([vertices, cuts]),
        np.concatenate([faces[whole], around[:, :3], around[four][:, [0, 2, 3]]]),
        np.concatenate([whole, mixed, mixed[four]]),
    )
