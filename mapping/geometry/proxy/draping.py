"""Draping: outlines, walls and floors of hollows and steps, as triangles that follow a base."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, IntArray
from mapping.geometry.mesh import NearestPoint, arclengths, directions
from mapping.geometry.proxy.parts import Terrace, Trench

# By how much chords of an outline, and facets of a floor, may miss the curve that they stand for, m: less than a third
# of the smallest edge that people feel (0.85 um, LaMotte and Whitehouse 1986)
CHORD_ERROR = 2.5e-7
# A mitre is no longer than this part of the half-width
LONGEST_MITRE = 2.0
# Legs that chords are halved into on a bent base, at most
MOST_HALVINGS = 7
# Rows of a floor from side to side, at most
MOST_FLOOR_ROWS = 33
# The ramps at the far sides of a step fall by one in so many: 1.1 degrees, below what people call a slope in a crossing
RAMP = 50.0

Mesh = tuple[FloatArray, IntArray]


def trench_mesh(trench: Trench, base: NearestPoint) -> Mesh:
    """(vertices, faces) of walls and floor, m; the mouth is left open."""
    half, axis = 0.5 * trench.width, trench.axis
    if len(axis) == 1:
        turn = np.linspace(0.0, 2.0 * np.pi, _chords(half) + 1)[:-1]
        across, along = _plane(trench.normals[0])
        ring = _even(half, len(turn)) * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * along)
        shares = _shares(draped(axis + ring, base)[0].mean(axis=0) - axis[0])
        rows = [axis + share * np.vstack([ring, ring[:1]]) for share in shares]
        return _hollow([draped(row, base) for row in rows], trench.depth, sides=(False, True))
    closed = np.array_equal(axis[0], axis[-1])
    laterals = _laterals(axis, trench.normals)
    reach = half * _mitres(axis, closed)[:, None] * laterals
    sag = 0.5 * (draped(axis + reach, base)[0] + draped(axis - reach, base)[0]) - axis
    rows = [axis + (2.0 * share - 1.0) * reach for share in _shares(sag)]
    mesh = _hollow([draped(row, base) for row in rows], trench.depth, sides=(True, True))
    if closed:
        return mesh
    ends = []
    for end in (0, -1):
        rim, outward = draped(np.array([row[end] for row in rows]), base)
        ends.append(_strips([rim, rim - trench.depth * outward]))
    return joined([mesh, *ends])


def terrace_mesh(terrace: Terrace, base: NearestPoint) -> Mesh:
    """(vertices, faces) of the wall, the higher level and the ramps that end it, m."""
    axis, normals = terrace.axis, terrace.normals
    s = arclengths(axis)
    ramp = RAMP * terrace.height
    tangents = directions(axis)
    axis = np.vstack([axis[:1] - ramp * tangents[:1], axis, axis[-1:] + ramp * tangents[-1:]])
    normals = np.vstack([normals[:1], normals, normals[-1:]])
    laterals = terrace.high_side * np.cross(normals, directions(axis))
    laterals /= np.linalg.norm(laterals, axis=1, keepdims=True)
    up = np.ones(len(axis))
    up[0] = up[-1] = 0.0
    far = base.query(axis + s[-1] * laterals).points
    half_way = base.query(axis + 0.5 * s[-1] * laterals).points
    shares = _shares(half_way - 0.5 * (axis + far))
    aside = [*(s[-1] * shares), s[-1] + ramp]
    level = [1.0] * len(shares) + [0.0]
    there = [base.query(axis + away * laterals) for away in aside]  # where the base ends, the terrace does
    rows = [(near.points, near.normals) for near in there]
    tops = [
        points + (share * terrace.height * up)[:, None] * outward
        for (points, outward), share in zip(rows, level, strict=True)
    ]
    return joined([_strips([rows[0][0], tops[0]]), _strips(tops)])


def draped(points: FloatArray, base: NearestPoint) -> tuple[FloatArray, FloatArray]:
    """(points, normals) of the base nearest to points (N, 3), m; beside an open base the points stay where they are."""
    near = base.query(points)
    beside = near.distance > 1e-9 * base.surface.size
    off = points - near.points
    lateral = np.abs(np.einsum("ij,ij->i", off, near.normals)) < 0.5 * near.distance
    keep = (beside & lateral)[:, None]
    return np.where(keep, points, near.points), near.normals


def joined(meshes: list[Mesh]) -> Mesh:
    """One mesh of several."""
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + first for (_, faces), first in zip(meshes, firsts, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def _hollow(rows: list[tuple[FloatArray, FloatArray]], depth: float, sides: tuple[bool, bool]) -> Mesh:
    """Floor below rows of draped points, with walls at the first and the last row."""
    floor = [points - depth * normals for points, normals in rows]
    meshes = [_strips(floor)]
    if sides[0]:
        meshes.append(_strips([rows[0][0], floor[0]]))
    if sides[1]:
        meshes.append(_strips([floor[-1], rows[-1][0]]))
    return joined(meshes)


def _strips(rows: list[FloatArray]) -> Mesh:
    """Triangles between rows of as many points each."""
    count, corner = len(rows[0]), np.arange(len(rows[0]) - 1)
    faces = []
    for row in range(len(rows) - 1):
        here, there = row * count + corner, (row + 1) * count + corner
        faces += [np.column_stack([here, here + 1, there + 1]), np.column_stack([here, there + 1, there])]
    return np.concatenate(rows), np.concatenate(faces)


def _chords(radius: float) -> int:
    """Chords of a full circle that miss it by CHORD_ERROR to either side at most; an even number."""
    return 2 * max(8, int(np.ceil(np.pi / np.arccos(max(1.0 - 2.0 * CHORD_ERROR / radius, 0.9)) / 2.0)))


def _even(radius: float, chords: int) -> float:
    """Radius of the corners of a polygon that is outside of a circle by as much as it is inside."""
    return float(radius * 2.0 / (1.0 + np.cos(np.pi / chords)))


def _shares(sag: FloatArray) -> FloatArray:
    """Even places from 0 to 1 between which a floor that sags so far (..., 3) in all is flat to CHORD_ERROR."""
    most = float(np.linalg.norm(np.atleast_2d(sag), axis=1).max())
    return np.linspace(0.0, 1.0, min(MOST_FLOOR_ROWS, 2 + int(np.sqrt(most / CHORD_ERROR))))


def _plane(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors at right angles to a normal and to each other."""
    wish = np.eye(3)[int(np.abs(normal).argmin())]
    first = wish - (wish @ normal) * normal
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


