"""Bodies for the exploration bench: a plate, and on it wires of known axes or balls of known centres."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from explore3d.truth import TrueFeature
from mapping.surface import Surface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Mesh = tuple[FloatArray, IntArray]

WIRE = 0.65e-3
LONG, SHORT = 0.1, 0.08


@dataclass(frozen=True, eq=False)
class BenchScene:
    """A body to explore: its global model, what the finger really touches, and the features on it."""

    base: Surface
    object: Surface
    truth: tuple[TrueFeature, ...]


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
    ring, i = (grid.ravel() for grid in np.meshgrid(np.arange(len(stack) - 1), np.arange(sides), indexing="ij"))
    a, b = ring * sides + i, ring * sides + (i + 1) % sides
    faces = np.concatenate([np.column_stack([a, b, b + sides]), np.column_stack([a, b + sides, a + sides])])
    return np.concatenate(stack), faces


def joined(*meshes: Mesh) -> Surface:
    """One surface of several meshes, side by side."""
    vertices, faces, count = [], [], 0
    for points, triangles in meshes:
        vertices.append(points)
        faces.append(triangles + count)
        count += len(points)
    return Surface(np.concatenate(vertices), np.concatenate(faces))


def plate() -> Mesh:
    """A rectangle in the plane z = 0."""
    corners = np.array([[0, 0, 0], [LONG, 0, 0], [LONG, SHORT, 0], [0, SHORT, 0]], dtype=np.float64)
    return corners, np.array([[0, 1, 2], [0, 2, 3]])


def folded(points: FloatArray, angle: float) -> FloatArray:
    """Points bent down about the line x = LONG / 2, z = 0."""
    x, z = points[:, 0] - 0.5 * LONG, points[:, 2]
    bent = points.copy()
    bent[:, 0] = 0.5 * LONG + np.where(x > 0, x * np.cos(angle) + z * np.sin(angle), x)
    bent[:, 2] = np.where(x > 0, z * np.cos(angle) - x * np.sin(angle), z)
    return bent


def wires(*axes: FloatArray, bend: float = 0.0) -> BenchScene:
    """Wires that lie on a plate, which may be folded under them."""
    base, faces = plate()
    if bend:
        half = np.array([[0.5 * LONG, 0, 0], [0.5 * LONG, SHORT, 0]])
        base = np.concatenate([base, half])
        faces = np.array([[0, 4, 5], [0, 5, 3], [4, 1, 2], [4, 2, 5]])
    up = np.array([0.0, 0.0, 1.0])
    parts = [tube(axis + 0.5 * WIRE * up, np.tile(up, (len(axis), 1)), 0.5 * WIRE) for axis in axes]
    meshes = [(folded(points, bend), triangles) for points, triangles in [(base, faces), *parts]]
    truth = tuple(TrueFeature("ridge", folded(axis, bend), WIRE, WIRE) for axis in axes)
    return BenchScene(Surface(*meshes[0]), joined(*meshes), truth)


def line(start: tuple[float, float], stop: tuple[float, float], count: int = 60) -> FloatArray:
    """(count, 3) points of a straight axis on the plate, m."""
    return np.linspace([*start, 0.0], [*stop, 0.0], count)


def arc(radius: float, begin: float, end: float, count: int = 121) -> FloatArray:
    """(count, 3) points of a circle about the plate's middle, m."""
    angle = np.linspace(begin, end, count)
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    return np.asarray(np.array([0.5 * LONG, 0.5 * SHORT, 0.0]) + radius * circle)


def junction() -> BenchScene:
    """Three arms that meet in the middle of the plate."""
    middle = np.array([0.5 * LONG, 0.5 * SHORT])
    tips = [middle + 0.028 * np.array([np.cos(a), np.sin(a)]) for a in (0.1, 2.2, 4.3)]
    return wires(*(line((middle[0], middle[1]), (tip[0], tip[1])) for tip in tips))


SCENES: dict[str, Callable[[], BenchScene]] = {
    "straight": lambda: wires(line((0.02, 0.03), (0.078, 0.052))),
    "curved": lambda: wires(arc(0.015, 0.2, 2.9)),
    "o-ring": lambda: wires(arc(0.018, 0.0, 2.0 * np.pi)),
    "junction": junction,
    "two": lambda: wires(line((0.02, 0.036), (0.08, 0.036)), line((0.02, 0.044), (0.08, 0.044))),
    "edge": lambda: wires(line((0.02, 0.03), (0.085, 0.055), 400), bend=float(np.radians(40.0))),
    "empty": lambda: wires(),
}
