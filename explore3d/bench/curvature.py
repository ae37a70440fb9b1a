"""Curvature bench: error, speed and memory on bodies of known curvature, beside libigl, pymeshlab and a plain jet."""

from __future__ import annotations

import importlib.util
import json
import resource
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from explore3d.bench.trace import bump_mesh
from explore3d.pictures import ESTIMATED, new_figure, png, styled
from mapping import BoolArray, FloatArray, Surface
from mapping.geometry.curvature import principal_curvatures
from mapping.geometry.mesh import write_whole
from mapping.geometry.templates import BumpOfRevolution

# Both bodies measure 2 across; noise is isotropic and given as a share of that.
BODY_SIZE = 2.0
STEEPNESS = 15.0
TORUS = (5 / 7, 2 / 7)
RELATIVE_NOISES = (0.0, 1e-4, 1e-3, 1e-2)
# The bump is judged where |x| and |y| are below this: its border has neighbours on one side only.
INTERIOR = 0.85
CURVATURE_TIP_RADIUS = 0.1
LARGE_POINT_COUNT = 20_000


@dataclass(frozen=True)
class CurvatureAccuracy:
    """One line of the table.

    Args:
        method, body: names.
        vertices: of the mesh.
        noise: standard deviation of each coordinate / size of the body.
        median, p95: of the larger error of k1 and k2 at interior vertices / the body's largest curvature.
        wrong_side: share of interior vertices on the wrong side of |k| = 1/r, r = 0.1.
        valid: share of interior vertices with a value.
        seconds: of one call, wall clock, kernels loaded.
        memory: peak resident memory of the process, bytes.
    """

    method: str
    body: str
    vertices: int
    noise: float
    median: float
    p95: float
    wrong_side: float
    valid: float
    seconds: float
    memory: int


@dataclass(frozen=True, eq=False)
class Known:
    """A mesh with its true curvatures (V,), 1/m, and the vertices (V,) that are judged."""

    surface: Surface
    k1: FloatArray
    k2: FloatArray
    interior: BoolArray


def bump(vertices: int) -> Known:
    """The paper's bump over a square of side 2; its interior is where |x| and |y| are below 0.85."""
    surface = bump_mesh(2 * (round(np.sqrt(vertices)) - 1) ** 2)
    x, y, _ = surface.vertices.T
    meridian, around = BumpOfRevolution(STEEPNESS).curvatures(np.hypot(x, y))
    inside = (np.abs(x) < INTERIOR) & (np.abs(y) < INTERIOR)
    return Known(surface, np.maximum(meridian, around), np.minimum(meridian, around), inside)


def torus(vertices: int) -> Known:
    """A torus of radii 5/7 and 2/7 on a grid of about square cells at its middle."""
    big, small = TORUS
    around = int(np.sqrt(vertices * big / small))
    across = vertices // around
    u, v = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.arange(across) * 2 * np.pi / across, indexing="ij")
    out = big + small * np.cos(v)
    points = np.stack([out * np.cos(u), out * np.sin(u), small * np.sin(v)], axis=-1).reshape(-1, 3)
    a = np.arange(around * across).reshape(around, across)
    b, d = np.roll(a, -1, 0), np.roll(a, -1, 1)
    c = np.roll(b, -1, 1)
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    k2 = (np.cos(v) / out).ravel()
    return Known(Surface(points, faces), np.full(len(k2), 1 / small), k2, np.ones(len(k2), dtype=bool))


def _pymeshlab(surface: Surface) -> tuple[FloatArray, FloatArray]:
    """Its quadric fitting; the names of the larger and the smaller curvature are not to be relied upon."""
    meshlab: Any = importlib.import_module("pymeshlab")
    found = []
    for name in ("Max Curvature", "Min Curvature"):
        meshes = meshlab.MeshSet(verbose=False)
        meshes.add_mesh(meshlab.Mesh(surface.vertices, surface.faces))
        meshes.compute_curvature_principal_directions_per_vertex(
            method="Quadric Fitting", curvcolormethod=name, autoclean=False
        )
        found.append(np.array(meshes.current_mesh().vertex_scalar_array()))
    return np.maximum(*found), np.minimum(*found)


def _ours(surface: Surface, method: str = "jet", **settings: Any) -> tuple[FloatArray, FloatArray]:
    found = principal_curvatures(surface, method, **settings)
    return found.k1, found.k2


Method = Callable[[Surface], tuple[FloatArray, FloatArray]]
BODIES_OF_KNOWN_CURVATURE: dict[str, Callable[[int], Known]] = {"bump": bump, "torus": torus}
COMPARED_METHODS: dict[str, Method] = {
    "explore3d": _ours,
    "plain jet, degree 4, 48 points": partial(_ours, neighbours=48, degree=4),
    "libigl, 2 rings": partial(_ours, method="libigl", radius=2),
    "libigl, 5 rings": partial(_ours, method="libigl", radius=5),
    "libigl, 8 rings": partial(_ours, method="libigl", radius=8),
    "pymeshlab, quadric": _pymeshlab,
}
PEERS = {"pymeshlab, quadric": "pymeshlab"}


