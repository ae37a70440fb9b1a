"""Nearest point of a mesh to given points, with the side they lie on; and the nearest of many points."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mapping import BoolArray, FloatArray, IntArray, MappingError, Surface, dots, read_only, sides_of_box
from mapping.geometry.mesh.tree import TriangleTree

# More queries at once than this only cost memory: some 500 bytes each on the way
QUERIES_AT_ONCE = 100_000
# Points of which a box, of a few in a row, is longer than this share of all are in no order: half of all boxes would be
# asked at each query, and a tree is quicker
LONGEST_BOX = 0.5
# Faces that meet at a vertex and turn from each other by more are sides of an edge of the body, not facets of one of
# its smooth parts: the angle at which surveys part a mesh into charts, and shaded pictures its edges
CREASE_ANGLE = float(np.radians(30.0))


@dataclass(frozen=True, eq=False)
class Nearest:
    """Closest points of a surface.

    Args:
        points: (N, 3) closest points on the mesh, m.
        distance: (N,) unsigned distances, m.
        side: (N,) +1 outside (on the side of the outward normals), -1 inside.
        normals: (N, 3) unit pseudonormals of the mesh at the closest points (angle-weighted at edges
            and vertices; Bærentzen and Aanæs 2005, in full in the theory).
        face: (N,) face that the point lies in.
        barycentric: (N, 3) its coordinates in that face.
    """

    points: FloatArray
    distance: FloatArray
    side: FloatArray
    normals: FloatArray
    face: IntArray
    barycentric: FloatArray


@dataclass(frozen=True, eq=False)
class NearestPoint:
    """Answers nearest-point queries on one surface."""

    surface: Surface

    def query(self, points: ArrayLike) -> Nearest:
        """The nearest point of the mesh to each of (N, 3) points, m.

        Raises:
            MappingError: points of the wrong shape or not finite.
        """
        query = _finite(points)
        if len(query) == 0:
            empty = np.zeros((0, 3))
            return Nearest(empty, np.zeros(0), np.zeros(0), empty, np.zeros(0, dtype=np.int64), empty)
        firsts = range(0, len(query), QUERIES_AT_ONCE)
        parts = [self._answered(query[first : first + QUERIES_AT_ONCE]) for first in firsts]
        if len(parts) == 1:
            return parts[0]
        return Nearest(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Nearest)))

    def nearer_than(self, points: ArrayLike, reach: float) -> BoolArray:
        """(N,) True where the mesh is nearer than `reach`, m, to points (N, 3), m: of what is far off nothing is asked.

        Raises:
            MappingError: points of the wrong shape or not finite.
        """
        from mapping.geometry.mesh.nearest_kernels import nearer_than

        query, tree = _finite(points), self._tree[1]
        near = np.zeros(len(query), dtype=np.bool_)
        if reach > 0.0:
            length = float(tree.scale_in(reach))
            nearer_than(tree.rows, tree.leaves, tree.boxes, tree.links, tree.into(query), length, near)
        return near

    def _answered(self, query: FloatArray) -> Nearest:
        from mapping.geometry.mesh import nearest_kernels as kernels

        (index, tree), count = self._tree, len(query)
        points, distance, barycentric = np.empty((count, 3)), np.empty(count), np.empty((count, 3))
        face, part = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int8)
        kernels.nearest_points(
            tree.rows, tree.order, tree.leaves, tree.boxes, tree.links, tree.into(query),
            points, distance, face, barycentric, part,
        )  # fmt: skip
        face, points = index[face], tree.out(points)
        normals = self.surface.face_normals[face]
        border = np.flatnonzero(part)
        if len(border):  # a plane's inside needs no edges to be told apart
            on_vertex = part[border] >= kernels.ON_VERTEX
            edges, vertices = border[~on_vertex], border[on_vertex]
            normals[edges] = self.edge_normals[face[edges], part[edges] - kernels.ON_EDGE]
            normals[vertices] = self._vertex_normals[
                self.surface.faces[face[vertices], part[vertices] - kernels.ON_VERTEX]
            ]
        side = np.where(dots(query - points, normals) >= 0.0, 1.0, -1.0)
        return Nearest(points, tree.scale_out(distance), side, normals, face, barycentric)

    @cached_property
    def _tree(self) -> tuple[IntArray, TriangleTree]:
        """Indices of the faces that have an area, all faces if none has, and their tree."""
        proper = np.flatnonzero((self.surface.face_normals != 0).any(axis=1))
        index = proper if len(proper) else np.arange(len(self.surface.faces))
        return index, TriangleTree(Surface(self.surface.vertices, self.surface.faces[index]))

    @cached_property
    def edge_normals(self) -> FloatArray:
        """(F, 3, 3): of the edge opposite to each corner, the mean normal of the faces that share it."""
        faces = self.surface.faces
        one, other = faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]
        sides = np.minimum(one, other) * len(self.surface.vertices) + np.maximum(one, other)
        _, name = np.unique(sides, return_inverse=True)
        sums = np.zeros((int(name.max()) + 1, 3))
        np.add.at(sums, name.ravel(), np.repeat(self.surface.face_normals, 3, axis=0))
        return unit_vectors(sums)[name.ravel()].reshape(-1, 3, 3)

    def smooth_normals(self, face: IntArray, barycentric: FloatArray) -> FloatArray:
        """(N, 3) unit normals of the smooth body that facets stand for: linear between those of a face's corners.

        A corner's is the mean of those of the faces about it that no crease parts from this one (see `corner_normals`).
        A facet's own is off by up to half of what it turns against the next one.

        Args:
            face: (N,) faces in which the places lie.
            barycentric: (N, 3) their coordinates there.

        Reference: Phong, Communications of the ACM 18, 1975.
        """
        return self.smooth_body(face, barycentric)[0]

    def smooth_body(self, face: IntArray, barycentric: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same (N, 3), and (N,) by which that body lies over the facets, m; negative where it is hollow.

        Over a face the heights amid its sides (see `side_bulges`), each times four times the product of both
        coordinates, come to that of a quadratic exactly.
        """
        asked, row = np.unique(face, return_inverse=True)
        normals, corners = self.corner_normals(asked), self.surface.vertices[self.surface.faces[asked]]
        bulges = side_bulges(corners, normals)[row.ravel()]
        over = 4.0 * np.einsum("nc,nc->n", barycentric * barycentric[:, [1, 2, 0]], bulges)
        return unit_vectors(np.einsum("nc,ncx->nx", barycentric, normals[row.ravel()])), np.asarray(over)

    def corner_normals(self, face: IntArray) -> FloatArray:
        """(N, 3, 3) of each corner of some faces the mean normal of the faces about it that no crease parts from it.

        A face counts by the sine of its angle over the product of its sides there, which gives the normal of a ball
        whose facets they are, and of a cylinder, exactly; weighted by angles those of an icosahedron in 1280 facets are
        off by up to 5 mrad, which is 4 um between corners 3.5 mm apart.

        Reference: Max, Weights for computing vertex normals from facet normals, Journal of Graphics Tools 4(2), 1999.
        """
        normals, (order, first) = self.surface.face_normals, self._corners_at
        vertices = self.surface.faces[face].ravel()
        count = first[vertices + 1] - first[vertices]
        begins = np.cumsum(count) - count
        own = np.repeat(np.arange(len(vertices)), count)
        beside = order[np.arange(len(own)) + np.repeat(first[vertices] - begins, count)]
        other = beside // 3
        alike = np.einsum("ij,ij->i", normals[other], normals[face[own // 3]]) > np.cos(CREASE_ANGLE)
        sums = np.zeros((len(vertices), 3))
        np.add.at(sums, own, np.where(alike, self._steepness.ravel()[beside], 0.0)[:, None] * normals[other])
        return unit_vectors(sums).reshape(-1, 3, 3)

    @cached_property
    def _corners_at(self) -> tuple[IntArray, IntArray]:
        """(3 F,) corners 3 face + k of all faces, sorted by their vertices, and (V + 1,) the first of each vertex."""
        vertices = self.surface.faces.ravel()
        order = np.argsort(vertices, kind="stable")
        return order, np.searchsorted(vertices[order], np.arange(len(self.surface.vertices) + 1))

    @cached_property
    def _steepness(self) -> FloatArray:
        """(F, 3) sine of the faces' angles at their corners over the product of the sides there, 1/m^2."""
        ends = self.surface.vertices[self.surface.faces]
        u, v = (np.roll(ends, -k, axis=1) - ends for k in (1, 2))
        squares = np.einsum("fcx,fcx->fc", u, u) * np.einsum("fcx,fcx->fc", v, v)
        area = np.broadcast_to(2.0 * self.surface.face_areas[:, None], squares.shape)
        return np.asarray(np.divide(area, squares, out=np.zeros_like(squares), where=squares > 0))

    @cached_property
    def _angles(self) -> FloatArray:
        """(F, 3) angles of the faces at their corners, rad."""
        ends = self.surface.vertices[self.surface.faces]
        u, v = (unit_vectors(np.roll(ends, -k, axis=1) - ends) for k in (1, 2))
        return np.asarray(np.arccos(np.clip(np.einsum("fcx,fcx->fc", u, v), -1.0, 1.0)))

    @cached_property
    def _vertex_normals(self) -> FloatArray:
        """(V, 3) normals weighted by the faces' angles at the vertex."""
        faces, sums = self.surface.faces, np.zeros_like(self.surface.vertices)
        for corner in range(3):
            np.add.at(sums, faces[:, corner], self._angles[:, corner, None] * self.surface.face_normals)
        return unit_vectors(sums)


@dataclass(frozen=True, eq=False)
class MovedNearestPoint(NearestPoint):
    """Answers queries on a rigidly moved surface by those on the surface as it was: no tree is built again.

    Args:
        surface: the moved one.
        still: answers queries on the surface before the motion.
        rotation, translation: of the motion, x to rotation @ x + translation; (3, 3) and (3,) m.
    """

    still: NearestPoint
    rotation: FloatArray
    translation: FloatArray

    def _answered(self, query: FloatArray) -> Nearest:
        near = self.still.query((query - self.translation) @ self.rotation)
        points, normals = near.points @ self.rotation.T + self.translation, near.normals @ self.rotation.T
        return Nearest(points, near.distance, near.side, normals, near.face, near.barycentric)

    def nearer_than(self, points: ArrayLike, reach: float) -> BoolArray:
        return self.still.nearer_than((_finite(points) - self.translation) @ self.rotation, reach)

    @cached_property
    def edge_normals(self) -> FloatArray:
        return np.asarray(self.still.edge_normals @ self.rotation.T)

    def smooth_body(self, face: IntArray, barycentric: FloatArray) -> tuple[FloatArray, FloatArray]:
        normals, over = self.still.smooth_body(face, barycentric)
        return np.asarray(normals @ self.rotation.T), over


def _finite(points: ArrayLike) -> FloatArray:
    query = np.asarray(points, dtype=np.float64)
    if query.ndim != 2 or query.shape[1] != 3 or not np.isfinite(query).all():
        raise MappingError(f"nearest-point queries must be finite points of shape (N, 3); found shape {query.shape}")
    return query


def side_bulges(corners: FloatArray, normals: FloatArray) -> FloatArray:
    """(F, 3) height of a body over the middles of facets' sides, from each corner to the next, m; negative: below.

    Along a side e from corner i to j with normals n_i and n_j a curve rises over its chord by
    t (1 - t) (n_j - n_i) e / 2.

    Args:
        corners, normals: (F, 3, 3) of the facets, and of the body there.
    """
    ahead = [1, 2, 0]
    turned, sides = normals[:, ahead] - normals, corners[:, ahead] - corners
    return np.asarray(0.125 * np.einsum("fcx,fcx->fc", turned, sides))


class BoxedPoints:
    """Points in boxes of those that follow one another, as along sweeps; points in no order are put in one first.

    Places that follow one another, too, are answered at a third of the time that a search from the root of a tree
    takes: each is looked for from the answer before.

    Args:
        points: (M, 3) m, one or more.
    """

    def __init__(self, points: FloatArray) -> None:
        from mapping.geometry.mesh.box_kernels import POINTS_PER_BOX, boxes_about

        self.points, self._order = read_only(points), None
        steps = np.zeros(max(len(points) - 1, 0))
        for axis in range(3):  # of ten million points all at once would take half a GB for a moment
            steps += np.square(np.diff(self.points[:, axis]))
        steps = np.sqrt(steps, out=steps)
        if len(steps) and POINTS_PER_BOX * np.median(steps) > LONGEST_BOX * float(sides_of_box(points).max()):
            from scipy.spatial import cKDTree

            self._order = cKDTree(points, leafsize=POINTS_PER_BOX).indices.astype(np.int64)
            self.points = read_only(points[self._order])
        self.boxes: FloatArray = boxes_about(self.points)

    def nearest(self, places: FloatArray, reach: float = np.inf) -> tuple[FloatArray, IntArray]:
        """Distances (N,) of places (N, 3) from the points nearest to them, m, and their numbers.

        Infinite, and M, where no point is nearer than `reach`, m.
        """
        from mapping.geometry.mesh.box_kernels import nearest_within

        distance, number = np.empty(len(places)), np.empty(len(places), dtype=np.int64)
        nearest_within(self.points, self.boxes, read_only(places), reach, distance, number)
        if self._order is not None:
            number = np.append(self._order, len(self.points))[number]
        return distance, number


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """Rows scaled to length one; rows of no length stay zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0))
