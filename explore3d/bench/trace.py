"""Trace bench: ball centres per second over the paper's bump, beside other programs where they are installed.

Meshes are regular (an axis-aligned grid, which flatters trees of aligned boxes) and irregular (random points). A
program meets a mesh in a process of its own on one core, with the same queries as all others: a grid, row by row, and
scattered ones, under balls of three sizes. The clock (processor time) counts the preparation, from the mesh in memory
to the first query, and the queries. Not covered: importing, and compiling the kernels, which happens once per machine.

    explore3d bench trace --triangles 20000,200000 --peers
"""

from __future__ import annotations

import importlib.util
import resource
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from explore3d import count_text
from mapping import FloatArray, IntArray, Surface
from mapping.geometry.contact import BallContact
from mapping.geometry.mesh import open3d

STEEPNESS = 15.0  # a of the paper's bump, figure 3
GROUND_SIDE = 2.0  # side of the square under it
TRACED_MESH_SIZES = (20_000, 200_000, 2_000_000)
BALL_SIZE_RATIOS = (0.005, 0.05, 0.5)
LAYOUTS = ("grid", "scattered")
DOWN = np.array([0.0, 0.0, -1.0])
PEER_SECONDS = 5.0  # a slow method answers only as many of the queries as fit in here
REPEATS = 3  # of our own queries: the fastest counts, for another program may be on the same core
# coal's ball comes closer until so little of its radius is left, in so many steps at most: along a wall each closes a
# share of the gap only
NEAR_ENOUGH, MOST_ADVANCES = 1e-9, 1000


@dataclass(frozen=True, eq=False)
class Answers:
    """Heights (K,) of the ball centres, m, of queries `which` (K,); processor time of the preparation and of all
    queries, s."""

    heights: FloatArray
    which: IntArray
    preparation: float
    queries: float

    @property
    def seconds(self) -> float:
        """Processor time of both."""
        return self.preparation + self.queries


# Ball centres under which a ball of the radius comes to rest from the starts (K, 3), straight down
Tracer = Callable[[float, FloatArray], Answers]


@dataclass(frozen=True)
class TraceTiming:
    """One method on one case.

    Args:
        method: "explore3d" or a peer's name.
        mesh: "regular" or "irregular".
        triangles: of the mesh.
        ratio: ball radius over the size of the body.
        layout: "grid" (row by row) or "scattered" queries.
        queries: asked.
        answered: of these; a slow peer answers only a share of them, drawn at random.
        preparation, seconds: processor time of the preparation and of all queries; of a peer at the pace of those it
            answered.
        memory: largest resident memory of the process so far, bytes.
        error: largest difference of heights from explore3d's, in radii.
        two_cores: wall time of the queries on one core over that on two; NaN for peers.
    """

    method: str
    mesh: str
    triangles: int
    ratio: float
    layout: str
    queries: int
    answered: int
    preparation: float
    seconds: float
    memory: int
    error: float
    two_cores: float

    @property
    def rate(self) -> float:
        """Points per second of a mesh that is prepared."""
        return self.queries / self.seconds

    @property
    def whole_rate(self) -> float:
        """Points per second, preparation included."""
        return self.queries / (self.preparation + self.seconds)


def bench_trace(
    triangles: Sequence[int] = TRACED_MESH_SIZES,
    ratios: Sequence[float] = BALL_SIZE_RATIOS,
    layouts: Sequence[str] = LAYOUTS,
    side: int = 256,
    methods: Sequence[str] = ("explore3d",),
    peer_seconds: float = PEER_SECONDS,
) -> Iterator[TraceTiming]:
    """Time every case, mesh by mesh and method by method; queries are side x side."""
    with tempfile.TemporaryDirectory() as folder:
        for count in triangles:
            for kind in TRACED_MESHES:
                path = Path(folder) / f"{kind}-{count}.npz"
                _in_own_process(_write_mesh, kind, count, path)  # what making it takes is no method's memory
                for method in methods:
                    yield from _in_own_process(timed, method, kind, path, ratios, layouts, side, peer_seconds)
                path.unlink()


def _in_own_process(work: Callable[..., Any], *case: Any) -> Any:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(work, *case).result()


