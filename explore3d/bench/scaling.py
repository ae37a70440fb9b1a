"""Scaling: time and memory of the analysis against samples, triangles and features, with the exponents that fit; of the
estimated surface against the samples of sweeps, too.

Every size runs in a process of its own, so that its memory is its own. A finished size is a line of a JSONL file and
is not run again.
"""

from __future__ import annotations

import json
import resource
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from explore3d.bench.scenes import write_long_log
from explore3d.bench.trace import bump_mesh
from mapping import FloatArray, IntArray, Trace
from mapping.estimate.envelope import estimate_surface, sweep_faces
from mapping.geometry.contact import BallContact

AXES = ("samples", "triangles", "features", "surface")
SAMPLE_COUNTS = (10_000, 100_000, 1_000_000, 3_000_000, 10_000_000)
TRIANGLE_COUNTS = (1_000, 10_000, 100_000, 1_000_000, 10_000_000)
FEATURES = (0, 10, 50, 200)
SWEPT_COUNTS = (10_000, 100_000, 1_000_000, 10_000_000)
HUGE = (100_000_000,)
# Sizes from which on what the program costs to start does not count
LARGE_SIZES = {"samples": 1_000_000, "surface": 100_000}
QUERIES = 20_000
LOG_OF_FEATURES = 3_000_000  # samples of the log in which features are counted
# A corrugated plate that a ball follows everywhere (its tightest valley has 4 radii), swept across the corrugation; m
SWEPT_TIP, SWEPT_HEIGHT, SWEPT_WAVE, SWEPT_PITCH, SWEPT_STEP = 2e-3, 2e-4, 8e-3, 1e-3, 16e-6


@dataclass(frozen=True)
class Cost:
    """What one size cost: seconds of wall time, peak resident memory in bytes, seconds per stage, what was found.

    Of `surface` they are seconds of processor time, and what was found are the holes of the mesh.
    """

    axis: str
    size: int
    seconds: float
    memory: int
    stages: dict[str, float] = field(default_factory=dict)
    found: int = 0


def bench_scaling(store: Path, axes: Sequence[str] = AXES, huge: bool = False, quick: bool = False) -> Iterator[Cost]:
    """Run every size that `store` does not hold yet; yields all, old and new, axis by axis."""
    known = {(cost.axis, cost.size): cost for cost in _read(store)}
    sizes = {
        "samples": SAMPLE_COUNTS + (HUGE if huge else ()),
        "triangles": TRIANGLE_COUNTS,
        "features": FEATURES,
        "surface": SWEPT_COUNTS,
    }
    for axis in axes:
        for size in sizes[axis][:3] if quick else sizes[axis]:
            cost = known.get((axis, size))
            if cost is None:
                with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                    cost = pool.submit(measure, axis, size).result()
                with store.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(cost)) + "\n")
            yield cost


def measure(axis: str, size: int) -> Cost:
    """One size; a small one first, so that neither imports nor compiling are counted."""
    if axis == "triangles":
        _contacts(1_000)
        seconds, count = _contacts(size)
        return Cost(axis, size, seconds, _peak(), {}, count)
    if axis == "surface":
        _surface(1_000)
        seconds, memory, meshing, holes = _surface(size)
        return Cost(axis, size, seconds, memory, {"meshing all samples": meshing}, holes)
    with tempfile.TemporaryDirectory() as folder:
        _analysed(Path(folder), "warm", 30_000, 1)
        given = (size, 4) if axis == "samples" else (LOG_OF_FEATURES, size)
        seconds, stages, found = _analysed(Path(folder), "log", *given)
    return Cost(axis, size, seconds, _peak(), stages, found)


def _analysed(folder: Path, name: str, samples: int, wires: int) -> tuple[float, dict[str, float], int]:
    """Log to report: seconds, seconds per stage, features found."""
    from explore3d.jobs import analyze

    path = folder / f"{name}.mcap"
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:  # writing must not count as memory here
        pool.submit(_write, path, samples, wires).result()
    begin = perf_counter()
    analysis = analyze(path, folder / name)
    return perf_counter() - begin, dict(analysis.timings), len(analysis.model.features)


def _write(path: Path, samples: int, wires: int) -> None:
    write_long_log(path, samples, wires)


def _contacts(triangles: int) -> tuple[float, int]:
    """Tree and queries on the paper's bump: seconds, contacts."""
    mesh = bump_mesh(triangles)
    xy = np.random.default_rng(0).uniform(-0.9, 0.9, (QUERIES, 2))
    start = np.column_stack([xy, np.full(QUERIES, 4.0)])
    begin = perf_counter()
    found = BallContact(mesh, 0.1).first_contact(start, [0.0, 0.0, -1.0])
    return perf_counter() - begin, int((found.count > 0).sum())


