"""Meshes of the contact tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from mapping.surface import Surface

DATA = Path(__file__).parents[3] / "shared" / "data"


def bump(a: float, cells: int = 40) -> Surface:
    """The paper's bump z = 1 / (1 + a u^2) over a square of size 2."""
    x = np.linspace(-1.0, 1.0, cells + 1)
    u, v = np.meshgrid(x, x, indexing="ij")
    return grid(u, v, 1.0 / (1.0 + a * (u * u + v * v)))


def grid(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Surface:
    """Two triangles for each cell of (M, N) arrays, normals up where x and y grow with their indices."""
    points = np.stack([np.asarray(x), np.asarray(y), np.asarray(z)], axis=-1)
    n = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
    a, b, c, d = n[:-1, :-1].ravel(), n[1:, :-1].ravel(), n[1:, 1:].ravel(), n[:-1, 1:].ravel()
    return Surface(points.reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def extruded(profile: ArrayLike, half_width: float) -> Surface:
    """A profile (K, 2) of x, z pulled along y, its normals up where x grows."""
    x, z = np.asarray(profile, dtype=np.float64).T
    y = np.array([-half_width, half_width])
    return grid(*np.broadcast_arrays(x[:, None], y[None, :], z[:, None]))


def box(low: ArrayLike = (-1, -1, -1), high: ArrayLike = (1, 1, 1)) -> Surface:
    corners = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return Surface(np.where(corners == 0, np.asarray(low, float), np.asarray(high, float)), np.array(faces))


def torus(ring: float = 1.0, tube: float = 0.4, cells: int = 40) -> Surface:
    u = np.linspace(0.0, 2.0 * np.pi, cells + 1)
    v, w = np.meshgrid(u, u, indexing="ij")
    distance = ring + tube * np.cos(w)
    return grid(distance * np.cos(v), distance * np.sin(v), tube * np.sin(w))


def slotted_plate(width: float = 0.3, depth: float = 0.2) -> Surface:
    w = width / 2
    return extruded([(-1, 0), (-w, 0), (-w, -depth), (w, -depth), (w, 0), (1, 0)], 1.0)


def merged(*surfaces: Surface) -> Surface:
    offsets = np.cumsum([0] + [len(surface.vertices) for surface in surfaces])
    faces = [surface.faces + offset for surface, offset in zip(surfaces, offsets, strict=False)]
    return Surface(np.concatenate([surface.vertices for surface in surfaces]), np.concatenate(faces))


def flipped(surface: Surface) -> Surface:
    return Surface(surface.vertices, surface.faces[:, ::-1])


def shared(name: str) -> Surface:
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is absent")
    import igl

    vertices, faces = igl.read_triangle_mesh(str(path))[:2]
    return Surface(vertices[:, :3], faces)


BODIES = {
    "bump 15": lambda: bump(15.0),
    "bump 1000": lambda: bump(1000.0),
    "cube": box,
    "torus": torus,
    "slotted plate": slotted_plate,
    "bunny": lambda: shared("bunny.off"),
    "fandisk": lambda: shared("fandisk.off"),
}
