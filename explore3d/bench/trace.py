"""Trace bench: ball centres per second over the paper's bump, beside OpenCAMLib's drop cutter if it is installed.

Every case runs in a process of its own on one core, with the same queries for every method. The clock (processor
time) covers all from the mesh in memory to the answers: the tree, the queries. Not covered: importing, and
compiling the kernels, which happens once per machine.

    explore3d bench trace --triangles 20000,200000 --peers
"""

from __future__ import annotations

import importlib.util
import resource
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from time import process_time
from typing import Any

import numpy as np

from explore3d import UserError
from mapping import FloatArray, IntArray, Surface
from mapping.geometry.contact import BallContact

STEEPNESS = 15.0  # a of the paper's bump, figure 3
GROUND_SIDE = 2.0  # side of the square under it
TRACED_MESH_SIZES = (20_000, 200_000, 2_000_000)
BALL_SIZE_RATIOS = (0.05, 0.5)
LAYOUTS = ("grid", "scattered")
PEER_SECONDS = 10.0  # a slow method answers only as many of the queries as fit in here


@dataclass(frozen=True, eq=False)
class Answers:
    """Heights (K,) of the ball centres, m, of queries `which` (K,), and processor time for all queries, s."""

    heights: FloatArray
    which: IntArray
    seconds: float


Tracer = Callable[[Surface, float, FloatArray], Answers]


@dataclass(frozen=True)
class TraceTiming:
    """One method on one case.

    Args:
        method: "explore3d" or a peer's name.
        triangles: of the mesh.
        ratio: ball radius over the size of the body.
        layout: "grid" (row by row) or "scattered" queries.
        queries: asked.
        answered: of these; a slow peer answers only a share of them, drawn at random.
        seconds: processor time for all queries, preparation included; of a peer at the pace of those it answered.
        memory: largest resident memory of the process, bytes.
        error: largest difference of heights from explore3d's, in radii.
    """

    method: str
    triangles: int
    ratio: float
    layout: str
    queries: int
    answered: int
    seconds: float
    memory: int
    error: float

    @property
    def rate(self) -> float:
        """Points per second."""
        return self.queries / self.seconds


def bench_trace(
    triangles: Sequence[int] = TRACED_MESH_SIZES,
    ratios: Sequence[float] = BALL_SIZE_RATIOS,
    layouts: Sequence[str] = LAYOUTS,
    side: int = 256,
    peers: bool = True,
) -> Iterator[TraceTiming]:
    """Time every case, one after the other; queries are side x side.

    Raises:
        UserError: a peer is not installed.
    """
    methods = [name for name, module in METHOD_PACKAGES.items() if peers or not module]
    for name in methods:
        if METHOD_PACKAGES[name] and importlib.util.find_spec(METHOD_PACKAGES[name]) is None:
            raise UserError(f"{name} is not installed: pip install explore3d[peers], or leave out --peers")
    return (
        _in_own_process(m, n, ratio, layout, side)
        for n in triangles for ratio in ratios for layout in layouts for m in methods
    )  # fmt: skip


def _in_own_process(*case: Any) -> TraceTiming:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_timed, *case).result()