def _surface(samples: int) -> tuple[float, int, float, int]:
    """The surface under sweeps: seconds, peak memory until then, seconds of meshing every sample, holes of the mesh.

    Rows are about as long as all of them lie apart, so that the plate grows both ways.
    """
    trace = corrugated_sweeps(samples, max(4, round(np.sqrt(samples * SWEPT_STEP / SWEPT_PITCH))))
    begin = process_time()
    estimate = estimate_surface(trace)
    seconds, memory = process_time() - begin, _peak()
    holes = _borders(estimate.surface.faces) - 1 if estimate.surface is not None else -1
    del estimate
    up, begin = np.tile([0.0, 0.0, 1.0], (len(trace), 1)), process_time()
    sweep_faces(trace.centers, trace.sweep, up)
    return seconds, memory, process_time() - begin, holes


def corrugated_sweeps(samples: int, rows: int) -> Trace:
    """A ball's way over z = a sin(2 pi x / w), in rows that lie so far apart: the parallel curve, exactly."""
    x: FloatArray = SWEPT_STEP * np.arange(samples // rows, dtype=np.float64)
    phase = 2.0 * np.pi / SWEPT_WAVE * x
    slope = SWEPT_HEIGHT * 2.0 * np.pi / SWEPT_WAVE * np.cos(phase)
    root = np.sqrt(1.0 + slope**2)
    row = np.column_stack([x - SWEPT_TIP * slope / root, 0.0 * x, SWEPT_HEIGHT * np.sin(phase) + SWEPT_TIP / root])
    aside = np.repeat(SWEPT_PITCH * np.arange(rows), len(x))
    centers = np.tile(row, (rows, 1))
    centers[:, 1] = aside
    t = 1e-4 * np.arange(len(centers), dtype=np.float64)
    return Trace(t, centers, np.repeat(np.arange(rows), len(x)), SWEPT_TIP)


def _borders(faces: IntArray) -> int:
    """Number of closed lines of edges that have one face only: the rim, and one for each hole."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    sides = np.sort(np.concatenate([faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1)
    edges, times = np.unique(sides, axis=0, return_counts=True)
    corners, ends = np.unique(edges[times == 1], return_inverse=True)
    first, second = ends.reshape(-1, 2).T
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(len(corners), len(corners)))
    return int(connected_components(graph)[0])


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def exponents(costs: Sequence[Cost]) -> dict[str, tuple[float, float]]:
    """Of each axis: the exponents of time and of memory in its size, by least squares on the larger sizes.

    For features, which begin at none, the cost of none is taken off the time first; NaN where nothing is left.
    """
    fitted = {}
    for axis in AXES:
        own = sorted((cost for cost in costs if cost.axis == axis), key=lambda cost: cost.size)
        bare = own[0].seconds if own and own[0].size == 0 else 0.0
        used = _larger(axis, [cost for cost in own if cost.size > 0])
        if len(used) >= 2:
            size = np.array([cost.size for cost in used], dtype=np.float64)
            seconds = np.array([cost.seconds - bare for cost in used])
            memory = np.array([float(cost.memory) for cost in used])
            fitted[axis] = (_slope(size, seconds), _slope(size, memory))
    return fitted


def _larger(axis: str, costs: list[Cost]) -> list[Cost]:
    """Those costs, in the order of size, that growth and not the start of the program decides."""
    if len(large := [cost for cost in costs if cost.size >= LARGE_SIZES.get(axis, np.inf)]) >= 2:
        return large
    return costs[-max(2, min(3, len(costs))) :]


def _slope(size: FloatArray, cost: FloatArray) -> float:
    return float(np.polyfit(np.log(size), np.log(cost), 1)[0]) if (cost > 0).all() else float("nan")


def scaling_lines(costs: Iterator[Cost]) -> Iterator[str]:
    """A line for each size as it is done, the exponents after each axis and, all together, at the end."""
    every: list[Cost] = []
    yield f"{'axis':10}{'size':>12}{'s':>9}{'MB':>8}{'found':>7}  stages"
    for axis, own in groupby(costs, key=lambda cost: cost.axis):
        for cost in own:
            every.append(cost)
            stages = ", ".join(f"{name} {seconds:.1f}" for name, seconds in cost.stages.items() if seconds >= 0.05)
            yield f"{axis:10}{cost.size:12,}{cost.seconds:9.2f}{cost.memory / 1e6:8.0f}{cost.found:7}  {stages}"
        yield _told({axis: exponents(every).get(axis)})
    fitted = exponents(every)
    yield "scaling: " + _told({axis: fitted.get(axis) for axis in dict.fromkeys(cost.axis for cost in every)})


def _told(fitted: Mapping[str, tuple[float, float] | None]) -> str:
    return "; ".join(
        f"{axis}: too few sizes to fit" if each is None else f"{axis}: time ~ n^{each[0]:.2f}, memory ~ n^{each[1]:.2f}"
        for axis, each in fitted.items()
    )


def _read(store: Path) -> list[Cost]:
    if not store.exists():
        return []
    return [Cost(**json.loads(line)) for line in store.read_text(encoding="utf-8").splitlines() if line.strip()]
