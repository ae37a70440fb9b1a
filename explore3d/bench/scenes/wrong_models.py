"""Bodies whose global model is wrong: the finger touches one that was moved, scaled, bent, dented, or lacks a part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from explore3d.analysis import TrueFeature
from explore3d.bench.scenes.bodies import Mesh, blob, blob_normals, joined, sphere_mesh, tube
from explore3d.bench.scenes.exploring import UP, WIRE, BenchScene
from mapping import FloatArray, Surface

# What may be wrong, by the name of the cause that a run must give for it (mapping.estimate.deviation)
WRONGS = ("nothing", "pose", "scale", "deformation", "dent", "missing part", "placed off")
# And of the object that is placed off its model, which the scene says and the finger finds out, m and degrees
PLACED_SHIFT, PLACED_TURN = 3e-3, 2.0
# How wrong: the object stands off by so much (m, degrees), is so much larger or smaller, is bent and dented by so much
OFF_SHIFT, OFF_TURN, OFF_SCALE, BENT, DENTED = 0.3e-3, 0.5, 0.01, 0.5e-3, 2e-3
# Radius of the dent, m, and size of the knob that only the model has
DENT_RADIUS, KNOB_RADIUS, KNOB_HEIGHT = 0.018, 0.012, 0.01
# Spacing of the meshes' vertices, m
FINE = 2e-3


@dataclass(frozen=True, eq=False)
class Body:
    """A body that a wire lies on.

    Args:
        mesh: without the wire.
        axis, up: (K, 3) course of the wire on it, m, and outward normals there.
        place, normal: (3,) a place far from the wire, m, and the outward normal there.
    """

    mesh: Mesh
    axis: FloatArray
    up: FloatArray
    place: FloatArray
    normal: FloatArray


def sheet(height: Callable[[FloatArray, FloatArray], FloatArray], rng: np.random.Generator) -> Body:
    """A sheet of 110 x 90 mm over the plane."""
    x, y = (np.linspace(-half, half, round(2 * half / FINE) + 1) for half in (0.055, 0.045))
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1), indexing="ij"))
    a = i * len(y) + j
    b = a + len(y)
    faces = np.concatenate([np.column_stack([a, b, b + 1]), np.column_stack([a, b + 1, a + 1])])
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)

    def lifted(places: FloatArray) -> tuple[FloatArray, FloatArray]:
        h = 1e-6
        z = height(*places.T)
        slope = [(height(*(places + h * e).T) - height(*(places - h * e).T)) / (2.0 * h) for e in np.eye(2)]
        normals = np.column_stack([-slope[0], -slope[1], np.ones(len(places))])
        return np.column_stack([places, z]), normals / np.linalg.norm(normals, axis=1, keepdims=True)

    angle = rng.uniform(-0.5, 0.5)
    way = np.array([np.cos(angle), np.sin(angle)])
    side = np.array([-way[1], way[0]])
    middle = np.array([rng.uniform(-0.005, 0.005), -0.018])
    axis, up = lifted(middle + np.linspace(-0.02, 0.02, 121)[:, None] * way)
    place, normal = lifted((middle + 0.036 * side)[None])
    return Body((lifted(grid)[0], faces), axis, up, place[0], normal[0])


def saddle(rng: np.random.Generator) -> Body:
    """A saddle with radii of 120 and 150 mm."""
    return sheet(lambda x, y: 0.5 * (x**2 / 0.12 - y**2 / 0.15), rng)


def plate(rng: np.random.Generator) -> Body:
    """A plane."""
    return sheet(lambda x, y: 0.0 * x, rng)


def wave(rng: np.random.Generator) -> Body:
    """A cushion with a trough beside it."""
    return sheet(lambda x, y: 0.006 * np.sin(45.0 * x + 0.4) * np.cos(30.0 * y), rng)


def round_body(radius: Callable[[FloatArray], FloatArray], rng: np.random.Generator) -> Body:
    """A tube about the z axis of 90 mm, its radius (m) a function of z."""
    z = np.linspace(-0.045, 0.045, 46)
    sides = 240
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring, i = (grid.ravel() for grid in np.meshgrid(np.arange(len(z) - 1), np.arange(sides), indexing="ij"))
    a, b = ring * sides + i, ring * sides + (i + 1) % sides
    faces = np.concatenate([np.column_stack([a, b, b + sides]), np.column_stack([a, b + sides, a + sides])])

    def at(turn: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        out = np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
        slope = (radius(height + 1e-6) - radius(height - 1e-6)) / 2e-6
        normal = out - slope[:, None] * UP
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        return radius(height)[:, None] * out + height[:, None] * UP, normal

    whole = at(np.tile(angle, len(z)), np.repeat(z, sides))[0]
    begin, rise = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.015, 0.015)
    axis, up = at(begin + np.linspace(-0.8, 0.8, 121), np.linspace(-rise, rise, 121))
    place, normal = at(np.array([begin + np.pi]), np.array([rng.uniform(-0.01, 0.01)]))
    return Body((whole, faces), axis, up, place[0], normal[0])


def cylinder(rng: np.random.Generator) -> Body:
    """A cylinder of 50 mm."""
    return round_body(lambda z: np.full(len(z), 0.025), rng)


def vase(rng: np.random.Generator) -> Body:
    """A mug's wall that swells."""
    return round_body(lambda z: 0.028 + 0.004 * np.cos(50.0 * z), rng)


