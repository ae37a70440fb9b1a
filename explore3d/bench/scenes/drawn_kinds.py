"""One small object of each kind on a plate, of a size and at a place of chance, which a survey finds and explores."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from explore3d.analysis import TrueFeature
from explore3d.bench.scenes.bodies import joined, plate
from explore3d.bench.scenes.exploring import PLATE_LENGTH, PLATE_WIDTH, UP, WIRE, BenchScene, line, placed, wires
from explore3d.bench.scenes.kinds import groove, pit, sphere
from mapping import FloatArray, Surface

# A hollow is felt where it is deepest alone: a crest so many times as high stands out of white noise as much
CREST_SHARE = 0.68
# Beside its middle a ball leans on the near rim, and sinks in by (distance from the rim)^2 / 2r: half-way from the rim
# of a pit of 6 mm 0.11 mm, which sweeps that find such crests do not miss
PIT_SURVEYED = 0.12e-3


def drawn_ridge(rng: np.random.Generator) -> BenchScene:
    """A wire of 40 mm."""
    return wires(placed(line(0.04), rng))


def drawn_bump(rng: np.random.Generator) -> BenchScene:
    """A ball."""
    place, size = _place(rng), WIRE * rng.uniform(0.8, 1.6)
    ground = plate(PLATE_LENGTH, PLATE_WIDTH)
    body = joined(ground, sphere(place + 0.5 * size * UP, 0.5 * size))
    return BenchScene(Surface(*ground), body, (TrueFeature("bump", place, size, size),), shortest_ridge=None)


def drawn_groove(rng: np.random.Generator) -> BenchScene:
    """A slot with square ends, whose floor the ball does not reach; a survey for 25 mm crosses it off its ends."""
    body = groove(rng.uniform(4e-3, 5.5e-3), rng.uniform(0.036, 0.044), rng.uniform(0.0, np.pi))
    return replace(body, smallest=-CREST_SHARE * body.truth[0].height)


def drawn_pit(rng: np.random.Generator) -> BenchScene:
    """A round hole, whose floor the ball does not reach."""
    return replace(pit(rng.uniform(6e-3, 8e-3)), shortest_ridge=None, smallest=PIT_SURVEYED)


def drawn_step(rng: np.random.Generator) -> BenchScene:
    """A plate whose smaller part stands higher: were it the larger one, the lower part would be too low.

    It is surveyed as for bumps: of two sweeps over it nobody can tell where its higher side ends.
    """
    edge, height = rng.uniform(5e-3, 10e-3), rng.uniform(0.6e-3, 1.2e-3)
    x, y = np.array([edge, 0.5 * PLATE_LENGTH]), 0.5 * PLATE_WIDTH
    top = np.array([[x[0], -y, height], [x[1], -y, height], [x[1], y, height], [x[0], y, height]])
    wall = np.vstack([top[[3, 0]], top[[0, 3]] - height * UP])
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    ground = plate(PLATE_LENGTH, PLATE_WIDTH)
    axis = np.array([[edge, -y, 0.0], [edge, y, 0.0]])
    body, truth = joined(ground, (top, quad), (wall, quad)), (TrueFeature("step", axis, height),)
    return BenchScene(Surface(*ground), body, truth, shortest_ridge=None)


def _place(rng: np.random.Generator) -> FloatArray:
    return np.append(rng.uniform(-0.02, 0.02, 2), 0.0)


DRAWN_KINDS: dict[str, Callable[[np.random.Generator], BenchScene]] = {
    "ridge": drawn_ridge,
    "bump": drawn_bump,
    "groove": drawn_groove,
    "pit": drawn_pit,
    "step": drawn_step,
}
