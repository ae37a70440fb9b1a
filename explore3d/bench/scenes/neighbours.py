"""Neighbours: details so near to each other that no sweep feels one of them alone, on the classification bench's plate.

What is read out of one sweep's crossings, one by one, is wrong of these: they are one configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from explore3d.analysis import TrueFeature
from explore3d.bench.scenes.bodies import Mesh, joined, plate, tube
from explore3d.bench.scenes.exploring import PLATE_LENGTH, PLATE_WIDTH, UP, WIRE, BenchScene, wires
from explore3d.bench.scenes.kinds import BODIES_BY_KIND, MIDDLE, groove, shell, sphere, step, through
from explore3d.bench.scenes.sections import FIRST_BUILT_WITH
from mapping import FloatArray, Surface

BURR = 0.15e-3
CROSSED_STEP = 0.5e-3


def side_by_side(gap: float, reach: float = 0.015, heading: float = 0.4) -> BenchScene:
    """Two wires whose axes run beside each other at a distance, m."""
    aside = 0.5 * gap * np.array([-np.sin(heading), np.cos(heading), 0.0])
    return wires(through(heading, reach) - aside, through(heading, reach) + aside)


def burred(width: float = 4e-3, length: float = 0.026, heading: float = 0.3) -> BenchScene:
    """The groove, with a burr along both of its long rims."""
    plain = groove(width, length, heading)
    along = np.array([np.cos(heading), np.sin(heading), 0.0])
    aside = 0.5 * (width + BURR) * np.array([-along[1], along[0], 0.0])
    axes = [np.linspace(-0.5, 0.5, 40)[:, None] * length * along + side * aside for side in (-1.0, 1.0)]
    burrs = [_laid(axis, BURR) for axis in axes]
    truth = tuple(TrueFeature("ridge", axis, BURR, BURR) for axis in axes)
    return replace(plain, object=joined(_mesh(plain.object), *burrs), truth=(*plain.truth, *truth))


def over_a_step(heading: float = 0.2, reach: float = 0.018) -> BenchScene:
    """A wire that runs up a step and on."""
    plain = step(CROSSED_STEP)
    axis = through(heading, reach)
    out = _uphill(plain)
    lifted = axis + CROSSED_STEP * np.clip(0.5 + axis @ out / CROSSED_STEP, 0.0, 1.0)[:, None] * UP
    truth = (*plain.truth, TrueFeature("ridge", axis, WIRE, WIRE))
    return replace(plain, object=joined(_mesh(plain.object), _laid(lifted, WIRE)), truth=truth)


def beside_an_edge(gap: float = 3e-3) -> BenchScene:
    """A ball on the low side of a step, nearer to its edge than both are felt."""
    plain = step(CROSSED_STEP)
    place = MIDDLE - gap * _uphill(plain)
    ball = sphere(place + 0.5 * WIRE * UP, 0.5 * WIRE)
    return replace(
        plain, object=joined(_mesh(plain.object), ball), truth=(*plain.truth, TrueFeature("bump", place, WIRE, WIRE))
    )


def on_a_terrace(gap: float = 6e-3, width: float = 0.4e-3, height: float = 0.15e-3, half: float = 0.014) -> BenchScene:
    """A flat bar on the high side of a step, along it."""
    plain = step(CROSSED_STEP)
    out = _uphill(plain)
    way = np.cross(UP, out)
    axis = MIDDLE + gap * out + np.linspace(-half, half, 40)[:, None] * way
    laid = bar(axis, width, height, CROSSED_STEP)
    truth = (*plain.truth, TrueFeature("ridge", axis, height, width))
    return replace(plain, object=joined(_mesh(plain.object), laid), truth=truth)


def flat_bar(width: float = 2e-3, height: float = 0.4e-3, half: float = 0.015, heading: float = 0.4) -> BenchScene:
    """One bar with upright walls: no wire, and not two."""
    axis, ground = through(heading, half), plate(PLATE_LENGTH, PLATE_WIDTH)
    body = joined(ground, bar(axis, width, height))
    return BenchScene(Surface(*ground), body, (TrueFeature("ridge", axis, height, width),))


def bar(axis: FloatArray, width: float, height: float, level: float = 0.0) -> Mesh:
    """A box along a straight axis (K, 3), its foot at a level, m."""
    way = (axis[-1] - axis[0]) / np.linalg.norm(axis[-1] - axis[0])
    aside = 0.5 * width * np.cross(UP, way)
    ring = np.array([axis[0] - aside, axis[-1] - aside, axis[-1] + aside, axis[0] + aside]) + level * UP
    return shell(
        np.stack(
            [ring, ring + height * UP, axis.mean(axis=0) + 1e-3 * (ring - ring.mean(axis=0)) + (level + height) * UP]
        )
    )


def _uphill(stepped: BenchScene) -> FloatArray:
    """(3,) unit direction in which the step of such a scene rises."""
    edge = stepped.truth[0].axis
    return np.asarray(np.cross(edge[1] - edge[0], UP) / np.linalg.norm(edge[1] - edge[0]))


def _mesh(surface: Surface) -> Mesh:
    return surface.vertices, surface.faces


def _laid(axis: FloatArray, diameter: float) -> Mesh:
    """A wire that lies under its axis' points (K, 3), m."""
    return tube(axis + 0.5 * diameter * UP, np.tile(UP, (len(axis), 1)), 0.5 * diameter)


NEIGHBOUR_BODIES: dict[str, Callable[[], BenchScene]] = {
    "wires 1 mm apart": lambda: side_by_side(1e-3),
    "wires 2 mm apart": lambda: side_by_side(2e-3),
    "wires 3 mm apart": lambda: side_by_side(3e-3),
    "wires 5 mm apart": lambda: side_by_side(5e-3),
    "acute crossing": lambda: wires(through(0.4), through(0.9)),
    "burred groove": burred,
    "wire over a step": over_a_step,
    "bump beside an edge": beside_an_edge,
    "bar on a terrace": on_a_terrace,
    "flat bar": flat_bar,
}
CLASSIFIED = BODIES_BY_KIND | NEIGHBOUR_BODIES


def classified_body(name: str, seed: int) -> BenchScene:
    """A body of the classification bench; for seeds from FIRST_BUILT_WITH on in a size of its own, 0.8 to 1 of it."""
    scene = CLASSIFIED[name]()
    if seed < FIRST_BUILT_WITH:
        return scene
    size = float(np.random.default_rng((seed, 1)).uniform(0.8, 1.0))
    truth = tuple(
        TrueFeature(true.kind, size * true.axis, size * true.height, None if true.width is None else size * true.width)
        for true in scene.truth
    )
    return replace(scene, object=Surface(size * scene.object.vertices, scene.object.faces), truth=truth)
