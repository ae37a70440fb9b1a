"""Traces for the stability cases: sweeps over a plate, heights in closed form, noise of the paper's apparatus."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from explore3d.bench.scenes.noise import SAMPLE_SPACING
from mapping import Feature, FloatArray, Surface, Trace
from mapping.assembly import assemble
from mapping.base import Base
from mapping.detection import Detections, detect
from mapping.geometry.templates import chain_height

Heights = Callable[[FloatArray], FloatArray]

TIP_RADIUS = 10e-3
DIAMETER = 0.65e-3
HALF = 12e-3  # of a sweep
UP = np.array([0.0, 0.0, 1.0])


def plate(half: float = 0.1, scale: float = 1.0, at: Sequence[float] = (0.0, 0.0, 0.0)) -> Base:
    """A square in the plane z = 0, moved to `at`."""
    corners = scale * half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) + np.asarray(at)
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def wire(diameter: float = DIAMETER, y: float = 0.0, half: float = 0.05, angle: float = 0.0) -> Heights:
    """The trace over a wire that lies on the plate along x, turned by an angle about its middle."""
    axis = half * np.array([[-np.cos(angle), -np.sin(angle), 0], [np.cos(angle), np.sin(angle), 0]])
    axis = axis + np.array([0.0, y, 0.5 * diameter])
    return lambda feet: chain_height(feet, np.tile(UP, (len(feet), 1)), axis, 0.5 * diameter, TIP_RADIUS)


def sweeps(
    heights: Heights,
    *,
    places: Sequence[float] = (-9e-3, -5e-3, -1e-3, 3e-3, 7e-3),
    white: float = 0.0,
    along_x: bool = False,
    spacing: float = SAMPLE_SPACING,
    half: float = HALF,
    seed: int = 1,
) -> Trace:
    """Sweeps along y at the given x (or along x at the given y)."""
    rng = np.random.default_rng(seed)
    run = np.arange(-half, half, spacing)
    paths = []
    for place in places:
        across = np.full(len(run), place)
        columns = (run, across) if along_x else (across, run)
        paths.append(np.column_stack([*columns, np.zeros(len(run))]))
    feet = np.concatenate(paths)
    height = heights(feet) + white * rng.standard_normal(len(feet))
    centers = feet + (TIP_RADIUS + height)[:, None] * UP
    number = np.repeat(np.arange(len(places)), len(run))
    return Trace(2e-4 * np.arange(float(len(feet))), centers, number, TIP_RADIUS)


def scaled(trace: Trace, scale: float, at: FloatArray | None = None) -> Trace:
    """The same trace in another unit of length, its origin moved (in the new unit)."""
    shift = np.zeros(3) if at is None else at
    return Trace(trace.t, scale * trace.centers + shift, trace.sweep, scale * trace.tip_radius)


def features(trace: Trace, base: Base | None = None) -> tuple[Detections, tuple[Feature, ...]]:
    """Detections, and the features that they make."""
    base = base or plate()
    found = detect(trace, base)
    return found, assemble(found, trace, base)