def bump_mesh(triangles: int) -> Surface:
    """The paper's bump over a square, as a height field of about so many triangles."""
    cells = max(round(np.sqrt(triangles / 2)), 1)
    x = np.linspace(-GROUND_SIDE / 2, GROUND_SIDE / 2, cells + 1)
    u, v = np.meshgrid(x, x, indexing="ij")
    points = np.column_stack([u.ravel(), v.ravel(), (1.0 / (1.0 + STEEPNESS * (u * u + v * v))).ravel()])
    n = np.arange(len(points), dtype=np.int64).reshape(u.shape)
    a, b, c, d = n[:-1, :-1].ravel(), n[1:, :-1].ravel(), n[1:, 1:].ravel(), n[:-1, 1:].ravel()
    return Surface(points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def query_points(side: int, layout: str) -> FloatArray:
    """(side^2, 3) starting centres above the bump."""
    if layout == "scattered":
        xy = np.random.default_rng(0).uniform(-0.49 * GROUND_SIDE, 0.49 * GROUND_SIDE, (side * side, 2))
    else:
        x = np.linspace(-0.49 * GROUND_SIDE, 0.49 * GROUND_SIDE, side)
        xy = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.column_stack([xy, np.full(len(xy), 2.0 * GROUND_SIDE)])


def _timed(method: str, triangles: int, ratio: float, layout: str, side: int) -> TraceTiming:
    radius, mesh, start = ratio * GROUND_SIDE, bump_mesh(triangles), query_points(side, layout)
    _by_explore3d(bump_mesh(8), radius, start[:2])  # loads the kernels
    tracer: Tracer = _by_explore3d if not METHOD_PACKAGES[method] else by_opencamlib
    answers = tracer(mesh, radius, start)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    own = _by_explore3d(mesh, radius, start[answers.which])
    error = float(np.abs(answers.heights - own.heights).max()) / radius
    return TraceTiming(
        method, len(mesh.faces), ratio, layout, len(start), len(answers.which), answers.seconds, memory, error
    )


def _by_explore3d(mesh: Surface, radius: float, start: FloatArray) -> Answers:
    begin = process_time()
    heights = BallContact(mesh, radius).first_contact(start, [0.0, 0.0, -1.0]).centers[:, 2]
    return Answers(heights, np.arange(len(start)), process_time() - begin)


def by_opencamlib(mesh: Surface, radius: float, start: FloatArray) -> Answers:
    """OpenCAMLib's exact drop cutter on an even share of the queries, as many as its time allows.

    Its triangles are made outside the clock: that takes a loop in Python which is not its own.
    """
    ocl: Any = importlib.import_module("opencamlib")
    body = ocl.STLSurf()
    for corners in mesh.vertices[mesh.faces].tolist():
        body.addTriangle(ocl.Triangle(*[ocl.Point(*corner) for corner in corners]))
    floor = -10.0 * (GROUND_SIDE + radius)
    cutter = ocl.BallCutter(2.0 * radius, -2.0 * floor)  # OpenCAMLib keeps no reference to it

    def drop(which: IntArray) -> tuple[FloatArray, float]:
        begin = process_time()
        batch = ocl.BatchDropCutter()
        batch.setThreads(1)
        batch.setSTL(body)
        batch.setCutter(cutter)
        preparation = process_time() - begin
        for x, y, _ in start[which].tolist():
            batch.appendPoint(ocl.CLPoint(x, y, floor))
        begin = process_time()
        batch.run()
        pace = (process_time() - begin) / len(which)
        heights = np.array([point.z + radius for point in batch.getCLPoints()])
        return heights, preparation + pace * len(start)

    _, guess = drop(_spread(len(start), 8))
    which = _spread(len(start), int(np.clip(PEER_SECONDS / guess * len(start), 8, len(start))))
    heights, seconds = drop(which)
    return Answers(heights, which, seconds)


def _spread(count: int, few: int) -> IntArray:
    """`few` of `count` indices, evenly spread but in no step with the rows of a grid."""
    return np.sort(np.random.default_rng(1).permutation(count)[:few])


# What must be installed for a method
METHOD_PACKAGES = {"explore3d": "", "OpenCAMLib BallCutter": "opencamlib"}


def trace_table(timings: Iterable[TraceTiming]) -> Iterator[str]:
    """One line for each timing as it comes; peers with explore3d's lead over them, case by case."""
    yield (
        f"{'method':24}{'triangles':>10}{'r/L':>6}  {'layout':10}{'points/s':>11}{'answered':>10}{'MB':>6}"
        f"{'error/r':>10}{'lead':>9}"
    )
    own: TraceTiming | None = None
    for t in timings:
        if not METHOD_PACKAGES[t.method]:
            own, lead = t, ""
        else:
            lead = f"{t.seconds / own.seconds:8.0f}x" if own is not None else ""
        yield (
            f"{t.method:24}{t.triangles:10}{t.ratio:6g}  {t.layout:10}{t.rate:11.4g}{t.answered:10}"
            f"{t.memory / 1e6:6.0f}{t.error:10.1e}{lead:>9}"
        )
