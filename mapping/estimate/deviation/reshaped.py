"""Reshaped: a model whose vertices are displaced, fine enough for a smooth displacement to show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping import FloatArray, IntArray, Surface
from mapping.base import Base

# Edges of at most this share of a field's length: between their ends a bump of the field departs from a straight line
# by (1/3)^2 / 8 of its height, 1.4 per cent
EDGE_SHARE = 1.0 / 3.0
# Triangles that a mesh is divided into at most
MOST_REFINED_FACES = 400_000


def fine_enough(base: Base, length: float) -> Base:
    """The base with its triangles halved until their edges are short against a field's length, m."""
    import trimesh

    vertices: FloatArray = base.surface.vertices
    faces: IntArray = base.surface.faces
    while _longest(vertices, faces) > EDGE_SHARE * length and 4 * len(faces) <= MOST_REFINED_FACES:
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    if len(faces) == len(base.surface.faces):
        return base
    return replace(base, surface=Surface(vertices, np.asarray(faces, dtype=np.int64)))


def reshaped(base: Base, vertices: FloatArray) -> Base:
    """The base with its vertices elsewhere, (V, 3) m."""
    return replace(base, surface=Surface(vertices, base.surface.faces))


def _longest(vertices: FloatArray, faces: IntArray) -> float:
    return float(np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2).max())
