"""Surface: a triangle mesh, the only description of a body that mapping knows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mapping.arrays import BoolArray, FloatArray, IntArray
from mapping.errors import SurfaceError


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangle mesh with outward (counter-clockwise) faces.

    Args:
        vertices: (V, 3) positions, m, object frame, finite.
        faces: (F, 3) vertex indices; duplicate, degenerate and unreferenced parts are allowed.

    Raises:
        SurfaceError: wrong shapes, no vertices or faces, an index out of range, NaN or infinity.
    """

    vertices: FloatArray
    faces: IntArray

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        object.__setattr__(self, "vertices", _checked_vertices(vertices))
        object.__setattr__(self, "faces", _checked_faces(faces, len(self.vertices)))

    @cached_property
    def face_normals(self) -> FloatArray:
        """(F, 3) outward unit normals; zero for degenerate faces."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        scale = max(self.size, np.finfo(float).tiny)
        cross = np.cross((b - a) / scale, (c - a) / scale)
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        return np.asarray(np.divide(cross, length, out=np.zeros_like(cross), where=length > 0))

    @cached_property
    def face_areas(self) -> FloatArray:
        """(F,) areas, m^2."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) smallest and largest coordinates of the referenced vertices, m."""
        referenced = np.zeros(len(self.vertices), dtype=bool)
        referenced[self.faces] = True
        used = self.vertices[referenced]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @cached_property
    def open_sides(self) -> BoolArray:
        """(F, 3) True where the side opposite to a face's corner belongs to no other face."""
        one, other = np.roll(self.faces, -1, axis=1), np.roll(self.faces, -2, axis=1)
        sides = np.minimum(one, other) * len(self.vertices) + np.maximum(one, other)
        _, number, counts = np.unique(sides, return_inverse=True, return_counts=True)
        return np.asarray(counts[number.reshape(sides.shape)] == 1)

    @cached_property
    def neighbours(self) -> tuple[IntArray, IntArray]:
        """Pairs of faces that share an edge; on an edge of more than two faces, the consecutive pairs."""
        faces = self.faces
        edges = np.sort(np.concatenate([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]]), axis=1)
        owner = np.tile(np.arange(len(faces)), 3)
        order = np.lexsort((edges[:, 1], edges[:, 0]))
        edges, owner = edges[order], owner[order]
        same = (edges[1:] == edges[:-1]).all(axis=1)
        return owner[:-1][same], owner[1:][same]

    def moved(self, rotation: FloatArray, translation: FloatArray) -> Surface:
        """The mesh after a rigid motion, x to rotation @ x + translation; what is known of its shape is kept."""
        surface = Surface(self.vertices @ rotation.T + translation, self.faces)
        known: dict[str, object] = {name: getattr(self, name) for name in ("face_areas", "neighbours")}
        surface.__dict__.update(known | {"face_normals": self.face_normals @ rotation.T})
        return surface

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))


def _checked_vertices(vertices: ArrayLike) -> FloatArray:
    array = np.array(vertices, dtype=np.float64, order="C")
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise SurfaceError(f"a mesh needs vertices of shape (V, 3), V >= 1; found shape {array.shape}")
    bad = ~np.isfinite(array).all(axis=1)
    if bad.any():
        raise SurfaceError(
            f"mesh vertices must be finite; {int(bad.sum())} of {len(array)} are not, "
            f"the first is vertex {int(bad.argmax())}"
        )
    array.setflags(write=False)
    return array


def _checked_faces(faces: ArrayLike, vertex_count: int) -> IntArray:
    array = np.array(faces)
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise SurfaceError(f"a mesh needs triangles of shape (F, 3), F >= 1; found shape {array.shape}")
    if not np.issubdtype(array.dtype, np.integer):
        raise SurfaceError(f"mesh faces must be integer vertex indices; found {array.dtype}")
    if array.min() < 0 or array.max() >= vertex_count:
        raise SurfaceError(
            f"mesh faces index vertices 0 to {vertex_count - 1}; found indices from {array.min()} to {array.max()}"
        )
    array = array.astype(np.int64, order="C")
    array.setflags(write=False)
    return array
