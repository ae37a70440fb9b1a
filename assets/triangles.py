"""Triangles: the few kinds of surface that the shipped objects are put together from."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from mapping.arrays import BoolArray, FloatArray, IntArray

Mesh = tuple[FloatArray, IntArray]


def height_field(u: FloatArray, v: FloatArray, height: FloatArray) -> Mesh:
    """Triangles over the grid u x v with heights (len(u), len(v)), outward up."""
    grid = np.stack([*np.meshgrid(u, v, indexing="ij"), height], axis=-1)
    return grid.reshape(-1, 3), grid_faces(len(u), len(v))


def grid_faces(rows: int, columns: int, closed: bool = False) -> IntArray:
    """Two triangles for each cell of a grid of vertices, row-major; `closed` joins the last column to the first."""
    index = np.arange(rows * columns).reshape(rows, columns)
    if closed:
        index = np.column_stack([index, index[:, 0]])
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def dome(rings: FloatArray, heights: FloatArray, top: float, sides: int) -> Mesh:
    """A surface of revolution about z: an apex at height `top`, then rings (radius, height) outward."""
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    walls = [np.column_stack([r * circle, np.full(sides, h)]) for r, h in zip(rings, heights, strict=True)]
    crown = np.column_stack([np.zeros(sides, dtype=np.int64), np.arange(sides) + 1, np.roll(np.arange(sides), -1) + 1])
    return np.vstack([np.array([[0.0, 0.0, top]]), *walls]), np.vstack(
        [crown, grid_faces(len(rings), sides, closed=True) + 1]
    )


def tube(path: FloatArray, up: FloatArray, radius: float, angles: FloatArray) -> Mesh:
    """A round tube about a path (K, 3), cut square at both ends; angle 0 of its section points to `up` (K, 3).

    Facets lie radius * (1 - cos(step / 2)) inside the round, less than 1 um for both wires.
    """
    tangent = np.gradient(path, axis=0, edge_order=2)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, up)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    circle = np.cos(angles)[:, None] * np.cross(side, tangent)[:, None, :] + np.sin(angles)[:, None] * side[:, None, :]
    rings, sides = (path[:, None, :] + radius * circle).reshape(-1, 3), len(angles)
    first, last = np.arange(sides), np.arange(sides) + (len(path) - 1) * sides
    start = np.column_stack([np.full(sides, len(rings)), np.roll(first, -1), first])
    stop = np.column_stack([np.full(sides, len(rings) + 1), last, np.roll(last, -1)])
    wall = grid_faces(len(path), sides, closed=True)[:, ::-1]
    return np.vstack([rings, path[[0, -1]]]), np.vstack([wall, start, stop])


def together(*meshes: Mesh) -> Mesh:
    """The union as one list of triangles: a ball that touches from outside cannot tell it from a boolean union."""
    starts = itertools.accumulate((len(vertices) for vertices, _ in meshes[:-1]), initial=0)
    return (
        np.vstack([vertices for vertices, _ in meshes]),
        np.vstack([faces + start for (_, faces), start in zip(meshes, starts, strict=True)]),
    )


def walls(lines: FloatArray, pair: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Grid lines with both of `pair` doubled, and 1 for those inside: a wall stands between the two of a double."""
    low, high = pair
    inside = lines[(lines >= low) & (lines <= high)]
    parts = [lines[lines <= low], inside, lines[lines >= high]]
    return np.concatenate(parts), np.repeat([0.0, 1.0, 0.0], [len(part) for part in parts])


def extruded(x: FloatArray, y: FloatArray, z: FloatArray, solid: BoolArray) -> Mesh:
    """The closed body over those cells of the grid x by y that are solid (len(x) - 1, len(y) - 1), from z[0] to z[-1].

    Every grid line cuts the surface, so that neighbouring sides share their vertices.
    """
    vertices = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(vertices)).reshape(len(x), len(y), len(z))
    ring = np.pad(solid, 1)
    quads = []
    for i, j in np.argwhere(solid):
        a, b, c, d = number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]
        quads += [[a[0], d[0], c[0], b[0]], [a[-1], b[-1], c[-1], d[-1]]]
        beside = (
            (ring[i + 1, j], a, b),
            (ring[i + 2, j + 1], b, c),
            (ring[i + 1, j + 2], c, d),
            (ring[i, j + 1], d, a),
        )
        for filled, p, q in beside:
            quads += [] if filled else np.stack([p[:-1], q[:-1], q[1:], p[1:]], axis=1).tolist()
    corners = np.array(quads)
    used, index = np.unique(corners, return_inverse=True)
    a, b, c, d = index.reshape(corners.shape).T
    return vertices[used], np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def welded(vertices: FloatArray, faces: IntArray) -> Mesh:
    """Without the cells of no area that doubled grid lines leave where no wall stands."""
    unique, index = np.unique(vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return unique, faces[distinct]


def write_ply(path: Path, mesh: Mesh) -> None:
    """Binary PLY with double coordinates: single precision would move the wire's facets by up to 8 nm."""
    vertices, faces = mesh
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\n"
        f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("index", "<i4", 3)])
    rows["count"], rows["index"] = 3, faces
    path.write_bytes(header.encode() + np.ascontiguousarray(vertices, dtype="<f8").tobytes() + rows.tobytes())
