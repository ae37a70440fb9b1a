"""Meshes of sweeps: rows zippered together, anything else triangulated over a projection or by ball pivoting."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray, IntArray, Surface, SweepMeshError, Trace
from mapping.estimate.sweeps import parallel_rows, pitch, thinned
from mapping.geometry.mesh import open3d

# Points whose outward directions all lie in this cone are a height field over their mean direction.
HEIGHT_FIELD_CONE = np.cos(np.deg2rad(60.0))
# Triangles of a triangulated cloud with an edge this many times the usual spacing span a hole.
LONGEST_EDGE = 6.0


def mesh_sweeps(trace: Trace, outward: ArrayLike = (0.0, 0.0, 1.0), spacing: float | None = None) -> Surface:
    """The traced surface: one mesh through the ball centres of a trace.

    Args:
        outward: (3,) or (N, 3) directions away from the body; orients the faces.
        spacing: distance to which samples are thinned along their sweeps, m; None takes the distance between
            neighbouring sweeps, which makes the triangles about equilateral.

    Raises:
        SweepMeshError: fewer than three samples, or all of them on one line.
    """
    directions = np.broadcast_to(np.asarray(outward, dtype=np.float64), trace.centers.shape)
    kept = thinned(trace.centers, trace.sweep, pitch(trace.centers, trace.sweep) if spacing is None else spacing)
    points, faces = trace.centers[kept], sweep_faces(trace.centers[kept], trace.sweep[kept], directions[kept])
    if len(faces) == 0:
        raise SweepMeshError(f"a mesh needs samples that span an area; the {len(trace)} samples lie on one line")
    return Surface(points, faces)


def sweep_faces(points: FloatArray, sweep: IntArray, outward: FloatArray, body: FloatArray | None = None) -> IntArray:
    """Counter-clockwise triangles (F, 3) over points (N, 3) of sweeps `sweep` (N,) seen from `outward` (N, 3).

    Parallel sweeps are zippered row by row: O(n log n), no holes, every point a vertex. Crossing sweeps and
    clouds are triangulated by Delaunay over the plane of the mean outward direction, over the sphere
    if they surround a point, and else by Open3D's ball pivoting; points that coincide then leave all but one
    of them without a face. Where centres coincide but their contacts do not, `body` (N, 3) is triangulated instead.
    """
    rows = parallel_rows(points, sweep)
    if rows is not None:
        # turned strip by strip: of ten million samples the corners and normals of all at once would be 2 GB
        pairs = pairwise([_looped(points, row) for row in rows])
        return np.vstack([oriented(points, zipper(points, first, second), outward) for first, second in pairs])
    points = points if body is None else body
    if len(np.unique(points, axis=0)) < 3 or len(points) < 4:
        return np.zeros((0, 3), dtype=np.int64)
    axis = outward.mean(axis=0)
    length = np.linalg.norm(axis)
    unit_outward = outward / np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-300)
    if length > 0 and (unit_outward @ (axis / length)).min() > HEIGHT_FIELD_CONE:
        return oriented(points, _over_plane(points, axis / length), outward)
    arm = points - points.mean(axis=0)
    if (np.einsum("ij,ij->i", arm, outward) > 0).all():
        return oriented(points, _over_sphere(arm), outward)
    return oriented(points, _ball_pivoting(points, outward), outward)


def zipper(points: FloatArray, first: IntArray, second: IntArray) -> IntArray:
    """Triangles between two polylines of vertex indices that run side by side, in either sense.

    Both are walked together by their place along the pair; each step spans a triangle, so nothing is
    left open: len(first) + len(second) - 2 triangles.
    """
    if first[0] == first[-1] and second[0] == second[-1]:
        second = _turned(points, first, second)
    a, b = points[first], points[second]
    along = (a[-1] - a[0]) / max(np.linalg.norm(a[-1] - a[0]), 1e-300)
    if first[0] != first[-1] and (b[-1] - b[0]) @ along < 0:
        second, b = second[::-1], b[::-1]
    s, t = _place(a, b)
    middle_s, middle_t = 0.5 * (s[1:] + s[:-1]), 0.5 * (t[1:] + t[:-1])
    opposite = np.searchsorted(middle_t, middle_s, side="left")
    lower = np.column_stack([first[:-1], first[1:], second[opposite]])
    opposite = np.searchsorted(middle_s, middle_t, side="right")
    upper = np.column_stack([second[1:], second[:-1], first[opposite]])
    return np.vstack([lower, upper])


def _looped(points: FloatArray, row: IntArray) -> IntArray:
    """The row, its first vertex repeated at the end if the sweep comes back to where it began."""
    steps = np.linalg.norm(np.diff(points[row], axis=0), axis=1)
    back = np.linalg.norm(points[row[-1]] - points[row[0]])
    closed = len(row) > 8 and back < 3 * np.median(steps)
    return np.concatenate([row, row[:1]]) if closed else row


def _turned(points: FloatArray, first: IntArray, second: IntArray) -> IntArray:
    """A closed row begun beside the beginning of another and walked in the same sense."""
    ring = second[:-1]
    ring = np.roll(ring, -int(np.argmin(np.linalg.norm(points[ring] - points[first[0]], axis=1))))
    quarter = points[first[len(first) // 4]]
    ahead, behind = points[ring[len(ring) // 4]], points[ring[-(len(ring) // 4)]]
    if np.linalg.norm(behind - quarter) < np.linalg.norm(ahead - quarter):
        ring = np.roll(ring[::-1], 1)
    return np.concatenate([ring, ring[:1]])


def _place(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Increasing places of two polylines: along their common chord if both advance, else their share of length."""
    chord = (a[-1] - a[0]) + (b[-1] - b[0])
    s, t = a @ chord, b @ chord
    if (np.diff(s) >= 0).all() and (np.diff(t) >= 0).all() and np.linalg.norm(chord) > 0:
        return s, t
    shares = []
    for line in (a, b):
        length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
        shares.append(length / max(length[-1], 1e-300))
    return shares[0], shares[1]