def available() -> tuple[list[str], list[str]]:
    """Methods that can be measured here, and a sentence for each that cannot."""
    missing = {name for name, module in PEERS.items() if not importlib.util.find_spec(module)}
    sentences = [f"{name}: {PEERS[name]} is not installed; pip install 'explore3d[peers]'" for name in sorted(missing)]
    return [name for name in COMPARED_METHODS if name not in missing], sentences


def bench_curvature(vertices: Iterable[int], methods: Iterable[str], seed: int = 0) -> Iterator[CurvatureAccuracy]:
    """Measure every case, each in a process of its own; noise only up to 20 000 vertices, where it has been studied."""
    for count in vertices:
        for body in BODIES_OF_KNOWN_CURVATURE if count <= LARGE_POINT_COUNT else ("bump",):
            for noise in RELATIVE_NOISES if count <= LARGE_POINT_COUNT else (0.0,):
                for method in methods:
                    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                        yield pool.submit(measure, method, body, count, noise, seed).result()


def measure(method: str, body: str, vertices: int, noise: float, seed: int = 0) -> CurvatureAccuracy:
    """Error and cost of one method on one body."""
    known, compute = BODIES_OF_KNOWN_CURVATURE[body](vertices), COMPARED_METHODS[method]
    compute(BODIES_OF_KNOWN_CURVATURE[body](400).surface)  # loads the kernels
    shaken = known.surface.vertices + noise * BODY_SIZE * np.random.default_rng(seed).standard_normal(
        (len(known.k1), 3)
    )
    begin = perf_counter()
    k1, k2 = compute(Surface(shaken, known.surface.faces))
    seconds = perf_counter() - begin
    inside, largest = known.interior, max(np.abs(known.k1).max(), np.abs(known.k2).max())
    error = np.maximum(np.abs(k1 - known.k1), np.abs(k2 - known.k2))[inside] / largest
    finer, truly = (
        np.maximum(np.abs(a), np.abs(b)) > 1 / CURVATURE_TIP_RADIUS for a, b in ((k1, k2), (known.k1, known.k2))
    )
    return CurvatureAccuracy(
        method,
        body,
        len(known.k1),
        noise,
        float(np.nanmedian(error)),
        float(np.nanquantile(error, 0.95)),
        float((finer != truly)[inside].mean()),
        float(np.isfinite(error).mean()),
        seconds,
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
    )


def curvature_table(lines: Iterable[CurvatureAccuracy]) -> Iterator[str]:
    """One line for each case as it comes."""
    yield (
        f"{'method':32}{'body':7}{'vertices':>9}{'noise':>7}{'median':>10}{'p95':>10}{'wrong side':>12}"
        f"{'valid':>7}{'points/s':>10}{'MB':>6}"
    )
    for e in lines:
        yield (
            f"{e.method:32}{e.body:7}{e.vertices:9}{e.noise:7.0e}{e.median:10.1e}{e.p95:10.1e}{e.wrong_side:12.1e}"
            f"{e.valid:7.3f}{e.vertices / e.seconds:10.0f}{e.memory / 1e6:6.0f}"
        )


def write_bench(lines: list[CurvatureAccuracy], out: Path) -> list[Path]:
    """The lines as CSV and JSON, and a picture, in a folder that is made if absent."""
    out.mkdir(parents=True, exist_ok=True)
    rows = [asdict(line) for line in lines]
    text = "\n".join([",".join(rows[0]), *(",".join(_cell(v) for v in row.values()) for row in rows)]) + "\n"
    return [
        write_whole(out / "curvature.csv", text.encode()),
        write_whole(out / "curvature.json", json.dumps(rows, indent=1).encode()),
        write_whole(out / "curvature.png", picture(lines)),
    ]


def _cell(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:.6g}"


def picture(lines: list[CurvatureAccuracy]) -> bytes:
    """PNG: median and 95th percentile of each method over the noise, one panel a body, smallest meshes."""
    fewest = min(line.vertices for line in lines)
    bodies = list(dict.fromkeys(line.body for line in lines if line.vertices < 1.1 * fewest))
    methods = list(dict.fromkeys(line.method for line in lines))
    palette = dict(zip(methods, [ESTIMATED, "#2f6690", "#9fb3c8", "#627d98", "#243b53", "#d9a441"], strict=False))
    with styled():
        figure = new_figure(9.0, 4.2)
        for axes, body in zip(figure.subplots(1, len(bodies), squeeze=False)[0], bodies, strict=True):
            for k, method in enumerate(methods):
                mine = [e for e in lines if (e.method, e.body) == (method, body) and e.vertices < 1.1 * fewest]
                # zero has no place on a logarithm: it stands at the left, apart
                x = [(e.noise or 1e-5) * 1.04 ** (k - 2) for e in mine]
                low, high = [e.median for e in mine], [e.p95 for e in mine]
                width = 2.6 if method == "explore3d" else 1.2
                axes.vlines(x, low, high, color=palette[method], lw=width)
                axes.plot(x, low, "o-", ms=4, color=palette[method], lw=width, label=method)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xticks([1e-5, 1e-4, 1e-3, 1e-2], ["0", "1e-4", "1e-3", "1e-2"])
            axes.minorticks_off()
            axes.set_xlabel("noise / size")
            axes.set_ylabel("error / largest curvature")
            axes.set_title(f"{body}, {mine[0].vertices} vertices: median (dot) to 95 % (line)")
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        return png(figure)
