"""Bench: error against run time of every stage that trades the one for the other; tables, pictures, one page."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

from explore3d.bench.precision import inference as bench_inference, runs as bench_runs, surfaces as bench_surfaces
from explore3d.bench.precision.bench_page import bench_page
from explore3d.bench.precision.diagram import diagram
from explore3d.bench.precision.work_precision import LeftOutMethod, Measured, Point, Stage
from explore3d.report import machine
from mapping.geometry.mesh import write_whole

PAGE = "bench.html"


def stages() -> tuple[Stage, ...]:
    """Every stage, in the order of the method."""
    return (*bench_surfaces.SURFACE_STAGES, *bench_inference.INFERENCE_STAGES, *bench_runs.RUN_STAGES)


def bench(quick: bool, peers: bool, told: Callable[[Measured], None] = lambda _: None) -> list[Measured]:
    """Measure every stage; one that fails is an omission with its reason, and the others go on."""
    measured = []
    for stage in stages():
        begin = perf_counter()
        try:
            found = stage.measure(quick, peers)
        except Exception as error:  # the page says which stage failed, and why
            found = [LeftOutMethod(stage.name, "all", f"failed: {type(error).__name__}: {error}")]
        points = tuple(each for each in found if isinstance(each, Point))
        omissions = tuple(each for each in found if isinstance(each, LeftOutMethod))
        measured.append(Measured(stage, points, omissions, perf_counter() - begin))
        told(measured[-1])
    return measured


def write(measured: Sequence[Measured], out: Path, quick: bool) -> Path:
    """Tables, a PNG and an SVG for each stage, and the page; returns the page's path."""
    out.mkdir(parents=True, exist_ok=True)
    pictures = {each.stage.name: diagram(each.stage, each.points) for each in measured if each.points}
    for name, kinds in pictures.items():
        for kind, content in kinds.items():
            write_whole(out / f"{name.replace(' ', '_')}.{kind}", content)
    write_whole(out / "bench.csv", as_csv(measured))
    write_whole(out / "bench.json", json.dumps(as_record(measured, quick), indent=1, ensure_ascii=False) + "\n")
    page = bench_page(measured, {name: kinds["png"] for name, kinds in pictures.items()}, quick)
    return write_whole(out / PAGE, page)


def as_csv(measured: Sequence[Measured]) -> str:
    """Every point, one a line."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["stage", "method", "setting", "seconds", "error", "repeats", "finger"])
    for each in measured:
        writer.writerows(asdict(point).values() for point in each.points)
    return text.getvalue()


def as_record(measured: Sequence[Measured], quick: bool) -> dict[str, Any]:
    """Everything, as JSON values: machine, points, omissions."""
    return {
        "schema": "explore3d/bench/1",
        "quick": quick,
        "machine": machine(),
        "stages": [
            {
                "name": each.stage.name, "error": each.stage.error, "reference": each.stage.reference,
                "points": [asdict(point) for point in each.points],
                "omissions": [asdict(omission) for omission in each.omissions],
            }
            for each in measured
        ],
    }  # fmt: skip


def summary(measured: Sequence[Measured]) -> str:
    """All in one line."""
    points = sum(len(each.points) for each in measured)
    omitted = sum(len(each.omissions) for each in measured)
    failed = [each.stage.name for each in measured if not each.points]
    end = f"; nothing measured for {', '.join(failed)}" if failed else ""
    seconds = sum(each.seconds for each in measured)
    return f"bench: {len(measured)} stages, {points} points, {omitted} omissions listed, {seconds:.0f} s{end}"