def closed(shape: Callable[[FloatArray], FloatArray], normals: Callable[[FloatArray], FloatArray],
           rng: np.random.Generator) -> Body:  # fmt: skip
    """A body that every direction from its middle meets once."""
    unit, faces = sphere_mesh(6)
    ways = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn = np.linspace(-0.5, 0.5, 161)[:, None]
    course = np.cos(turn) * ways[0] + np.sin(turn) * ways[1]
    far = -ways[0][None]
    return Body((shape(unit), faces), shape(course), normals(course), shape(far)[0], normals(far)[0])


def sphere(rng: np.random.Generator) -> Body:
    """A ball of 70 mm."""
    return closed(lambda way: 0.035 * _unit(way), _unit, rng)


def free_form(rng: np.random.Generator) -> Body:
    """The bench's free form."""
    return closed(blob, blob_normals, rng)


def _unit(ways: FloatArray) -> FloatArray:
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))


# What the comparison was built with, and what is reported of it
BUILT_WITH: dict[str, Callable[[np.random.Generator], Body]] = {
    "saddle": saddle,
    "cylinder": cylinder,
    "sphere": sphere,
}
REPORTED: dict[str, Callable[[np.random.Generator], Body]] = {
    "plate": plate,
    "wave": wave,
    "vase": vase,
    "free form": free_form,
}
WRONG_BODIES = BUILT_WITH | REPORTED


def wrong_model(body: str, wrong: str, seed: int) -> BenchScene:
    """The scene of a body whose model is wrong in one way; the same seed gives the same body for every wrong."""
    made = WRONG_BODIES[body](np.random.default_rng((seed, list(WRONG_BODIES).index(body))))
    rng = np.random.default_rng((seed, WRONGS.index(wrong), 7))
    wire = tube(made.axis + 0.5 * WIRE * made.up, made.up, 0.5 * WIRE)
    model, object = Surface(*made.mesh), joined(made.mesh, wire)
    if wrong == "missing part":
        model = joined(made.mesh, _knob(made))
    moved = _motion(wrong, made, rng)
    truth = TrueFeature("ridge", moved(made.axis), WIRE, WIRE)
    object = Surface(moved(object.vertices), object.faces)
    return BenchScene(model, object, (truth,), misplaced=wrong == "placed off")


def _knob(body: Body) -> Mesh:
    """A stud that stands on the far place."""
    across = np.cross(body.normal, np.eye(3)[np.abs(body.normal).argmin()])
    axis = body.place + np.linspace(0.0, KNOB_HEIGHT, 21)[:, None] * body.normal
    return tube(axis, np.tile(_unit(across[None])[0], (len(axis), 1)), KNOB_RADIUS, sides=48, rings=12)


def _motion(wrong: str, body: Body, rng: np.random.Generator) -> Callable[[FloatArray], FloatArray]:
    """What the object does to places (N, 3) of its model, m."""
    from scipy.spatial.transform import Rotation

    middle, size = body.mesh[0].mean(axis=0), float(np.ptp(body.mesh[0], axis=0).max())
    if wrong in ("pose", "placed off"):
        shift, axis = (_unit(rng.standard_normal((1, 3)))[0] for _ in range(2))
        far, angle = (OFF_SHIFT, OFF_TURN) if wrong == "pose" else (PLACED_SHIFT, PLACED_TURN)
        turn = Rotation.from_rotvec(np.radians(angle) * axis).as_matrix()
        return lambda points: (points - middle) @ turn.T + middle + far * shift
    if wrong == "scale":
        factor = 1.0 + OFF_SCALE * rng.choice([-1.0, 1.0])
        return lambda points: middle + factor * (points - middle)
    if wrong == "deformation":
        waves = 2.0 * np.pi / size * _unit(rng.standard_normal((3, 3))) * rng.uniform(0.8, 1.4, 3)[:, None]
        phases = rng.uniform(0.0, 2.0 * np.pi, 3)
        ways = _unit(rng.standard_normal((3, 3)))

        def bend(points: FloatArray) -> FloatArray:
            return np.asarray(np.sin((points - middle) @ waves.T + phases) @ ways)

        largest = np.linalg.norm(bend(body.mesh[0]), axis=1).max()
        return lambda points: points + BENT / largest * bend(points)
    if wrong == "dent":

        def dent(points: FloatArray) -> FloatArray:
            share = np.clip(np.linalg.norm(points - body.place, axis=1) / DENT_RADIUS, 0.0, 1.0)
            return np.asarray(points - DENTED * 0.5 * (1.0 + np.cos(np.pi * share))[:, None] * body.normal)

        return dent
    return lambda points: points
