"""Scenes of the exploration bench: a global model, what the finger really touches, and the features that differ.

Each is an ordinary scene: a text as a file holds it, and two meshes that the text names, in memory or written out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from explore3d.analysis import TrueFeature
from explore3d.bench.scenes.bodies import (
    Mesh,
    blob,
    blob_normals,
    cylinder,
    folded,
    joined,
    plate,
    slotted_plate,
    sphere_mesh,
    tube,
)
from explore3d.scene import Scene, parse_scene, scene_text
from mapping import FloatArray, Surface
from mapping.geometry.mesh import write_whole
from planners.explore import APPROACH_SIDES

WIRE = 0.65e-3
UP = np.array([0.0, 0.0, 1.0])
PLATE_LENGTH, PLATE_WIDTH = 0.1, 0.08
# The span that no ridge on these bodies falls short of, m
SHORTEST_RIDGE_SPAN = 0.025
# The box that an unknown body is looked for in is so much larger, m
BOX_MARGIN = 0.004
# Of the bench's fingertip, m: the paper's
BENCH_TIP_RADIUS = 0.01
# Names of the meshes that a bench scene's text gives
BASE_MESH, OBJECT_MESH = "base.obj", "object.obj"
# Finger time that a bench run may take: longer than any of them needs
BENCH_TIME_BUDGET = "1 h"


@dataclass(frozen=True, eq=False)
class BenchScene:
    """A body to explore.

    Args:
        base: the global model.
        object: what the finger touches.
        truth: the features by which they differ.
        shortest_ridge: the survey's setting, m; None where there may be bumps.
        smallest: height of the smallest feature that the survey must find, m.
        misplaced: the object stands off the global model, and the finger must find out how.
        sides: from which to feel it without a model, as planners.explore.discover has them; none: the model is known.
        region: (2, 3) low and high corners, m, of the box that it is looked for in then.
    """

    base: Surface
    object: Surface
    truth: tuple[TrueFeature, ...]
    shortest_ridge: float | None = SHORTEST_RIDGE_SPAN
    smallest: float = 0.3e-3
    misplaced: bool = False
    sides: tuple[str, ...] = ()
    region: FloatArray = field(default_factory=lambda: np.zeros((2, 3)))

    def text(self, seed: int, finger: Mapping[str, float], precision: float, speed: float | None = None) -> str:
        """The scene file's text.

        Args:
            seed: of the finger's noise and the chains.
            finger: its `rate` (Hz), and its noise as [finger.noise] has it, m.
            precision: wanted half-width of the 90 % interval of an end, m.
            speed: of the sweeps, m/s; None: as fast as noise and finger allow.
        """
        model: dict[str, Any] = {"mesh": BASE_MESH}
        if self.sides:
            low, high = self.region.tolist()
            model = {"sides": list(self.sides), "region": {"low": low, "high": high}}
        elif self.misplaced:
            model |= {"pose": "estimate"}
        survey = {"smallest_feature": self.smallest}
        if speed is not None:
            survey |= {"speed": speed}
        if self.shortest_ridge is not None:
            survey |= {"shortest_ridge": self.shortest_ridge}
        noise = {name: level for name, level in finger.items() if name != "rate"}
        tables = {
            "schema": "explore3d/scene/1",
            "seed": seed,
            "tip": {"radius": BENCH_TIP_RADIUS},
            "model": model,
            "finger": {"object": OBJECT_MESH, "rate": finger["rate"], "noise": noise},
            "survey": survey,
            "explore": {"precision": precision, "time_budget": BENCH_TIME_BUDGET},
            "truth": [
                {"kind": true.kind, "axis": true.axis.tolist(), "height": true.height}
                | ({} if true.width is None else {"width": true.width})
                for true in self.truth
            ],
        }
        return scene_text(tables)

    def scene(self, text: str) -> Scene:
        """The scene of such a text, whose meshes stay in memory."""
        return parse_scene(text, "bench.toml", {BASE_MESH: self.base, OBJECT_MESH: self.object})

    def write(self, text: str, folder: Path) -> Path:
        """The scene as files for `explore3d run`: scene.toml and its meshes in a folder, which is made if absent."""
        folder.mkdir(parents=True, exist_ok=True)
        for name, surface in ((BASE_MESH, self.base), (OBJECT_MESH, self.object)):
            lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in surface.vertices.tolist()]
            lines += [f"f {a} {b} {c}" for a, b, c in (surface.faces + 1).tolist()]
            write_whole(folder / name, "\n".join(lines) + "\n")
        return write_whole(folder / "scene.toml", text)


def wires(
    *axes: FloatArray,
    size: tuple[float, float] = (PLATE_LENGTH, PLATE_WIDTH),
    bend: float = 0.0,
    span: float = SHORTEST_RIDGE_SPAN,
) -> BenchScene:
    """Wires that lie on a plate, which may be folded under them."""
    parts = [tube(axis + 0.5 * WIRE * UP, np.tile(UP, (len(axis), 1)), 0.5 * WIRE) for axis in axes]
    meshes: list[Mesh] = [(folded(points, bend), faces) for points, faces in [plate(*size), *parts]]
    truth = tuple(TrueFeature("ridge", folded(axis, bend), WIRE, WIRE) for axis in axes)
    return BenchScene(Surface(*meshes[0]), joined(*meshes), truth, span)


def placed(axis: FloatArray, rng: np.random.Generator, shift: float = 0.006) -> FloatArray:
    """Points of a plate turned by any angle about its middle and shifted by at most `shift` (m)."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    c, s = np.cos(angle), np.sin(angle)
    moved = axis @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(moved + np.append(rng.uniform(-shift, shift, 2), 0.0))


