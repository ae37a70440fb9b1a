"""Bodies for the classification bench: one small object for each kind of feature, on the bench's plate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from explore3d.analysis import TrueFeature
from explore3d.bench.scenes.bodies import Mesh, folded, joined, plate
from explore3d.bench.scenes.exploring import PLATE_LENGTH, PLATE_WIDTH, UP, WIRE, BenchScene, wires
from mapping import FloatArray, Surface

MIDDLE = np.zeros(3)
# Half of the side of the square that the sweeps inspect, m.
INSPECTED_HALF_SIDE = 0.022
HOLLOW_DEPTH = 1.5e-3


def bump() -> BenchScene:
    """A ball of the wire's size on the plate."""
    ball = sphere(MIDDLE + 0.5 * WIRE * UP, 0.5 * WIRE)
    return BenchScene(
        Surface(*plate(PLATE_LENGTH, PLATE_WIDTH)),
        joined(plate(PLATE_LENGTH, PLATE_WIDTH), ball),
        (TrueFeature("bump", MIDDLE, WIRE, WIRE),),
    )


def pit(width: float = 7e-3, sides: int = 96) -> BenchScene:
    """A round hole with a sharp rim that the tip cannot enter."""
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    rings = [
        0.2 * circle,
        0.5 * width * circle,
        0.5 * width * circle - [0, 0, HOLLOW_DEPTH],
        1e-6 * circle - [0, 0, HOLLOW_DEPTH],
    ]
    dip = -((0.5 * width) ** 2) / (0.01 + np.sqrt(0.01**2 - (0.5 * width) ** 2))
    hole = shell(np.stack(rings) + MIDDLE)
    return BenchScene(
        Surface(*plate(PLATE_LENGTH, PLATE_WIDTH)), joined(hole), (TrueFeature("pit", MIDDLE, dip, width),)
    )


def groove(width: float = 4e-3, length: float = 0.026, heading: float = 0.3) -> BenchScene:
    """A slot with sharp rims and square ends."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    outer = np.column_stack([0.2 * corners, np.zeros(4)])
    rim = np.column_stack([0.5 * corners * [length, width], np.zeros(4)])
    rings = np.stack([outer, rim, rim - [0, 0, HOLLOW_DEPTH], 1e-3 * rim - [0, 0, HOLLOW_DEPTH]])
    along = np.array([np.cos(heading), np.sin(heading), 0.0])
    turn = np.array([along, [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
    dip = -((0.5 * width) ** 2) / (0.01 + np.sqrt(0.01**2 - (0.5 * width) ** 2))
    axis = MIDDLE + 0.5 * length * np.array([[-1.0], [1.0]]) * along
    slot = shell(rings @ turn + MIDDLE)
    return BenchScene(
        Surface(*plate(PLATE_LENGTH, PLATE_WIDTH)), joined(slot), (TrueFeature("groove", axis, dip, width),)
    )


def step(height: float = 0.5e-3, heading: float = 1.3) -> BenchScene:
    """A half of the plate that stands higher, bounded by a straight edge."""
    along = np.array([np.cos(heading), np.sin(heading), 0.0])
    side = np.array([along[1], -along[0], 0.0])
    corner = np.array([-0.1, 0.1, 0.1, -0.1])[:, None] * along + np.array([0.0, 0.0, 0.1, 0.1])[:, None] * side
    high = MIDDLE + corner + [0.0, 0.0, height]
    wall = np.concatenate([high[[1, 0]], high[[0, 1]] - [0.0, 0.0, height]])
    quad = np.array([[0, 2, 1], [0, 3, 2]])
    axis = MIDDLE + INSPECTED_HALF_SIDE * np.array([[-1.0], [1.0]]) * along
    body = joined(plate(PLATE_LENGTH, PLATE_WIDTH), (high, quad[:, ::-1]), (wall, quad))
    return BenchScene(Surface(*plate(PLATE_LENGTH, PLATE_WIDTH)), body, (TrueFeature("step", axis, height),))


def fold(angle: float) -> BenchScene:
    """A plate bent about a line, where the model knows only its unbent half, continued."""
    points, faces = plate(PLATE_LENGTH, PLATE_WIDTH)
    axis = MIDDLE + INSPECTED_HALF_SIDE * np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    kind = "convex edge" if angle > 0 else "concave corner"
    truth = (TrueFeature(kind, axis, -np.sign(angle) * 1e-3),)
    return BenchScene(Surface(*plate(PLATE_LENGTH, PLATE_WIDTH)), Surface(folded(points, angle), faces), truth)


def star(*angles: float, reach: float = 0.018) -> list[FloatArray]:
    """Straight axes from the plate's middle outwards."""
    share = np.linspace(0.0, reach, 40)[:, None]
    return [MIDDLE + share * [np.cos(a), np.sin(a), 0.0] for a in angles]


def through(angle: float, reach: float = 0.018) -> FloatArray:
    """A straight axis through the plate's middle."""
    return np.asarray(MIDDLE + np.linspace(-reach, reach, 60)[:, None] * [np.cos(angle), np.sin(angle), 0.0])


def arc(radius: float, begin: float, end: float) -> FloatArray:
    """A circle about the plate's middle, or a part of it."""
    angle = np.linspace(begin, end, 121)
    return np.asarray(MIDDLE + radius * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle]))


def sphere(center: FloatArray, radius: float, rings: int = 24, sides: int = 32) -> Mesh:
    """A ball."""
    polar = np.pi * (np.arange(rings) + 0.02) / (rings - 0.96)
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    stack = [np.sin(p) * circle + [0.0, 0.0, -np.cos(p)] for p in polar]
    vertices, faces = shell(center + radius * np.stack(stack))
    return vertices, faces


def shell(rings: FloatArray) -> Mesh:
    """Quads between closed rings (M, K, 3) of equally many points."""
    count, sides = rings.shape[:2]
    ring, i = (grid.ravel() for grid in np.meshgrid(np.arange(count - 1), np.arange(sides), indexing="ij"))
    a, b = ring * sides + i, ring * sides + (i + 1) % sides
    faces = np.concatenate([np.column_stack([a, b, b + sides]), np.column_stack([a, b + sides, a + sides])])
    return rings.reshape(-1, 3), faces


BODIES_BY_KIND: dict[str, Callable[[], BenchScene]] = {
    "bump": bump,
    "ridge": lambda: wires(through(0.4, 0.015)),
    "groove": groove,
    "pit": pit,
    "step": step,
    "junction Y": lambda: wires(*star(0.1, 2.2, 4.3)),
    "junction T": lambda: wires(through(0.5), *star(0.5 + 1.4)),
    "O-ring": lambda: wires(arc(0.012, 0.0, 2.0 * np.pi)),
    "crossing": lambda: wires(through(0.4), through(1.5)),
    "curved ridge": lambda: wires(arc(0.014, 0.2, 2.9)),
    "fine groove": lambda: groove(width=2e-3, length=0.03),
    "convex edge": lambda: fold(float(np.radians(20.0))),
    "concave corner": lambda: fold(-float(np.radians(20.0))),
    "empty": lambda: wires(),
}