def _laterals(axis: FloatArray, normals: FloatArray) -> FloatArray:
    """(K, 3) unit vectors across an axis: normal x tangent."""
    laterals = np.cross(normals, directions(axis))
    return np.asarray(laterals / np.linalg.norm(laterals, axis=1, keepdims=True))


def _mitres(axis: FloatArray, closed: bool) -> FloatArray:
    """(K,) by how much an offset grows at each corner of an axis."""
    legs = np.diff(axis, axis=0)
    legs /= np.linalg.norm(legs, axis=1, keepdims=True)
    before, after = (
        np.vstack([legs[-1:] if closed else legs[:1], legs]),
        np.vstack([legs, legs[:1] if closed else legs[-1:]]),
    )
    cosine = np.sqrt(np.clip(0.5 * (1.0 + np.einsum("ij,ij->i", before, after)), LONGEST_MITRE**-2, 1.0))
    return np.asarray(1.0 / cosine)


def followed(axis: FloatArray, normals: FloatArray, base: NearestPoint) -> tuple[FloatArray, FloatArray]:
    """The axis and its normals, the legs halved until their middles lie on the base; a point stays one."""
    if len(axis) == 1:
        return axis, normals
    keep = np.append(True, np.linalg.norm(np.diff(axis, axis=0), axis=1) > 0.0)
    axis, normals = axis[keep], normals[keep]
    for _ in range(MOST_HALVINGS):
        middles = 0.5 * (axis[1:] + axis[:-1])
        there, outward = draped(middles, base)
        bent = np.linalg.norm(there - middles, axis=1) > CHORD_ERROR
        if not bent.any():
            break
        place = np.flatnonzero(bent) + 1
        axis, normals = np.insert(axis, place, there[bent], axis=0), np.insert(normals, place, outward[bent], axis=0)
    return axis, normals