def bump_mesh(triangles: int) -> Surface:
    """The paper's bump over a square, as a height field of about so many triangles."""
    cells = max(round(np.sqrt(triangles / 2)), 1)
    x = np.linspace(-GROUND_SIDE / 2, GROUND_SIDE / 2, cells + 1)
    u, v = np.meshgrid(x, x, indexing="ij")
    points = np.column_stack([u.ravel(), v.ravel(), _heights(u.ravel(), v.ravel())])
    n = np.arange(len(points), dtype=np.int64).reshape(u.shape)
    a, b, c, d = n[:-1, :-1].ravel(), n[1:, :-1].ravel(), n[1:, 1:].ravel(), n[:-1, 1:].ravel()
    return Surface(points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def irregular_bump_mesh(triangles: int) -> Surface:
    """The same over points at random, the square's corners and a border as dense as they are; Delaunay's triangles."""
    from scipy.spatial import Delaunay

    inside = max(triangles // 2, 4)
    border = np.linspace(-1.0, 1.0, max(round(np.sqrt(inside)), 2))
    ends = np.ones_like(border)
    flat = np.random.default_rng(3).uniform(-1.0, 1.0, (inside, 2))
    sides = [np.column_stack(side) for side in ((border, -ends), (border, ends), (-ends, border), (ends, border))]
    flat = 0.5 * GROUND_SIDE * np.unique(np.concatenate([flat, *sides]), axis=0)
    faces = np.asarray(Delaunay(flat).simplices, dtype=np.int64)
    a, b, c = flat[faces[:, 0]], flat[faces[:, 1]], flat[faces[:, 2]]
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces[turn < 0.0] = faces[turn < 0.0][:, ::-1]
    return Surface(np.column_stack([flat, _heights(*flat.T)]), faces)


def _heights(u: FloatArray, v: FloatArray) -> FloatArray:
    return np.asarray(1.0 / (1.0 + STEEPNESS * (u * u + v * v)))


TRACED_MESHES: dict[str, Callable[[int], Surface]] = {"regular": bump_mesh, "irregular": irregular_bump_mesh}


def _write_mesh(kind: str, triangles: int, path: Path) -> None:
    mesh = TRACED_MESHES[kind](triangles)
    np.savez(path, vertices=mesh.vertices, faces=mesh.faces)


def query_points(side: int, layout: str) -> FloatArray:
    """(side^2, 3) starting centres above the bump."""
    if layout == "scattered":
        xy = np.random.default_rng(0).uniform(-0.49 * GROUND_SIDE, 0.49 * GROUND_SIDE, (side * side, 2))
    else:
        x = np.linspace(-0.49 * GROUND_SIDE, 0.49 * GROUND_SIDE, side)
        xy = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.column_stack([xy, np.full(len(xy), 2.0 * GROUND_SIDE)])


def timed(
    method: str,
    kind: str,
    path: Path,
    ratios: Sequence[float],
    layouts: Sequence[str],
    side: int,
    peer_seconds: float = PEER_SECONDS,
) -> list[TraceTiming]:
    """All cases of one method on the mesh in a file."""
    with np.load(path) as held:
        mesh = Surface(held["vertices"], held["faces"])
    _by_explore3d(bump_mesh(8), 1.0, query_points(2, "grid"))  # loads the kernels
    if method == "explore3d":
        tracer: Tracer = partial(_by_explore3d, mesh)
    else:
        tracer = PEER_TRACERS[method].prepared(mesh, peer_seconds)
    # the largest memory so far is the method's only as long as nobody else has worked here
    found = [
        (ratio, layout, tracer(ratio * GROUND_SIDE, query_points(side, layout)), _peak())
        for ratio in ratios
        for layout in layouts
    ]
    return [_told(method, kind, mesh, side, *each) for each in found]


def _told(
    method: str, kind: str, mesh: Surface, side: int, ratio: float, layout: str, answers: Answers, memory: int
) -> TraceTiming:
    """What came of one case; its error and what two cores gain are asked outside of the clock."""
    start, radius = query_points(side, layout), ratio * GROUND_SIDE
    ball, own = BallContact(mesh, radius), method == "explore3d"
    heights = answers.heights if own else ball.first_contact(start[answers.which], DOWN).centers[:, 2]
    gained = float("nan")
    if own:
        # in turn, for what others do on the machine changes
        one, two = np.min([[_wall_time(ball, start, threads) for threads in (1, 2)] for _ in range(REPEATS)], axis=0)
        gained = float(one / two)
    return TraceTiming(
        method,
        kind,
        len(mesh.faces),
        ratio,
        layout,
        len(start),
        len(answers.which),
        answers.preparation,
        answers.queries,
        memory,
        float(np.abs(answers.heights - heights).max()) / radius,
        gained,
    )


def _wall_time(ball: BallContact, start: FloatArray, threads: int) -> float:
    begin = perf_counter()
    ball.first_contact(start, DOWN, threads=threads)
    return perf_counter() - begin


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _by_explore3d(mesh: Surface, radius: float, start: FloatArray) -> Answers:
    begin = process_time()
    ball = BallContact(mesh, radius)
    preparation, queries = process_time() - begin, np.inf
    for _ in range(REPEATS):
        begin = process_time()
        heights = ball.first_contact(start, DOWN).centers[:, 2]
        queries = min(queries, process_time() - begin)
    return Answers(heights, np.arange(len(start)), preparation, queries)


def by_opencamlib(mesh: Surface, radius: float, start: FloatArray, peer_seconds: float = 10.0) -> Answers:
    """OpenCAMLib's exact drop cutter on an even share of the queries, as many as its time allows."""
    return _opencamlib(mesh, peer_seconds)(radius, start)


def _opencamlib(mesh: Surface, peer_seconds: float) -> Tracer:
    """Its triangles are made outside the clock: that takes a loop in Python which is not its own."""
    ocl: Any = importlib.import_module("opencamlib")
    body = ocl.STLSurf()
    for corners in mesh.vertices[mesh.faces].tolist():
        body.addTriangle(ocl.Triangle(*[ocl.Point(*corner) for corner in corners]))

    def trace(radius: float, start: FloatArray) -> Answers:
        floor = -10.0 * (GROUND_SIDE + radius)
        cutter = ocl.BallCutter(2.0 * radius, -2.0 * floor)  # OpenCAMLib keeps no reference to it

        def drop(which: IntArray) -> tuple[FloatArray, float, float]:
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
            seconds = process_time() - begin
            return np.array([point.z + radius for point in batch.getCLPoints()]), preparation, seconds

        return _of_a_share(drop, len(start), peer_seconds)

    return trace


def _coal(mesh: Surface, peer_seconds: float) -> Tracer:
    """coal's exact distances of a ball to a mesh: it goes on by the gap until none is left (conservative advancement).

    The loop is Python's; a step of it is a search for the nearest of all triangles.
    """
    coal: Any = importlib.import_module("coal")
    begin = process_time()
    body = coal.BVHModelOBBRSS()
    body.beginModel(len(mesh.faces), len(mesh.vertices))
    body.addVertices(mesh.vertices)
    body.addTriangles(mesh.faces)
    body.endModel()
    preparation = process_time() - begin
    here, place, request, answer = coal.Transform3s(), coal.Transform3s(), coal.DistanceRequest(), coal.DistanceResult()

    def trace(radius: float, start: FloatArray) -> Answers:
        ball = coal.Sphere(radius)

        def lowered(which: IntArray) -> tuple[FloatArray, float, float]:
            begin, heights = process_time(), np.empty(len(which))
            for k, i in enumerate(which):
                centre = start[i].copy()
                for _ in range(MOST_ADVANCES):
                    place.setTranslation(centre)
                    answer.clear()
                    gap = coal.distance(body, here, ball, place, request, answer)
                    if gap <= NEAR_ENOUGH * radius:
                        break
                    centre[2] -= gap
                heights[k] = centre[2]
            return heights, preparation, process_time() - begin

        return _of_a_share(lowered, len(start), peer_seconds)

    return trace


def _open3d(mesh: Surface, peer_seconds: float) -> Tracer:
    """Open3D's (Embree's) rays down to the body: how fast a ball without any size could be, in single precision."""
    tensors = open3d().core.Tensor
    begin = process_time()
    scene = open3d().t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(tensors(mesh.vertices.astype(np.float32)), tensors(mesh.faces.astype(np.uint32)))
    scene.cast_rays(tensors(np.zeros((1, 6), np.float32)), nthreads=1)  # the tree is built with the first ray
    preparation = process_time() - begin

    def trace(radius: float, start: FloatArray) -> Answers:
        begin = process_time()
        rays = np.column_stack([start, np.broadcast_to(DOWN, start.shape)]).astype(np.float32)
        gone = scene.cast_rays(tensors(rays), nthreads=1)["t_hit"].numpy()
        heights = start[:, 2] - gone + radius
        return Answers(heights, np.arange(len(start)), preparation, process_time() - begin)

    return trace


def _of_a_share(
    answer: Callable[[IntArray], tuple[FloatArray, float, float]], count: int, peer_seconds: float
) -> Answers:
    """An even share of so many queries, as many as the time allows; the time of all at their pace.

    Args:
        answer: to some of the queries: heights, processor time of the preparation and of these queries.
    """
    few = min(8, count)
    guess = answer(_spread(count, few))[2] / few
    which = _spread(count, int(np.clip(peer_seconds / max(guess, 1e-9), few, count)))
    heights, preparation, seconds = answer(which)
    return Answers(heights, which, preparation, seconds / len(which) * count)


def _spread(count: int, few: int) -> IntArray:
    """`few` of `count` indices, evenly spread but in no step with the rows of a grid."""
    return np.sort(np.random.default_rng(1).permutation(count)[:few])


@dataclass(frozen=True)
class Peer:
    """Another program: the package it needs, how that is had, and what traces a mesh with it in so many seconds."""

    package: str
    remedy: str
    prepared: Callable[[Surface, float], Tracer]


PEER_TRACERS = {
    "OpenCAMLib BallCutter": Peer("opencamlib", "pip install 'explore3d[peers]'", _opencamlib),
    "coal, advancing": Peer("coal", "pip install 'explore3d[peers]'", _coal),
    "Open3D rays, no ball": Peer("open3d", "explore3d doctor says what is missing", _open3d),
}


def trace_methods(peers: bool) -> tuple[list[str], list[str]]:
    """Methods that can be timed here, explore3d first, and a sentence for each that cannot."""
    missing = {name for name, peer in PEER_TRACERS.items() if not importlib.util.find_spec(peer.package)}
    sentences = [
        f"{name}: {PEER_TRACERS[name].package} is not installed; {PEER_TRACERS[name].remedy}"
        for name in sorted(missing)
    ]
    return ["explore3d", *(name for name in PEER_TRACERS if peers and name not in missing)], sentences if peers else []


def trace_table(timings: Iterable[TraceTiming]) -> Iterator[str]:
    """One line for each timing as it comes, with explore3d's lead over each peer's queries; the ranges at the end."""
    yield (
        f"{'method':22}{'mesh':10}{'triangles':>10}{'r/L':>6}  {'layout':10}{'points/s':>10}{'with tree':>10}"
        f"{'answered':>9}{'MB':>6}{'error/r':>9}{'lead':>9}{'2 cores':>8}"
    )
    own: dict[tuple[str, int, float, str], TraceTiming] = {}
    every: list[TraceTiming] = []
    for t in timings:
        every.append(t)
        case = (t.mesh, t.triangles, t.ratio, t.layout)
        lead = ""
        if t.method == "explore3d":
            own[case] = t
        elif case in own:
            lead = f"{own[case].rate / t.rate:.3g}x"
        gained = "" if np.isnan(t.two_cores) else f"{t.two_cores:.2f}x"
        yield (
            f"{t.method:22}{t.mesh:10}{t.triangles:10}{t.ratio:6g}  {t.layout:10}{t.rate:10.3g}{t.whole_rate:10.3g}"
            f"{t.answered:9}{t.memory / 1e6:6.0f}{t.error:9.0e}{lead:>9}{gained:>8}"
        )
    yield from _ranges(every, own)


def _ranges(every: Sequence[TraceTiming], own: dict[tuple[str, int, float, str], TraceTiming]) -> Iterator[str]:
    """Of each mesh and method: the least and the largest rate and lead over all balls and layouts."""
    for (mesh, triangles, method), group in groupby(every, key=lambda t: (t.mesh, t.triangles, t.method)):
        timings = list(group)
        rates = [t.rate for t in timings]
        told = f"{mesh}, {count_text(triangles, 'triangle')}: {method} {min(rates):.3g} to {max(rates):.3g} points/s"
        if method == "explore3d":
            gained = [t.two_cores for t in timings]
            told += f", {min(gained):.2f} to {max(gained):.2f} times as many on 2 cores"
        else:
            leads = [own[t.mesh, t.triangles, t.ratio, t.layout].rate / t.rate for t in timings]
            told += f"; explore3d {min(leads):.3g} to {max(leads):.3g} times as many"
        yield told