def line(length: float, beside: float = 0.0, count: int = 60) -> FloatArray:
    """(count, 3) points of a straight axis through the plate's middle, or beside it, m."""
    return np.linspace([-0.5 * length, beside, 0.0], [0.5 * length, beside, 0.0], count)


def arc(radius: float, angle: float, count: int = 121) -> FloatArray:
    """(count, 3) points of a circle about the plate's middle, m."""
    turn = np.linspace(0.0, angle, count)
    circle = radius * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    return np.vstack([circle[:-1], circle[:1]]) if angle >= 2.0 * np.pi else circle


def straight(rng: np.random.Generator) -> BenchScene:
    """One wire on a plate of 200 x 150 mm."""
    return wires(placed(line(0.08), rng, 0.025), size=(0.2, 0.15), span=0.04)


def two(rng: np.random.Generator) -> BenchScene:
    """Two parallel wires 8 mm apart."""
    both = placed(np.concatenate([line(0.06, -0.004), line(0.06, 0.004)]), rng)
    return wires(both[:60], both[60:])


def junction(rng: np.random.Generator) -> BenchScene:
    """Three arms that meet."""
    angles = np.array([0.0, 2.1, 4.2]) + rng.uniform(-0.15, 0.15, 3)
    arms = [np.linspace(0.0, 0.028, 60)[:, None] * [np.cos(a), np.sin(a), 0.0] for a in angles]
    together = placed(np.concatenate(arms), rng)
    return wires(*np.split(together, 3))


def edge(rng: np.random.Generator) -> BenchScene:
    """A wire that crosses a fold of 40 degrees."""
    angle = rng.uniform(-0.6, 0.6)
    way = np.array([np.cos(angle), np.sin(angle), 0.0])
    start, stop = rng.uniform(-0.036, -0.028), rng.uniform(0.028, 0.036)
    middle = np.array([0.0, rng.uniform(-0.012, 0.012), 0.0])
    return wires(middle + np.linspace(start, stop, 400)[:, None] * way, bend=float(np.radians(40.0)))


def helix(rng: np.random.Generator) -> BenchScene:
    """A wire wound round a cylinder."""
    radius, rise = 0.02, 0.05
    angle = rng.uniform(0.0, 2.0 * np.pi) + np.linspace(0.0, 1.2 * np.pi, 240)
    outward = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    height = np.linspace(-0.5 * rise, 0.5 * rise, len(angle)) + rng.uniform(-0.006, 0.006)
    axis = radius * outward + height[:, None] * UP
    base = cylinder(radius, 0.08)
    truth = TrueFeature("ridge", axis, WIRE, WIRE)
    return BenchScene(Surface(*base), joined(base, tube(axis + 0.5 * WIRE * outward, outward, 0.5 * WIRE)), (truth,))


