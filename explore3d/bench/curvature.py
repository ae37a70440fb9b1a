"""Curvature bench: error, speed and memory on bodies of known curvature, beside libigl, pymeshlab and a plain jet."""

from __future__ import annotations

import importlib.util
import json
import resource
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from explore3d.bench.scenes import CURVED_BODIES, SAMPLINGS, curved_body
from explore3d.bench.trace import bump_mesh
from explore3d.pictures import ESTIMATED, new_figure, png, styled
from mapping import BoolArray, FloatArray, Surface
from mapping.geometry.curvature import Curvature, principal_curvatures
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


# Seeds that constants of the method were set with, and those that are reported.
CURVATURE_TUNING_SEEDS, CURVATURE_SEEDS = (1, 5, 6, 7), (101, 102, 103)
# Standard deviations to either side of a 90 % interval.
NINETY = 1.645
# The apex: this share of the judged vertices, those of the largest true curvature.
APEX_SHARE = 0.01


@dataclass(frozen=True)
class CurvatureCell:
    """One method on one body, sampling and noise, all seeds together; errors / the body's largest curvature.

    Errors are the larger of those of k1 and k2, at the judged vertices where explore3d has a valid value, for every
    method the same ones.

    Args:
        body, sampling, method: names.
        noise: standard deviation of each coordinate / size of the body.
        median, p95, apex: of the errors; `apex` is the median over the vertices of the largest true curvature.
        coverage: share of true k1 and k2 within 90 % intervals, NaN for a method that states none.
        valid: share of the judged vertices with a value.
        by_libigl: share of the valid ones that libigl answered.
    """

    body: str
    sampling: str
    noise: float
    method: str
    median: float
    p95: float
    apex: float
    coverage: float
    valid: float
    by_libigl: float


def bench_cells(methods: Iterable[str], count: int = 3, building: bool = False) -> Iterator[CurvatureCell]:
    """Every body, sampling and noise by the methods named, with so many of the seeds that are reported, or of those
    that constants may be set with."""
    methods, seeds = list(methods), (CURVATURE_TUNING_SEEDS if building else CURVATURE_SEEDS)[:count]
    for body, sampling, noise in product(CURVED_BODIES, SAMPLINGS, RELATIVE_NOISES):
        yield from measure_cell(body, sampling, noise, methods, seeds)


def measure_cell(
    body: str, sampling: str, noise: float, methods: Iterable[str], seeds: Iterable[int]
) -> list[CurvatureCell]:
    """One cell by each of the methods."""
    known = [curved_body(body, sampling, noise * BODY_SIZE, seed) for seed in seeds]
    ours = [principal_curvatures(each.surface) for each in known]
    lines = []
    for method in methods:
        found = ours if method == "explore3d" else [_found(method, each.surface) for each in known]
        errors, apex, covered, valid = [], [], [], []
        for each, one, auto in zip(known, found, ours, strict=True):
            size = np.maximum(np.abs(each.k1), np.abs(each.k2))
            both = np.abs(np.stack([one.k1 - each.k1, one.k2 - each.k2]))
            here = each.interior & auto.valid
            top = size >= np.quantile(size[each.interior], 1 - APEX_SHARE)
            errors.append(both.max(axis=0)[here] / size.max())
            apex.append(both.max(axis=0)[here & top] / size.max())
            if np.isfinite(one.sd).any():
                covered.append((both < NINETY * one.sd)[:, here & np.isfinite(one.k1)].ravel())
            valid.append(np.isfinite(one.k1)[each.interior])
        by = [one.answered_by[one.valid] == "libigl" for one in found if len(one.answered_by)]
        error, tops = np.concatenate(errors), np.concatenate(apex)
        lines.append(
            CurvatureCell(
                body,
                sampling,
                noise,
                method,
                float(np.nanmedian(error)),
                float(np.nanquantile(error, 0.95)),
                float(np.nanmedian(tops)) if np.isfinite(tops).any() else float("nan"),
                float(np.concatenate(covered).mean()) if covered else float("nan"),
                float(np.concatenate(valid).mean()),
                float(np.concatenate(by).mean()) if by else 0.0,
            )
        )
    return lines


