"""Neighbours: details so near to each other that no sweep feels one of them alone, on the classification bench's plate.

What is read out of one sweep's crossings, one by one, is wrong of these: they are one configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from explore3d.analysis import TrueFeature
from explore3d.bench.scenes.bodies import Mesh, joined, tube
from explore3d.bench.scenes.exploring import UP, WIRE, BenchScene, wires
from explore3d.bench.scenes.kinds import BODIES_BY_KIND, groove, step, through
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
    edge = plain.truth[0].axis
    out = np.cross(edge[1] - edge[0], UP) / np.linalg.norm(edge[1] - edge[0])
    lifted = axis + CROSSED_STEP * np.clip(0.5 + axis @ out / CROSSED_STEP, 0.0, 1.0)[:, None] * UP
    truth = (*plain.truth, TrueFeature("ridge", axis, WIRE, WIRE))
    return replace(plain, object=joined(_mesh(plain.object), _laid(lifted, WIRE)), truth=truth)


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