def groove(rng: np.random.Generator) -> BenchScene:
    """A rectangular groove, 2 mm wide and 1 mm deep: under the ball a dip of 0.05 mm."""
    width, length, depth, tip = 2e-3, 0.06, 1e-3, 0.01
    middle = rng.uniform(-0.006, 0.006, 2)
    half = 0.5 * np.array([length, width])
    turn = rng.uniform(0.0, 2.0 * np.pi)
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    vertices, faces = slotted_plate(PLATE_LENGTH, PLATE_WIDTH, middle - half, middle + half, depth)
    base, few = plate(PLATE_LENGTH, PLATE_WIDTH)
    dip = -(tip - np.sqrt(tip**2 - 0.25 * width**2))
    truth = TrueFeature("groove", (line(length) + np.append(middle, 0.0)) @ rotation, dip, width)
    scene = Surface(base @ rotation, few), Surface(vertices @ rotation, faces)
    # a sharp crest 0.68 times as high would stand out of white noise as much
    return BenchScene(*scene, (truth,), shortest_ridge=0.05, smallest=-0.68 * dip)


def free_form(rng: np.random.Generator, bumps: bool = True, subdivisions: int = 6) -> BenchScene:
    """A bunny-sized free-form body with two ridges and, if wanted, three bumps."""
    unit, faces = sphere_mesh(subdivisions)
    rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    ways = np.array([[1.0, 0.3, 0.2], [-0.6, 0.7, -0.2], [-0.2, -0.9, 0.4], [0.1, 0.2, 1.0], [0.2, -0.1, -1.0]])
    ways = ways @ rotation
    parts, truth = [(blob(unit), faces)], []
    for k, way in enumerate(ways[:2]):
        across = np.cross(way, ways[k + 2])
        turn = np.linspace(-0.4, 0.4, 160)[:, None]
        course = np.cos(turn) * way / np.linalg.norm(way) + np.sin(turn) * across / np.linalg.norm(across)
        axis, up = blob(course), blob_normals(course)
        parts.append(tube(axis + 0.5 * WIRE * up, up, 0.5 * WIRE))
        truth.append(TrueFeature("ridge", axis, WIRE, WIRE))
    ball, some = sphere_mesh(4)
    for way in ways[2:] if bumps else ():
        point = blob(way[None])
        parts.append((point + 1e-3 * ball, some))
        truth.append(TrueFeature("bump", point, 1e-3, 2e-3))
    shortest = None if bumps else SHORTEST_RIDGE_SPAN
    return BenchScene(Surface(*parts[0]), joined(*parts), tuple(truth), shortest_ridge=shortest, smallest=0.6e-3)


def misplaced(scene: BenchScene, rng: np.random.Generator) -> BenchScene:
    """The same with the object 3 mm and 2 degrees off its model, in directions of chance."""
    from scipy.spatial.transform import Rotation

    (shift, turn), middle = rng.standard_normal((2, 3)), scene.object.vertices.mean(axis=0)
    rotation = Rotation.from_rotvec(np.radians(2.0) * turn / np.linalg.norm(turn)).as_matrix()
    shift *= 3e-3 / np.linalg.norm(shift)

    def moved(points: FloatArray) -> FloatArray:
        return np.asarray((points - middle) @ rotation.T + middle + shift)

    return replace(
        scene,
        object=Surface(moved(scene.object.vertices), scene.object.faces),
        truth=tuple(TrueFeature(each.kind, moved(each.axis), each.height, each.width) for each in scene.truth),
        misplaced=True,
    )


def unknown(scene: BenchScene, sides: tuple[str, ...], inside: float = 0.0) -> BenchScene:
    """The same without a model; the box that it is looked for in stays clear of the edges by so much, m."""
    low, high = scene.object.bounds
    border = np.array([inside, inside, 0.0]) - BOX_MARGIN
    return replace(scene, sides=sides, region=np.stack([low + border, high - border]))


SCENES: dict[str, Callable[[np.random.Generator], BenchScene]] = {
    "straight": straight,
    "curved": lambda rng: wires(placed(arc(0.015, 2.7), rng)),
    "helix": helix,
    "o-ring": lambda rng: wires(placed(arc(0.018, 2.0 * np.pi), rng)),
    "junction": junction,
    "two": two,
    "groove": groove,
    "edge": edge,
    "free form": free_form,
    "wrong pose": lambda rng: misplaced(free_form(rng, bumps=False), rng),
    "empty": lambda rng: wires(),
    "unknown fold": lambda rng: unknown(edge(rng), ("+z",), 0.01),
    "unknown form": lambda rng: unknown(free_form(rng, bumps=False), APPROACH_SIDES),
}