def oriented(points: FloatArray, faces: IntArray, outward: FloatArray) -> IntArray:
    """The faces, each turned so that it faces its corners' outward direction."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    up = outward[faces[:, 0]] + outward[faces[:, 1]] + outward[faces[:, 2]]
    away = np.einsum("ij,ij->i", np.cross(b - a, c - a), up) < 0
    return np.where(away[:, None], faces[:, ::-1], faces)


def _over_plane(points: FloatArray, axis: FloatArray) -> IntArray:
    from scipy.spatial import Delaunay, QhullError

    frame = np.linalg.svd(axis[None, :])[2][1:]
    flat = (points - points.mean(axis=0)) @ frame.T
    try:
        faces = Delaunay(flat / max(np.abs(flat).max(), 1e-300)).simplices.astype(np.int64)
    except QhullError as error:
        raise SweepMeshError(f"{len(points)} points cannot be triangulated; they lie on one line") from error
    edges = np.linalg.norm(flat[faces] - flat[np.roll(faces, 1, axis=1)], axis=2).max(axis=1)
    return np.asarray(faces[edges <= LONGEST_EDGE * float(np.median(edges))])


def _over_sphere(arm: FloatArray) -> IntArray:
    from scipy.spatial import ConvexHull

    return np.asarray(ConvexHull(arm / np.linalg.norm(arm, axis=1, keepdims=True)).simplices, dtype=np.int64)


def _ball_pivoting(points: FloatArray, outward: FloatArray) -> IntArray:
    from scipy.spatial import cKDTree

    o3d = open3d()
    origin = points.mean(axis=0)
    spacing = float(np.median(np.asarray(cKDTree(points).query(points, k=2)[0])[:, 1]))
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector((points - origin) / spacing))
    cloud.normals = o3d.utility.Vector3dVector(np.array(outward))  # Open3D refuses read-only arrays
    radii = o3d.utility.DoubleVector([1.0, 2.0, 4.0, 8.0])
    mesh = o3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, radii)
    return np.asarray(mesh.triangles, dtype=np.int64).reshape(-1, 3)
