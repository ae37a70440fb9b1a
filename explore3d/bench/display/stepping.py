"""Stepping: how long a step of the display takes, and how well its loop keeps to the clock.

explore3d bench display --seconds 30
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hw.display import DisplayLoop, Rendering, SimulatedDisplay
from mapping import FloatArray, Surface
from mapping.geometry.mesh import NearestPoint
from mapping.geometry.proxy import Bar, Bell, Chain, Part, ProxyBody, Terrace, Trench

# The body: a waved plate of 20,000 triangles, its half side, m, and height of its waves, m
GRID_SIDE, PLATE_HALF, WAVE = 101, 30e-3, 0.5e-3
# The ball, m, and the hand that leads it: depth below the base, m, and lines over all features
STEPPING_TIP, HAND_DEPTH, HAND_LINES = 3e-3, 1e-3, 12
STEPPING_STIFFNESS = 500.0


@dataclass(frozen=True)
class Stepping:
    """One run by the clock, s.

    Args:
        rate: asked, 1/s; achieved: steps over the time they took.
        computing: of the steps: median, 99.9 % and largest.
        late: after the instant a step was due: median, 99.9 % and largest.
        missed: share of steps that came a period late or more.
        touching: share of steps in contact.
    """

    rate: float
    achieved: float
    computing: tuple[float, float, float]
    late: tuple[float, float, float]
    missed: float
    touching: float


def stepping_body() -> ProxyBody:
    """20,000 triangles and 20 features of every kind, some of which meet."""
    places = np.linspace(-PLATE_HALF, PLATE_HALF, GRID_SIDE)
    x, y = (each.ravel() for each in np.meshgrid(places, places, indexing="ij"))
    z = WAVE * np.sin(2.0 * np.pi * x / PLATE_HALF) * np.cos(2.0 * np.pi * y / PLATE_HALF)
    corner = (np.arange(GRID_SIDE - 1)[:, None] * GRID_SIDE + np.arange(GRID_SIDE - 1)).ravel()
    quads = np.stack([corner, corner + GRID_SIDE, corner + GRID_SIDE + 1, corner + 1], axis=1)
    base = Surface(np.column_stack([x, y, z]), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    near = NearestPoint(base)

    def line(*corners: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
        found = near.query(1e-3 * np.array([[*each, 0.0] for each in corners]))
        return found.points, found.normals

    parts: list[Part] = [Chain(*line((-25, y), (-10, y + 5)), 0.3e-3, 0.2e-3) for y in (-20, -10, 0)]
    parts += [Chain(*line((-20, -24), (-12, 10)), 0.3e-3, 0.2e-3), Chain(*line((0, -25), (15, -25)), 0.1e-3, 2e-3)]
    parts += [Bar(*line((0, y), (12, y)), 0.2e-3, 1e-3, run) for y, run in ((-20, 0.0), (-15, 0.3e-3), (-10, 1e-3))]
    parts += [Chain(*line((x, 15)), 0.4e-3, 0.3e-3) for x in (-25, -20, -15, -10)]
    bells = [line((x, 22)) for x in (-22, -12)]
    parts += [Bell(point[0], normal[0], 0.3e-3, 0.8e-3, 2.0) for point, normal in bells]
    parts += [Trench(*line((0, y), (20, y)), 2e-3, 0.3e-3) for y in (0, 6)]
    parts += [Trench(*line((10, -4), (10, 12)), 1.5e-3, 0.5e-3)]
    parts += [Trench(*line((x, 20)), 3e-3, 0.4e-3) for x in (5, 15)]
    parts += [Terrace(*line((23, -10), (23, 0)), 0.2e-3, -1.0)]
    return ProxyBody(base, parts, STEPPING_TIP)


def bench_stepping(rates: Sequence[float], seconds: float, speed: float = 30e-3) -> Iterator[Stepping]:
    """A simulated hand rubs over the body, by the clock, at each rate for so long.

    Args:
        rates: steps per second.
        seconds: of each.
        speed: of the hand, m/s.
    """
    body = stepping_body()
    turns = 0.9 * PLATE_HALF * np.linspace(-1.0, 1.0, HAND_LINES)
    corners = np.array(
        [[side * 0.9 * PLATE_HALF, y] for k, y in enumerate(turns) for side in ((-1) ** k, -((-1) ** k))]
    )
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    for rate in rates:
        steps = max(1, round(seconds * rate))
        at = np.mod(np.arange(steps) * speed / rate, along[-1])
        wishes = np.column_stack([*(np.interp(at, along, corners[:, k]) for k in range(2)), np.zeros(steps)])
        wishes[:, 2] = STEPPING_TIP - HAND_DEPTH
        fall = min(steps, round(0.1 * rate))
        wishes[:fall, 2] += np.linspace(3.0 * HAND_DEPTH, 0.0, fall)
        with SimulatedDisplay(wishes, rate=rate) as display:
            loop = DisplayLoop(display, body, Rendering(stiffness=STEPPING_STIFFNESS))
            loop.run(1, paced=False)  # compiled
            run = loop.run(max(1, steps - 1))
        late, computing = run.column("late"), run.column("computing")
        took = float(run.column("t")[-1]) + 1.0 / rate
        yield Stepping(
            rate, run.steps / took, _spread(computing), _spread(late), float(np.mean(late >= 1.0 / rate)),
            float(run.column("touching").mean()),
        )  # fmt: skip


def stepping_lines(found: Sequence[Stepping]) -> Iterator[str]:
    """The table, in Markdown, us."""
    spread = "median, 99.9 %, most"
    yield f"| asked | achieved | a step takes: {spread} | late: {spread} | a period late | touching |"
    yield "|---|---|---|---|---|---|"
    for each in found:
        spreads = " | ".join(", ".join(f"{1e6 * value:.1f}" for value in part) for part in (each.computing, each.late))
        rates = f"{each.rate:g} Hz | {each.achieved:.1f} Hz"
        yield f"| {rates} | {spreads} us | {100.0 * each.missed:.2g} % | {100.0 * each.touching:.0f} % |"


def _spread(values: FloatArray) -> tuple[float, float, float]:
    return float(np.median(values)), float(np.quantile(values, 0.999)), float(values.max())
