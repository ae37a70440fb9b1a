"""Curved bodies: closed forms of known curvature, meshed regularly, irregularly or thinly, with noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Surface

TORUS_RADII = (5 / 7, 2 / 7)
ELLIPSOID_AXES = (1.0, 0.7, 0.5)
BUMP_STEEPNESS = 15.0
# All bodies are 2 across; squares are judged where |x| and |y| are below this: their borders have one-sided neighbours.
INNER_HALF = 0.85
# Vertices of each sampling; "irregular" and "thin" are scattered by up to half a step to every side.
SAMPLINGS = {"regular": 2500, "irregular": 2500, "thin": 400}
FOOT_STEPS = 20

Implicit = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]


@dataclass(frozen=True, eq=False)
class CurvedBody:
    """A mesh with the true curvatures (V,), 1/m, of the surface nearest to its vertices, and which (V,) are judged."""

    surface: Surface
    k1: FloatArray
    k2: FloatArray
    interior: BoolArray


def curved_body(name: str, sampling: str, noise: float, seed: int) -> CurvedBody:
    """A body of CURVED_BODIES, sampled in one of SAMPLINGS, its vertices shaken in all directions by noise, m.

    The truth is that of the place on the surface that is nearest to the shaken vertex: that is what can be asked for.
    """
    rng = np.random.default_rng(seed)
    points, faces, interior = _sampled(name, SAMPLINGS[sampling], sampling != "regular", rng)
    shaken = points + noise * rng.standard_normal(points.shape)
    feet = _feet(CURVED_BODIES[name], shaken, points, noise) if noise else points
    return CurvedBody(Surface(shaken, faces), *_curvatures(CURVED_BODIES[name], feet), interior)


def _ball(axes: tuple[float, float, float]) -> Implicit:
    squares = np.asarray(axes) ** 2

    def implicit(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        return (x**2 / squares).sum(axis=1) - 1, 2 * x / squares, np.tile(np.diag(2 / squares), (len(x), 1, 1))

    return implicit


def _torus(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    big, small = TORUS_RADII
    out = np.hypot(x[:, 0], x[:, 1])
    unit = x[:, :2] / out[:, None]
    across = unit[:, :, None] * unit[:, None, :]
    second = np.zeros((len(x), 3, 3))
    second[:, :2, :2] = 2 * across + 2 * ((out - big) / out)[:, None, None] * (np.eye(2) - across)
    second[:, 2, 2] = 2.0
    first = np.column_stack([2 * (out - big)[:, None] * unit, 2 * x[:, 2]])
    return (out - big) ** 2 + x[:, 2] ** 2 - small**2, first, second


def _saddle(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    first = np.column_stack([-x[:, 0], x[:, 1], np.ones(len(x))])
    return x[:, 2] - 0.5 * (x[:, 0] ** 2 - x[:, 1] ** 2), first, np.tile(np.diag([-1.0, 1.0, 0.0]), (len(x), 1, 1))


def _bump(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    a, flat = BUMP_STEEPNESS, x[:, :2]
    height = 1 / (1 + a * (flat**2).sum(axis=1))
    first = np.column_stack([2 * a * flat * (height**2)[:, None], np.ones(len(x))])
    second = np.zeros((len(x), 3, 3))
    second[:, :2, :2] = 2 * a * (height**2)[:, None, None] * np.eye(2)
    second[:, :2, :2] -= 8 * a**2 * (height**3)[:, None, None] * flat[:, :, None] * flat[:, None, :]
    return x[:, 2] - height, first, second


# Each gives a function that is zero on the surface and grows outward, with its first and second derivatives.
CURVED_BODIES: dict[str, Implicit] = {
    "sphere": _ball((1.0, 1.0, 1.0)),
    "ellipsoid": _ball(ELLIPSOID_AXES),
    "torus": _torus,
    "saddle": _saddle,
    "bump": _bump,
}


def _curvatures(implicit: Implicit, feet: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(V,) principal curvatures, the larger first: those of the second derivatives in the tangent plane."""
    _, first, second = implicit(feet)
    steep = np.linalg.norm(first, axis=1)
    normal = first / steep[:, None]
    flat = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    shape = flat @ second @ flat / steep[:, None, None]
    mean = 0.5 * np.trace(shape, axis1=1, axis2=2)
    # of what is left beside the mean curvature: a difference of squares keeps half of the digits at umbilics
    half = np.sqrt(0.5 * ((shape - mean[:, None, None] * flat) ** 2).sum(axis=(1, 2)))
    return mean + half, mean - half


def _feet(implicit: Implicit, shaken: FloatArray, places: FloatArray, noise: float) -> FloatArray:
    """(V, 3) nearest places on the surface by Newton's method; the original ones where it does not stay near."""
    x = places.copy()
    _, first, _ = implicit(x)
    pull = ((shaken - x) * first).sum(axis=1) / (first**2).sum(axis=1)
    for _ in range(FOOT_STEPS):
        value, first, second = implicit(x)
        system = np.zeros((len(x), 4, 4))
        system[:, :3, :3] = np.eye(3) + pull[:, None, None] * second
        system[:, :3, 3] = system[:, 3, :3] = first
        rest = np.column_stack([shaken - x - pull[:, None] * first, -value])
        step = np.linalg.solve(system, rest[:, :, None])[:, :, 0]
        share = np.minimum(1.0, 3 * noise / np.maximum(np.linalg.norm(step[:, :3], axis=1), np.finfo(float).tiny))
        x, pull = x + share[:, None] * step[:, :3], pull + share * step[:, 3]
    away = ~(np.linalg.norm(x - places, axis=1) < 6 * noise)
    return np.where(away[:, None], places, x)


