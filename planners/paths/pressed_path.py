"""A path on the base becomes a sweep: the ball's centre a tip radius off it, pressed a little inwards."""

from __future__ import annotations

import numpy as np

from hw import Move
from mapping import FloatArray, Surface
from planners.paths.isolines import Isoline

# Commanded depth below contact, in tip radii: enough to keep contact over a shallow groove
PRESS = 0.02
CREASE_ANGLE = float(np.radians(30.0))


def pressed_sweep(points: FloatArray, normals: FloatArray, tip_radius: float, speed: float, force: float) -> Move:
    """The sweep whose ball touches the base at `points` (K, 3) with outward `normals` (K, 3), m."""
    centers = points + (1.0 - PRESS) * tip_radius * normals
    return Move(centers, -normals, speed=speed, force=force, purpose="sweep")


def touched_points(line: Isoline, surface: Surface) -> tuple[FloatArray, FloatArray]:
    """Points and normals (M, 3) along an isoline; at a crease the point comes twice, once per face's normal.

    On smooth stretches the normal at a mesh edge is the mean of its two faces'.
    """
    normals = surface.face_normals[line.faces]
    before = np.concatenate([normals[-1:] if line.closed else normals[:1], normals])
    after = np.concatenate([normals, normals[:1] if line.closed else normals[-1:]])
    sharp = (before * after).sum(axis=1) < np.cos(CREASE_ANGLE)
    mean = before + after
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    mean = np.divide(mean, length, out=before.copy(), where=length > 0.1)
    repeat = np.where(sharp, 2, 1)
    index = np.repeat(np.arange(len(line.points)), repeat)
    out = mean[index]
    out[np.cumsum(repeat)[sharp] - 2] = before[sharp]
    out[np.cumsum(repeat)[sharp] - 1] = after[sharp]
    return line.points[index], out


def thinned(points: FloatArray, normals: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """The waypoints without those closer than `spacing` to their predecessor, ends and creases kept."""
    if len(points) <= 2:
        return points, normals
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    cell = np.floor(along / spacing)
    keep = np.concatenate([[True], cell[1:] != cell[:-1]])
    turn = (normals[1:] * normals[:-1]).sum(axis=1) < np.cos(CREASE_ANGLE)
    keep[1:] |= turn
    keep[:-1] |= turn
    keep[-1] = True
    return points[keep], normals[keep]
