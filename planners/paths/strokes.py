"""Strokes: short sweeps of a stated length on the base, of which the exploratory procedures are made."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from hw import Move
from mapping import BoolArray, FloatArray, Trace
from mapping.base import Base
from planners.paths.pressed_path import pressed_sweep


@dataclass(frozen=True, eq=False)
class Walk:
    """A walk on the base: `points`, `normals`, `directions` (K, 3), and `along` (K,) the distance walked, m.

    `cut` is True if the base ended before the wanted length.
    """

    points: FloatArray
    normals: FloatArray
    directions: FloatArray
    along: FloatArray
    cut: bool

    def until(self, length: float) -> Walk:
        """The part of the walk up to a distance."""
        keep = self.along <= length * (1 + 1e-9)
        cut = self.cut and bool(keep.all())
        return Walk(self.points[keep], self.normals[keep], self.directions[keep], self.along[keep], cut)


@dataclass(frozen=True, eq=False)
class Strokes:
    """Makes sweeps on one base with one fingertip.

    Args:
        base: the global model.
        tip_radius: m.
        speed, force: of all sweeps, m/s and N.
    """

    base: Base
    tip_radius: float
    speed: float = 0.03
    force: float = 1.0

    def onto(self, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Nearest point of the base (3,) and its outward normal (3,)."""
        near = self.base.nearest.query(np.atleast_2d(point))
        return near.points[0], near.normals[0]

    def walk(self, point: FloatArray, direction: FloatArray, length: float, turn: float = 0.0) -> Walk:
        """Walk over the base from a point on it, straight ahead or along a curve.

        Args:
            point: (3,) start, m.
            direction: (3,) initial direction.
            length: distance to walk, m, not negative.
            turn: geodesic curvature of the path, 1/m, positive to the left seen from outside.
        """
        return self.walks(np.atleast_2d(point), np.atleast_2d(direction), length, turn)[0]

    def walks(self, points: FloatArray, directions: FloatArray, length: float, turn: float = 0.0) -> list[Walk]:
        """Walks from several points (M, 3) at once, each in its own direction (M, 3).

        Steps in the tangent plane, each brought back to the surface; the direction is carried from one
        tangent plane to the next without turning, so the walks also pass over edges of the mesh.
        """
        count = max(1, int(np.ceil(length / (0.08 * self.tip_radius))))
        step = length / count
        near = self.base.nearest.query(points)
        track = [(near.points, near.normals, tangential(directions, near.normals))]
        going = [np.ones(len(points), dtype=bool)]
        for _ in range(count):
            here, normal, ahead = track[-1]
            near = self.base.nearest.query(here + step * ahead)
            onward = tangential(carried(ahead, normal, near.normals), near.normals)
            if turn:
                onward = turned(onward, near.normals, turn * step)
            stuck = np.linalg.norm(near.points - here, axis=1) < 0.3 * step
            stuck &= (normal * near.normals).sum(axis=1) > 0.999
            going.append(going[-1] & ~stuck)
            track.append((near.points, near.normals, onward))
        stacked = [np.stack(parts, axis=1) for parts in zip(*track, strict=True)]
        where, normals, ways = stacked
        return [_walked(where[m], normals[m], ways[m], np.stack(going)[:, m]) for m in range(len(points))]

    def line(self, point: FloatArray, direction: FloatArray, before: float, after: float) -> Move:
        """The sweep through a point along a direction, from `before` metres short of it to `after` beyond."""
        here, normal = self.onto(point)
        ahead = tangential(direction, normal)
        longest = max(before, after)
        back, forth = self.walks(np.stack([here, here]), np.stack([-ahead, ahead]), longest)
        back, forth = back.until(before), forth.until(after)
        points = np.concatenate([back.points[:0:-1], forth.points])
        normals = np.concatenate([back.normals[:0:-1], forth.normals])
        return self.over(points, normals)

    def over(self, points: FloatArray, normals: FloatArray) -> Move:
        """The sweep that touches the base at the points (K, 3)."""
        return pressed_sweep(points, normals, self.tip_radius, self.speed, self.force)

    def circle(self, point: FloatArray, direction: FloatArray, radius: float, overlap: float) -> Move:
        """The circuit of geodesic radius `radius` around a point, begun in a direction, `overlap` m past its start."""
        here, normal = self.onto(point)
        first = tangential(direction, normal)
        count = 64
        angles = np.arange(count) * (2.0 * np.pi / count)
        ways = turned(np.tile(first, (count, 1)), np.tile(normal, (count, 1)), angles[:, None])
        rim = self.walks(np.tile(here, (count, 1)), ways, radius)
        points = np.array([walk.points[-1] for walk in rim])
        normals = np.array([walk.normals[-1] for walk in rim])
        more = int(np.ceil(overlap / (2.0 * np.pi * radius) * count)) + 1
        index = np.arange(count + more) % count
        return self.over(points[index], normals[index])


def to_and_fro(move: Move, times: int) -> Generator[Move, Trace, list[Trace]]:
    """Make a sweep so many times, every second time backwards; what each felt, if it felt anything."""
    back = replace(move, path=move.path[::-1], approach=move.approach[::-1])
    felt = []
    for number in range(times):
        trace = yield move if number % 2 == 0 else back
        if len(trace):
            felt.append(trace)
    return felt


def _walked(points: FloatArray, normals: FloatArray, directions: FloatArray, going: BoolArray) -> Walk:
    count = int(going.sum())
    points = points[:count]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return Walk(points, normals[:count], directions[:count], along, count < len(going))


def tangential(direction: FloatArray, normal: FloatArray) -> FloatArray:
    """Unit part of directions (..., 3) in the plane of unit normals; any tangent where nothing is left."""
    flat = direction - (direction * normal).sum(axis=-1, keepdims=True) * normal
    helper = np.eye(3)[np.abs(normal).argmin(axis=-1)]
    helper = helper - (helper * normal).sum(axis=-1, keepdims=True) * normal
    length = np.linalg.norm(flat, axis=-1, keepdims=True)
    flat = np.where(length > 1e-9 * np.linalg.norm(direction, axis=-1, keepdims=True), flat, helper)
    return np.asarray(flat / np.linalg.norm(flat, axis=-1, keepdims=True))


def carried(direction: FloatArray, old: FloatArray, new: FloatArray) -> FloatArray:
    """Directions (..., 3) rotated by the smallest rotation that takes one unit normal to the other."""
    axis = _cross(old, new)
    cosine = (old * new).sum(axis=-1, keepdims=True)
    once = _cross(axis, direction)
    rotated = direction + once + _cross(axis, once) / np.maximum(1.0 + cosine, 1e-3)
    return np.asarray(np.where(cosine < -0.999, direction, rotated))


def turned(direction: FloatArray, normal: FloatArray, angle: ArrayLike) -> FloatArray:
    """Tangent directions (..., 3) turned about the normals by an angle, rad."""
    return np.asarray(np.cos(angle) * direction + np.sin(angle) * _cross(normal, direction))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Vector products of (..., 3) of one shape: numpy's own, at a third of the time that it takes for a single one."""
    out = np.empty_like(a)
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        out[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return out