def _found(method: str, surface: Surface) -> Curvature:
    if method == "jets alone":
        return principal_curvatures(surface, "jet")
    k1, k2 = COMPARED_METHODS[method](surface)
    none = np.full(len(k1), np.nan)
    return Curvature(k1, k2, np.full((len(k1), 3), np.nan), np.full((len(k1), 3), np.nan), none, np.isfinite(k1))


def cell_table(cells: Iterable[CurvatureCell]) -> Iterator[str]:
    """One line for each method and cell as it comes."""
    yield (
        f"{'body':10}{'sampling':10}{'noise':>6}  {'method':31}{'median':>9}{'p95':>9}{'apex':>9}"
        f"{'coverage':>9}{'valid':>7}{'libigl':>7}"
    )
    for c in cells:
        yield (
            f"{c.body:10}{c.sampling:10}{c.noise:6.0e}  {c.method:31}{c.median:9.1e}{c.p95:9.1e}{c.apex:9.1e}"
            f"{c.coverage:9.3f}{c.valid:7.3f}{c.by_libigl:7.3f}"
        )


def cell_verdicts(cells: Iterable[CurvatureCell]) -> Iterator[str]:
    """In how many cells the intervals cover, and explore3d is no worse than the best of the others."""
    rows: dict[tuple[str, str, float], dict[str, CurvatureCell]] = {}
    for c in cells:
        rows.setdefault((c.body, c.sampling, c.noise), {})[c.method] = c
    ours = [row["explore3d"] for row in rows.values()]
    for allowed in (0.03, 0.06):
        held = sum(abs(c.coverage - 0.9) <= allowed for c in ours)
        yield f"coverage 90 +- {100 * allowed:.0f} %: {held} of {len(ours)} cells"
    for measure in ("median", "p95", "apex"):
        pairs = [
            (getattr(row["explore3d"], measure), [getattr(c, measure) for c in row.values() if not _is_ours(c.method)])
            for row in rows.values()
        ]
        told = [(mine, np.nanmin(others)) for mine, others in pairs if np.isfinite(mine) and np.isfinite(others).any()]
        yield f"{measure} at most the best peer's: {sum(mine <= best for mine, best in told)} of {len(told)} cells"


def _is_ours(method: str) -> bool:
    return method in ("explore3d", "jets alone")


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


def _ours(surface: Surface, method: str = "auto", **settings: Any) -> tuple[FloatArray, FloatArray]:
    found = principal_curvatures(surface, method, **settings)
    return found.k1, found.k2


Method = Callable[[Surface], tuple[FloatArray, FloatArray]]
BODIES_OF_KNOWN_CURVATURE: dict[str, Callable[[int], Known]] = {"bump": bump, "torus": torus}
COMPARED_METHODS: dict[str, Method] = {
    "explore3d": _ours,
    "plain jet, degree 4, 48 points": partial(_ours, method="jet", neighbours=48, degree=4),
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


def write_cells(cells: list[CurvatureCell], out: Path) -> list[Path]:
    """The cells as CSV and JSON, in a folder that is made if absent; what a method does not state is null in JSON."""
    out.mkdir(parents=True, exist_ok=True)
    rows = [asdict(cell) for cell in cells]
    text = "\n".join([",".join(rows[0]), *(",".join(_cell(v) for v in row.values()) for row in rows)]) + "\n"
    plain = [{name: None if value != value else value for name, value in row.items()} for row in rows]
    return [
        write_whole(out / "curvature_cells.csv", text.encode()),
        write_whole(out / "curvature_cells.json", json.dumps(plain, indent=1).encode()),
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
