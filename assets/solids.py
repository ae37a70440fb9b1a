"""Solids: closed bodies with concave parts, handles and holes, as level sets of distances that are blended."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from triangles import Mesh, grid_faces, welded

from mapping.arrays import FloatArray

# Signed distance (N,) of places (N, 3), m, nearly; negative inside
Solid = Callable[[FloatArray], FloatArray]
# Rounds in which the corners of a level set's triangles move to the middle of their neighbours and back to the set
EVENING_ROUNDS = 12


def blended(*distances: FloatArray, radius: float) -> FloatArray:
    """The union of solids, its inner corners filled by about this radius, m (a polynomial smooth minimum)."""
    union = distances[0]
    for each in distances[1:]:
        share = np.maximum(radius - np.abs(union - each), 0.0) / radius
        union = np.minimum(union, each) - 0.25 * radius * share**2
    return union


def ring(places: FloatArray, radius: float, thick: float) -> FloatArray:
    """Distance from a torus about the z axis, m."""
    return np.asarray(np.hypot(np.hypot(places[:, 0], places[:, 1]) - radius, places[:, 2]) - thick)


def vase(places: FloatArray) -> FloatArray:
    """A vase that swells and narrows, 70 mm high, closed, with a handle that a fingertip passes through."""
    x, y, z = places.T
    radius = 16e-3 + 5e-3 * np.cos(2.0 * np.pi * (z + 12e-3) / 70e-3)
    wall = np.hypot(x, y) - radius
    body = np.maximum(wall, 0.0) + np.minimum(np.maximum(wall, np.abs(z) - 35e-3), 0.0)
    over = np.maximum(np.abs(z) - 35e-3, 0.0)
    body = np.where(over > 0, np.hypot(np.maximum(wall, 0.0), over), body) - 2e-3
    handle = ring(np.column_stack([x - 24e-3, z - 2e-3, y]), 18e-3, 5e-3)
    return blended(body, handle, radius=4e-3)


def bowl(places: FloatArray) -> FloatArray:
    """Half a hollow ball, 64 mm wide, its wall 6 mm thick and round at the rim."""
    x, y, z = places.T
    flat = np.hypot(x, y)
    shell = np.abs(np.linalg.norm(places, axis=1) - 29e-3)
    rim = np.hypot(flat - 29e-3, z)
    return np.asarray(np.where(z < 0, shell, rim) - 3e-3)


def double_ring(places: FloatArray) -> FloatArray:
    """Two rings that have grown together: a body of genus 2."""
    shift = np.array([19e-3, 0.0, 0.0])
    return blended(ring(places - shift, 18e-3, 7e-3), ring(places + shift, 18e-3, 7e-3), radius=3e-3)


def folds(places: FloatArray) -> FloatArray:
    """Five lobes that press together, with folds between them narrower than a tip of 3 mm."""
    centers = 1e-3 * np.array([[0, 0, 0], [19, 4, 6], [-13, 15, 4], [-9, -18, 5], [5, 3, -22], [4, 2, 23]])
    sizes = 1e-3 * np.array([19, 14, 13, 14, 13, 12])
    lobes = [np.linalg.norm(places - center, axis=1) - size for center, size in zip(centers, sizes, strict=True)]
    return blended(*lobes, radius=2e-3)


def level_set(solid: Solid, low: FloatArray, high: FloatArray, spacing: float) -> Mesh:
    """Triangles of a solid's surface, its corners on the surface itself, about a spacing (m) apart."""
    import igl

    axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    places = np.ascontiguousarray(grid.transpose(2, 1, 0, 3).reshape(-1, 3))
    vertices, faces, _ = igl.marching_cubes(solid(places), places, *(len(axis) for axis in axes), 0.0)
    vertices, faces = welded(np.round(vertices, 12), np.asarray(faces))
    used, index = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], index.reshape(-1, 3)
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = np.bincount(ends[:, 0], minlength=len(vertices))[:, None]
    for _ in range(EVENING_ROUNDS):
        middle = np.zeros_like(vertices)
        np.add.at(middle, ends[:, 0], vertices[ends[:, 1]])
        vertices = onto(solid, 0.5 * (vertices + middle / count))
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    inside_out = np.einsum("ij,ij->", a, np.cross(b, c)) < 0
    return vertices, faces[:, ::-1] if inside_out else faces


def onto(solid: Solid, places: FloatArray) -> FloatArray:
    """Places moved to a solid's surface along the steepest way, by three steps of Newton's."""
    h = 1e-7
    for _ in range(3):
        slope = np.stack([solid(places + h * e) - solid(places - h * e) for e in np.eye(3)], axis=1) / (2.0 * h)
        places = places - (solid(places) / (slope**2).sum(axis=1))[:, None] * slope
    return places


def holed_plate(size: tuple[float, float], thick: float, hole: float, sides: int = 56) -> Mesh:
    """A plate in the middle of z = 0 with a round hole through its middle, its corners and edges sharp; m."""
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    corner = np.arctan2(size[1], size[0])
    # the corners of the plate are corners of the mesh
    for turn in (corner, np.pi - corner, np.pi + corner, 2.0 * np.pi - corner):
        angle[np.abs(angle - turn).argmin()] = turn
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    outer = way / np.abs(way / (0.5 * np.array(size))).max(axis=1)[:, None]
    rows = [hole * way + share * (outer - hole * way) for share in np.linspace(0.0, 1.0, 10)]
    half = 0.5 * thick
    above = [np.column_stack([row, np.full(sides, half)]) for row in rows]
    below = [np.column_stack([row, np.full(sides, -half)]) for row in rows]
    loops = [*above, *below[::-1], above[0]]
    return welded(np.concatenate(loops), grid_faces(len(loops), sides, closed=True))
