"""Wrong models: is the cause named, is anything invented, and what does it cost the finger, where the mesh is wrong?

Each run explores and builds its model as `explore3d run` does, without pictures and report. Every run is one line of a
JSONL file; what is already in the file is not run again.

    explore3d bench deviation --store wrong.jsonl --seeds 5
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from explore3d.analysis import Stages, build_model
from explore3d.bench.scenes import WRONGS, BenchScene, wrong_model
from explore3d.jobs import explorer, scene_finger
from explore3d.log import Event, Log
from hw import Move
from hw.simulated import SimulatedFinger
from mapping import Trace
from mapping.base import Base, Pose

# Of the finger: samples per second, and noise that leaves 5 um on a block of half a tip radius, m
WRONG_MODEL_FINGER = {"rate": 1000.0, "white": 0.03e-3, "correlated": 0.005e-3, "correlation_length": 1e-3}
WRONG_MODEL_PRECISION, WRONG_MODEL_SPEED = 0.1e-3, 0.1
# Standard deviations, by its own account, within which a pose is right that is not known to the precision
STANDS_SDS = 3.0
# The cause that a run must give for each wrong
CAUSE_OF = {
    "pose": "pose", "scale": "scale", "deformation": "deformation", "dent": "part", "missing part": "part"
}  # fmt: skip
# A plate that is larger has the same heights: nothing can be felt of it
NOT_FELT = {("plate", "scale")}


def bench_wrong_models(
    bodies: Sequence[str], wrongs: Sequence[str], seeds: int, store: Path, seconds: float = np.inf
) -> Iterator[dict[str, Any]]:
    """Run what is not yet in the store and append it there, until so many seconds have passed; yields new records."""
    begin = perf_counter()
    done = {(each["body"], each["wrong"], each["seed"]) for each in wrong_model_records(store)}
    for seed in range(1, seeds + 1):
        for body in bodies:
            for wrong in wrongs:
                if (body, wrong, seed) in done or (body, wrong) in NOT_FELT:
                    continue
                if perf_counter() - begin > seconds:
                    return
                record = {"body": body, "wrong": wrong, "seed": seed}
                record |= wrong_model_run(wrong_model(body, wrong, seed), wrong, seed)
                with store.open("a") as file:
                    file.write(json.dumps(record) + "\n")
                yield record


def wrong_model_records(store: Path) -> list[dict[str, Any]]:
    """The finished runs in a store; none if there is no such file."""
    return [json.loads(text) for text in store.read_text().splitlines()] if store.exists() else []


def wrong_model_run(body: BenchScene, wrong: str, seed: int) -> dict[str, Any]:
    """Explore a body on its wrong model, build the annotated model, and compare with the truth."""
    scene = body.scene(body.text(seed, WRONG_MODEL_FINGER, WRONG_MODEL_PRECISION, WRONG_MODEL_SPEED))
    felt: list[Trace] = []
    events: list[Event] = []
    begin = process_time()
    with scene_finger(scene) as finger:
        assert isinstance(finger, SimulatedFinger)  # every bench scene names it

        def execute(move: Move) -> Trace:
            trace = finger.execute(move)
            felt.extend([trace] if len(trace) else [])
            events.append(Event("move", None, asdict(move) | {"path": move.path.tolist()}))
            return trace

        outcome = explorer(scene, finger.workspace).go(execute)
    explored = process_time() - begin
    log = Log(Trace.concatenate(felt), events=tuple(events))
    base = outcome.value.base if body.misplaced else Base(body.base)
    if base is None:  # the finger says that the object is not where it may be
        return {"causes": [], "instead": [], "named": False, "said": outcome.detail, "outcome": outcome.reason} | {
            "found": 0, "missed": len(body.truth), "invented": 0, "finger_seconds": finger.clock
        }  # fmt: skip
    analysis = build_model(log, scene, base, Stages())
    placed = Pose.of(analysis.model.base)
    stands_off, doubt = (None, None) if placed is None else _astray(analysis.model.base, placed, body)
    right = stands_off is not None and doubt is not None and stands_off < max(WRONG_MODEL_PRECISION, STANDS_SDS * doubt)
    deviation = analysis.deviation
    causes = [] if deviation is None else list(deviation.causes)
    instead = [] if deviation is None else list(deviation.instead)
    statuses = [row.status for row in analysis.errors]
    return {
        "causes": causes,
        "instead": instead,
        "named": is_named(wrong, causes, instead) and (right or not body.misplaced),
        "stands_off": stands_off,
        "doubt": doubt,
        "observable": None if placed is None else placed.observable,
        "said": "" if deviation is None else deviation.sentence(),
        "beyond_repair": deviation is not None and deviation.beyond_repair,
        "found": statuses.count("found"),
        "missed": statuses.count("missed"),
        "invented": statuses.count("invented"),
        "invented_kinds": [row.found.kind for row in analysis.errors if row.status == "invented" and row.found],
        "finger_seconds": finger.clock,
        "exploring_cpu": explored,
        "modelling_cpu": process_time() - begin - explored,
        "deviation_seconds": analysis.timings.get("deviation", 0.0),
        "outcome": outcome.reason,
    }


def _astray(base: Base, pose: Pose, body: BenchScene) -> tuple[float, float]:
    """Farthest that a vertex of the model is from where it really is, and the pose's own standard deviation of that, m.

    But for motions that the pose says are not known, a plane's sliding in itself, for example: those are the directions
    in which its covariance is as wide as the bound.
    """
    truth = body.object.vertices[: len(body.base.vertices)]
    arm = base.surface.vertices - pose.onto(pose.center[None])
    length = float(np.sqrt((arm**2).sum(axis=1).mean()))
    scale = np.array([length] * 3 + [1.0] * 3)
    variances, motions = np.linalg.eigh(pose.covariance * np.outer(scale, scale))
    # (6, N, 3) what each motion of length one does to the vertices
    moved = np.stack([np.cross(each[:3], arm) + each[3:] for each in (motions / scale[:, None]).T])
    known, unknown = moved[: pose.observable], moved[pose.observable :]
    off = (base.surface.vertices - truth).ravel()
    rows = unknown.reshape(len(unknown), off.size).T
    off = (off - rows @ np.linalg.lstsq(rows, off, rcond=None)[0]).reshape(-1, 3)
    doubt = np.einsum("k,knx->n", variances[: pose.observable], known**2)
    return float(np.linalg.norm(off, axis=1).max()), float(np.sqrt(doubt.max()))


def is_named(wrong: str, causes: Sequence[str], instead: Sequence[str]) -> bool:
    """True if the cause is named, or one that cannot be told from it, and none of another sort; nothing where none is.

    A bent body is turned and shifted in the mean as well: beside a deformation a rigid cause may stand.
    """
    if wrong not in CAUSE_OF:
        return not causes
    cause = CAUSE_OF[wrong]
    others = {"deformation", "part"} - {cause}
    return (cause in causes or cause in instead) and not others & {*causes}


def wrong_model_lines(records: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A line for each wrong: runs, share named, invented and missed a run, finger time against the right mesh."""
    right = {(each["body"], each["seed"]): each["finger_seconds"] for each in records if each["wrong"] == "nothing"}
    for wrong in WRONGS:
        runs = [each for each in records if each["wrong"] == wrong]
        if not runs:
            continue
        known = [each for each in runs if (each["body"], each["seed"]) in right]
        ratio = [each["finger_seconds"] / right[each["body"], each["seed"]] for each in known]
        times = f", finger time {np.median(ratio):.2f} (worst {max(ratio):.2f}) of the right mesh's" if ratio else ""
        yield (
            f"{wrong:13}{len(runs):4} runs, named {100 * np.mean([each['named'] for each in runs]):5.1f} %, invented "
            f"{np.mean([each['invented'] for each in runs]):.2f} a run, missed "
            f"{np.mean([each['missed'] for each in runs]):.2f}{times}"
        )
