"""Bodies of the exploration bench: plates, a cylinder and a free-form blob, and what lies on them."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, IntArray, Surface

Mesh = tuple[FloatArray, IntArray]


def tube(axis: FloatArray, up: FloatArray, radius: float, sides: int = 24, rings: int = 6) -> Mesh:
    """A tube with round caps around a polyline (K, 3); `up` (K, 3) is nowhere along it."""
    along = np.gradient(axis, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, up)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    lift = np.arange(1, rings + 1) * (0.5 * np.pi / (rings + 0.5))
    first, last = ([np.cos(a), w * np.sin(a)] for a, w in ((lift, -1.0), (lift, 1.0)))
    frames = [*((0, c, s) for c, s in np.transpose(first)[::-1])]
    frames += [(k, 1.0, 0.0) for k in range(len(axis))]
    frames += [(len(axis) - 1, c, s) for c, s in np.transpose(last)]
    angle = 2 * np.pi * np.arange(sides) / sides
    stack = []
    for k, shrink, shift in frames:
        circle = np.outer(np.cos(angle), np.cross(side[k], along[k])) + np.outer(np.sin(angle), side[k])
        stack.append(axis[k] + radius * (shrink * circle + shift * along[k]))
    return np.concatenate(stack), _rolled(len(stack), sides)


def _rolled(rings: int, sides: int) -> IntArray:
    """Triangles between consecutive rings of `sides` vertices each, wrapped around."""
    ring, i = (grid.ravel() for grid in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij"))
    a, b = ring * sides + i, ring * sides + (i + 1) % sides
    return np.concatenate([np.column_stack([a, b, b + sides]), np.column_stack([a, b + sides, a + sides])])


def joined(*meshes: Mesh) -> Surface:
    """One surface of several meshes, side by side."""
    vertices, faces, count = [], [], 0
    for points, triangles in meshes:
        vertices.append(points)
        faces.append(triangles + count)
        count += len(points)
    return Surface(np.concatenate(vertices), np.concatenate(faces))


def plate(long: float, short: float) -> Mesh:
    """A rectangle in the plane z = 0 with its middle in the origin, halved along x = 0."""
    x, y = 0.5 * long, 0.5 * short
    corners = np.array([[-x, -y, 0], [0, -y, 0], [x, -y, 0], [x, y, 0], [0, y, 0], [-x, y, 0]], dtype=np.float64)
    return corners, np.array([[0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4]])


def folded(points: FloatArray, angle: float) -> FloatArray:
    """Points bent down about the line x = 0, z = 0."""
    x, z = points[:, 0], points[:, 2]
    bent = points.copy()
    bent[:, 0] = np.where(x > 0, x * np.cos(angle) + z * np.sin(angle), x)
    bent[:, 2] = np.where(x > 0, z * np.cos(angle) - x * np.sin(angle), z)
    return bent


def slotted_plate(long: float, short: float, low: FloatArray, high: FloatArray, depth: float) -> Mesh:
    """The rectangle with a rectangular groove between the corners `low` and `high` (2,), in-plane."""
    x = np.array([-0.5 * long, low[0], high[0], 0.5 * long])
    y = np.array([-0.5 * short, low[1], high[1], 0.5 * short])
    grid = np.array([[a, b, 0.0] for b in y for a in x])
    floor = grid[[5, 6, 10, 9]] - [0.0, 0.0, depth]
    faces = []
    for j in range(3):
        for i in range(3):
            if (i, j) != (1, 1):
                a = 4 * j + i
                faces += [[a, a + 1, a + 5], [a, a + 5, a + 4]]
    rim, bottom = [5, 6, 10, 9], [16, 17, 18, 19]
    faces += [[16, 17, 18], [16, 18, 19]]
    for k in range(4):
        a, b, c, d = rim[k], rim[(k + 1) % 4], bottom[(k + 1) % 4], bottom[k]
        faces += [[a, b, c], [a, c, d]]
    return np.concatenate([grid, floor]), np.array(faces)


def cylinder(radius: float, height: float, sides: int = 360) -> Mesh:
    """The side of a cylinder about the z axis, symmetric to z = 0."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides, -0.5 * height)])
    top = ring + np.array([0.0, 0.0, height])
    return np.concatenate([ring, top]), _rolled(2, sides)


def blob(directions: FloatArray) -> FloatArray:
    """(N, 3) points of a bunny-sized free-form body, m, in the given directions (N, 3) from its middle."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    x, y, z = unit.T
    swell = 1.0 + 0.12 * z + 0.1 * (x**2 - y**2) + 0.06 * x * y * z + 0.05 * (3 * z**2 - 1) * x
    return np.asarray(0.045 * swell[:, None] * unit)


def blob_normals(directions: FloatArray) -> FloatArray:
    """(N, 3) outward unit normals of the blob there, by central differences."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    helper = np.eye(3)[np.abs(unit).argmin(axis=1)]
    first = np.cross(unit, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(unit, first)
    h = 1e-5
    along, across = (blob(unit + h * way) - blob(unit - h * way) for way in (first, second))
    normal = np.cross(along, across)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def sphere_mesh(subdivisions: int) -> Mesh:
    """Unit vectors and triangles of a subdivided icosahedron, 20 x 4^subdivisions of them."""
    from trimesh.creation import icosphere

    ball = icosphere(subdivisions=subdivisions)
    return np.asarray(ball.vertices, dtype=np.float64), np.asarray(ball.faces, dtype=np.int64)