def _sampled(
    name: str, count: int, scattered: bool, rng: np.random.Generator
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Vertices on the surface, outward faces, and which vertices are judged."""
    if name in ("sphere", "ellipsoid"):
        from scipy.spatial import ConvexHull

        unit = _geodesic(count)
        if scattered:
            unit = unit + np.sqrt(4 * np.pi / len(unit)) * rng.uniform(-0.5, 0.5, unit.shape)
            unit /= np.linalg.norm(unit, axis=1, keepdims=True)
        points = unit * (ELLIPSOID_AXES if name == "ellipsoid" else 1.0)
        faces = ConvexHull(unit).simplices.astype(np.int64)
        return points, _outward(name, points, faces), np.ones(len(points), dtype=bool)
    if name == "torus":
        return _sampled_torus(count, scattered, rng)
    side = round(np.sqrt(count))
    x, y = (g.ravel() for g in np.meshgrid(*[np.linspace(-1, 1, side)] * 2, indexing="ij"))
    if scattered:
        step = 2 / (side - 1)
        inner = (np.abs(x) < 1 - step / 2) & (np.abs(y) < 1 - step / 2)
        x, y = (np.where(inner, g + step * rng.uniform(-0.5, 0.5, len(g)), g) for g in (x, y))
    faces = _triangles(np.column_stack([x, y])) if scattered else _grid_faces(side, side, closed=False)
    z = 0.5 * (x**2 - y**2) if name == "saddle" else 1 / (1 + BUMP_STEEPNESS * (x**2 + y**2))
    points = np.column_stack([x, y, z])
    return points, _outward(name, points, faces), (np.abs(x) < INNER_HALF) & (np.abs(y) < INNER_HALF)


def _sampled_torus(count: int, scattered: bool, rng: np.random.Generator) -> tuple[FloatArray, IntArray, BoolArray]:
    big, small = TORUS_RADII
    around = round(np.sqrt(count * big / small))
    across = round(count / around)
    u, v = (g.ravel() for g in np.meshgrid(np.arange(around), np.arange(across), indexing="ij"))
    uv = np.column_stack([u, v]).astype(np.float64)
    faces = _grid_faces(around, across, closed=True)
    if scattered:
        uv += rng.uniform(-0.5, 0.5, uv.shape)
        size = np.array([around, across], dtype=np.float64)
        tiles = np.concatenate([uv + size * (i, j) for i in (0, -1, 1) for j in (0, -1, 1)])
        found = _triangles(tiles)
        middle = tiles[found].mean(axis=1)
        faces = found[((middle >= 0) & (middle < size)).all(axis=1)] % len(uv)
    a, b = 2 * np.pi * uv[:, 0] / around, 2 * np.pi * uv[:, 1] / across
    out = big + small * np.cos(b)
    points = np.column_stack([out * np.cos(a), out * np.sin(a), small * np.sin(b)])
    return points, _outward("torus", points, faces), np.ones(len(points), dtype=bool)


def _geodesic(count: int) -> FloatArray:
    """About so many points of the unit sphere: an icosahedron's faces in equal triangles, blown up."""
    import trimesh

    body, parts = trimesh.creation.icosahedron(), max(1, round(np.sqrt((count - 2) / 10)))
    weights = np.array([(i, j, parts - i - j) for i in range(parts + 1) for j in range(parts + 1 - i)]) / parts
    points = np.einsum("wk,fkx->fwx", weights, body.vertices[body.faces]).reshape(-1, 3)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points = np.unique(np.round(points, 12), axis=0)
    return np.asarray(points / np.linalg.norm(points, axis=1, keepdims=True))


def _triangles(flat: FloatArray) -> IntArray:
    from scipy.spatial import Delaunay

    return np.asarray(Delaunay(flat).simplices, dtype=np.int64)


def _grid_faces(rows: int, columns: int, closed: bool) -> IntArray:
    a = np.arange(rows * columns).reshape(rows, columns)
    b, d = np.roll(a, -1, 0), np.roll(a, -1, 1)
    c = np.roll(b, -1, 1)
    kept = [i.ravel() if closed else i[:-1, :-1].ravel() for i in (a, b, c, d)]
    return np.concatenate([np.column_stack([kept[0], kept[1], kept[2]]), np.column_stack([kept[0], *kept[2:]])])


def _outward(name: str, points: FloatArray, faces: IntArray) -> IntArray:
    """The faces, turned where they look inward."""
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # the middle of a face of the torus may lie at its axis' height: any corner tells as well
    inward = (normals * CURVED_BODIES[name](corners[:, 0])[1]).sum(axis=1) < 0
    return np.where(inward[:, None], faces[:, ::-1], faces)
