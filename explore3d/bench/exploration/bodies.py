"""Bodies: is all of a body explored that can be, safely, and is what lies on it found? Through `explore3d run` itself.

Each run is one line of a JSONL file; what is already in the file is not run again.

    explore3d bench bodies --store bodies.jsonl --bodies l_bracket,bowl
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

from explore3d import count_text
from explore3d.analysis import Analysis
from explore3d.bench.exploration.body_judge import Judge, anchors_right, refusals
from explore3d.bench.scenes import any_body
from explore3d.jobs import plan_scene, run
from explore3d.log import read_log
from mapping.inference.kinds import kind_named


def bench_bodies(
    bodies: Sequence[str],
    seeds: Sequence[int],
    store: Path,
    folder: Path | None = None,
    keep: Path | None = None,
    seconds: float = np.inf,
) -> Iterator[dict[str, Any]]:
    """Run what is not yet in the store and append it there, until so many seconds have passed; yields new records.

    Args:
        bodies: of explore3d.bench.scenes.ANY_BODIES.
        seeds: of the details' places and the noise.
        store: JSONL file.
        folder: of the published bodies' files.
        keep: where the sessions stay; None: nowhere.
    """
    begin = perf_counter()
    done = {(each["body"], each["seed"]) for each in body_records(store)}
    for seed in seeds:
        for body in bodies:
            if (body, seed) in done:
                continue
            if perf_counter() - begin > seconds:
                return
            with TemporaryDirectory() as passing:
                place = (keep or Path(passing)) / f"{body}-{seed}"
                record = {"body": body, "seed": seed} | body_run(body, seed, folder, place)
            with store.open("a") as file:
                file.write(json.dumps(record) + "\n")
            yield record


def body_records(store: Path) -> list[dict[str, Any]]:
    """The finished runs in a store; none if there is no such file."""
    return [json.loads(text) for text in store.read_text().splitlines()] if store.exists() else []


def body_run(name: str, seed: int, folder: Path | None, place: Path) -> dict[str, Any]:
    """Plan and run a body's scene, and judge the run by the true object."""
    body, text = any_body(name, seed, folder)
    scene = body.write(text, place / "scene")
    plan = plan_scene(scene)
    analysis = run(scene, place / "out", overwrite=True)
    assert analysis.computing is not None  # it was run now
    assert plan.detail is not None and plan.detail.bump is not None  # the finger is simulated, bumps are looked for
    bumps = sum(not kind_named(true.kind).line for true in body.truth)
    return {
        "planned_seconds": plan.seconds,
        "planned_details": bumps * plan.detail.bump + (len(body.truth) - bumps) * plan.detail.ridge,
        "planned_swept": None if plan.account is None else plan.account.swept,
        **asdict(analysis.computing),
    } | judged(analysis, *(Judge(each, analysis.trace.tip_radius) for each in (body.object, body.base)))


def judged(analysis: Analysis, judge: Judge, bare: Judge) -> dict[str, Any]:
    """What a run was worth, by its log and its model against the true object.

    Args:
        judge: of the true object.
        bare: of the body without details: a feature can be reached where the ball can rest on that.
    """
    assert analysis.folder is not None  # a run writes one
    log = read_log(analysis.folder / "log.mcap")
    moves = [event.data for event in log.events if event.kind == "move"]
    trace, account = log.trace, analysis.account
    assert account is not None  # every body's scene says what to inspect
    sweeps = [trace.centers[trace.sweep == number] for number in np.unique(trace.sweep)]
    ball, stem = judge.sinking(moves, sweeps)
    rows = analysis.errors
    known = [row for row in rows if row.true is not None and bare.feature_reachable(row.true)]
    found = [row for row in known if row.status == "found"]
    return {
        "finger_seconds": float(trace.t[-1]),
        "sweep_metres": account.swept_path,
        "account_swept": account.swept,
        "account_unswept": account.unswept,
        "can_be_reached": float(judge.asked[2][judge.reachable].sum() / judge.asked[2].sum()),
        "swept": judge.share(judge.swept(trace.centers[::SWEPT_EVERY], account.reach)),
        **refusals(log.events),
        "causes": dict(account.causes),
        "ball_sank": ball,
        "stem_sank": stem,
        "reachable_features": len(known),
        "found": len(found),
        "named": sum(row.true.kind == row.found.kind for row in found if row.true and row.found),
        "missed": [row.true.kind for row in known if row.status == "missed" and row.true],
        "invented": [row.found.kind for row in rows if row.status == "invented" and row.found],
        "anchors_right": anchors_right(analysis, judge.tip_radius),
        "axis_rms": max((row.axis_rms for row in found), default=None),
        "stages": dict(analysis.timings),
        "ended": analysis.ended,
        "stopped": None if analysis.stopped is None else analysis.stopped.text,
    }


# Of the samples, 0.03 mm apart, every so many are asked for what they touched
SWEPT_EVERY = 5


def body_lines(records: Sequence[dict[str, Any]]) -> Iterator[str]:
    """The table of all runs in Markdown, and what they come to."""
    yield "| body | seed | reachable swept, % | refused, twice | ball sank, r | found | invented | finger, s | planning + modelling, CPU s | waits, ms | planned swept, % | planned time, s |"  # noqa: E501
    yield "|---|---|---|---|---|---|---|---|---|---|---|---|"
    for each in records:
        planned = "" if each["planned_swept"] is None else f"{100 * each['planned_swept']:.1f}"
        yield (
            f"| {each['body']} | {each['seed']} | {100 * each['swept']:.1f} | "
            f"{each['refused']} of {each['moves'] + each['refused']}, {each['refused_twice']} | "
            f"{each['ball_sank']:.3f} | {each['found']} of {each['reachable_features']} | {len(each['invented'])} | "
            f"{each['finger_seconds']:.0f} | {each['planning']:.0f} + {each['modelling']:.0f} | "
            f"{1e3 * each['median_wait']:.0f}, {1e3 * each['worst_wait']:.0f} | "
            f"{planned} of {100 * each['account_swept']:.1f} | "
            f"{each['planned_seconds']:.0f} + {each['planned_details']:.0f} |"
        )
    if records:
        found, there = (sum(each[name] for each in records) for name in ("found", "reachable_features"))
        moves, refused = (sum(each[name] for each in records) for name in ("moves", "refused"))
        invented, metres = (sum(len(e["invented"]) for e in records), sum(e["sweep_metres"] for e in records))
        yield ""
        yield (
            f"{count_text(len(records), 'run')}: {found} of {there} features found, {invented} invented on "
            f"{metres:.0f} m, {refused} of {moves + refused} moves refused, "
            f"least swept {100 * min(e['swept'] for e in records):.1f} %"
        )
