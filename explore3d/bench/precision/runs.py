"""Error against time of exploring, and of whole runs: the finger's seconds and the computer's apart."""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

from explore3d.bench.exploration import STRATEGIES, one_run
from explore3d.bench.precision.work_precision import LeftOutMethod, Point, Stage
from explore3d.bench.scenes import SCENES

Result = list[Point | LeftOutMethod]

SCENE = Path(__file__).parents[3] / "assets" / "scenes" / "wire_on_plate.toml"
QUICK_STRATEGIES = 2
ASKED_PRECISIONS = ("0.8 mm", "0.4 mm", "0.2 mm", "0.1 mm", "0.05 mm")
QUICK_PRECISION, QUICK_RATE = "0.4 mm", "1 kHz"


def exploration(quick: bool, peers: bool) -> Result:
    """The extents of a wire of unknown place: exploring, and blind sweeping of the same plate."""
    out: Result = []
    names = list(STRATEGIES)
    for name in names[:QUICK_STRATEGIES] if quick else names:
        found = [
            one_run(SCENES["straight"](np.random.default_rng(seed)), name, seed) for seed in range(1 if quick else 3)
        ]
        ends = [record["end_error"] for record in found]
        if any(end is None for end in ends):
            why = f"the wire was not found in {sum(end is None for end in ends)} of {len(ends)} runs"
            out.append(LeftOutMethod("exploration", name, why))
            continue
        computing = [record["planning_seconds"] + record["modelling_seconds"] for record in found]
        finger = float(np.median([record["finger_seconds"] for record in found]))
        error = float(np.median(ends))
        out.append(Point("exploration", name, f"{finger:.0f} s of the finger", float(np.median(computing)), error,
                         len(found), finger))  # fmt: skip
    if quick:
        out.append(LeftOutMethod("exploration", ", ".join(names[QUICK_STRATEGIES:]), "left out by --quick"))
    return out


def whole_runs(quick: bool, peers: bool) -> Result:
    """`explore3d run` of the paper's wire for ever finer precision: everything, from the scene to the report."""
    if not SCENE.is_file():
        return [LeftOutMethod("whole runs", "explore3d run", f"{SCENE} is not there: run it in a checkout")]
    from explore3d.jobs import run
    from explore3d.scene import parse_scene

    out: Result = []
    text = SCENE.read_text("utf-8")
    rate = QUICK_RATE if quick else "5 kHz"
    text = text.replace('rate = "5 kHz"', f'rate = "{rate}"')
    for precision in (QUICK_PRECISION,) if quick else ASKED_PRECISIONS:
        scene = parse_scene(text.replace('precision = "0.1 mm"', f'precision = "{precision}"'), SCENE)
        with tempfile.TemporaryDirectory() as folder:
            begin = perf_counter()
            analysis = run(scene, Path(folder) / "run")
            seconds = perf_counter() - begin
        ends = [row.end_error for row in analysis.errors if np.isfinite(row.end_error)]
        finger = float(analysis.trace.t[-1] - analysis.trace.t[0])
        if not ends:
            out.append(LeftOutMethod("whole runs", "explore3d run", f"{precision}: the wire was not found"))
            continue
        out.append(Point("whole runs", "explore3d run", f"{precision} asked, {rate}", seconds, max(ends), 1, finger))
    if quick:
        left = ", ".join(each for each in ASKED_PRECISIONS if each != QUICK_PRECISION)
        out.append(LeftOutMethod("whole runs", f"asked for {left}, at 5 kHz", "left out by --quick"))
    return out


RUN_STAGES = (
    Stage("exploration", "error of the wire's ends (m)", "The wire as it was laid down.",
          "Time of the finger is what an experiment costs: following what was found beats sweeping everything, at any "
          "error. Computing is a small part of it.", exploration),
    Stage("whole runs", "error of the wire's ends (m)", "The truth of the scene wire_on_plate.toml.",
          "What asking for more precision costs, scene to report.", whole_runs),
)  # fmt: skip
