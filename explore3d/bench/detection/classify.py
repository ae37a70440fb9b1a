"""Classification bench: is each kind of feature found, rightly named, and nothing invented beside it?

Every trial is one line of a JSONL file; what is already in the file is not run again. What is changed because of a
trial is judged by others: the seeds from FIRST_BUILT_WITH on, which have sweeps and sizes of their own, are built with.

    explore3d bench classify --store OUT.jsonl --seeds 100
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from explore3d.analysis import Comparison, TrueFeature, compare
from explore3d.bench.scenes import FIRST_BUILT_WITH, INSPECTED_HALF_SIDE, MIDDLE, classified_body
from hw import Move
from hw.simulated import NoiseSource, SimulatedFinger
from mapping import Feature, FloatArray, Trace
from mapping.assembly import assemble
from mapping.base import Base
from mapping.detection import detect
from mapping.inference.kinds import kind_named
from mapping.model import ObjectModel
from planners.paths import Strokes

TIP_RADIUS, SAMPLE_RATE, SPEED = 0.01, 5000.0, 0.03
PITCH = 4e-3
# The apparatus of the paper (theory section 1.1), and none.
NOISE_SOURCES = {"none": NoiseSource(), "apparatus": NoiseSource(white=0.2e-3)}
# Different placements of the sweeps over one body; further seeds only change the noise.
POSES = 10
# An axis further off than this, or longer or shorter than this, is not the feature's own, m.
MOST_AXIS_OFFSET, MOST_LENGTH_ERROR = 1.5e-3, 2.0 * PITCH
SWEEP_PATTERNS = ("one way", "two ways", "followed")


def bench_classify(
    bodies: list[str], noises: list[str], sweeps: list[str], seeds: range, out: Path
) -> Iterator[dict[str, Any]]:
    """Run what is not yet in `out` and append it there; yields every record of the request."""
    done = {}
    if out.exists():
        records = [json.loads(text) for text in out.read_text(encoding="utf-8").splitlines()]
        done = {(r["body"], r["noise"], r["sweeps"], r["seed"]): r for r in records}
    for body in bodies:
        for noise in noises:
            for pattern in sweeps:
                for seed in seeds if noise != "none" else seeds[:POSES]:
                    key = (body, noise, pattern, seed)
                    if key not in done:
                        done[key] = dict(zip(("body", "noise", "sweeps", "seed"), key, strict=True)) | trial(*key)
                        with out.open("a", encoding="utf-8") as file:
                            file.write(json.dumps(done[key]) + "\n")
                    yield done[key]


def trial(body: str, noise: str, pattern: str, seed: int) -> dict[str, Any]:
    """Sweep a body, classify what is on it, and compare with the truth."""
    pose = seed if seed < FIRST_BUILT_WITH else seed - FIRST_BUILT_WITH
    pose = seed - pose + pose % POSES
    scene = classified_body(body, pose)
    base = Base(scene.base)
    trace = noisy(touched(body, pattern, pose), NOISE_SOURCES[noise], seed)
    start = perf_counter()
    features = classified(trace, base)
    return verdict(features, base, scene.truth) | {"seconds": perf_counter() - start}


def classified(trace: Trace, base: Base) -> tuple[Feature, ...]:
    """The features that the grammar assembles of a trace's detections."""
    return assemble(detect(trace, base), trace, base)


def verdict(features: tuple[Feature, ...], base: Base, truth: tuple[TrueFeature, ...]) -> dict[str, Any]:
    """Counts of true, found, rightly named and invented features; `right` if all is as it should be."""
    pairs = compare(ObjectModel.attach(base, features, provenance={}), truth, TIP_RADIUS)
    found = [pair for pair in pairs if pair.status == "found"]
    typed = sum(_rightly_named(pair) for pair in found)
    invented = sum(pair.status == "invented" for pair in pairs)
    ends = [pair.end_error for pair in found if np.isfinite(pair.end_error)]
    return {
        "true": len(truth),
        "found": len(found),
        "typed": typed,
        "invented": invented,
        "right": typed == len(truth) and invented == 0,
        "end_error": max(ends, default=None),
        "named": [f.kind + (" closed" if f.closed else "") for f in features],
    }


def _rightly_named(pair: Comparison) -> bool:
    """True if the kind, the closing and, for lines with ends, the course and the extent are the true ones."""
    true, found = pair.true, pair.found
    assert true is not None and found is not None
    if found.kind != true.kind or found.closed != _returns(true.axis):
        return False
    if len(true.axis) == 1:
        return pair.axis_rms < MOST_AXIS_OFFSET
    endless = not kind_named(true.kind).has_ends
    return pair.axis_max < MOST_AXIS_OFFSET and (endless or abs(pair.length_error) < MOST_LENGTH_ERROR)


def _returns(axis: FloatArray) -> bool:
    return len(axis) > 2 and bool(np.allclose(axis[0], axis[-1], atol=1e-9))


def noisy(trace: Trace, noise: NoiseSource, seed: int) -> Trace:
    """The trace with the noise that the simulated finger would add, a stream of its own for each sweep."""
    centers = trace.centers.copy()
    for number in np.unique(trace.sweep):
        own = trace.sweep == number
        rng = np.random.default_rng((seed, int(number)))
        centers[own] += noise.of_centers(rng, int(own.sum()), SPEED / SAMPLE_RATE)
    return replace(trace, centers=centers)


@lru_cache(maxsize=2 * POSES)
def touched(body: str, pattern: str, pose: int) -> Trace:
    """What the finger feels of a body without noise, swept as the seed `pose` says."""
    scene = classified_body(body, pose)
    finger = SimulatedFinger(object=scene.object, tip_radius=TIP_RADIUS, rate=SAMPLE_RATE)
    rng = np.random.default_rng(pose)
    strokes = Strokes(Base(scene.base), TIP_RADIUS, SPEED)
    moves = survey(strokes, rng, two_ways=pattern != "one way")
    if pattern == "followed":
        moves += [move for true in scene.truth for move in following(true, strokes, rng)]
    return Trace.concatenate([felt for felt in map(finger.execute, moves) if len(felt)])


def survey(strokes: Strokes, rng: np.random.Generator, two_ways: bool) -> list[Move]:
    """Parallel sweeps over the window in one direction or two, turned and shifted at random."""
    heading, moves = rng.uniform(0.0, np.pi), []
    for turn in (0.0, 0.5 * np.pi)[: 2 if two_ways else 1]:
        along = np.array([np.cos(heading + turn), np.sin(heading + turn), 0.0])
        side = np.array([-along[1], along[0], 0.0])
        for offset in np.arange(-INSPECTED_HALF_SIDE, INSPECTED_HALF_SIDE, PITCH) + rng.uniform(0.0, PITCH):
            moves.append(strokes.line(MIDDLE + offset * side, along, INSPECTED_HALF_SIDE, INSPECTED_HALF_SIDE))
    return moves


def following(true: TrueFeature, strokes: Strokes, rng: np.random.Generator) -> list[Move]:
    """The sweeps that exploratory procedures make once they know about where a feature is.

    A circuit round a point of it; crossed sweeps over a bump or pit; square crossings along a line and a slide off
    each of its ends.
    """
    half = np.sqrt(2 * TIP_RADIUS * abs(true.height)) + 0.5 * (true.width or 0.0)
    middle = true.axis[len(true.axis) // 2]
    moves = [strokes.circle(middle, np.array([1.0, 0.0, 0.0]), 1.4 * half + 0.5 * PITCH, 1.2 * half)]
    if len(true.axis) == 1:
        for angle in rng.uniform(0.0, np.pi) + np.pi / 3 * np.arange(3):
            moves.append(strokes.line(middle, np.array([np.cos(angle), np.sin(angle), 0.0]), 2.5 * half, 2.5 * half))
        return moves
    legs = np.linalg.norm(np.diff(true.axis, axis=0), axis=1)
    s = np.concatenate([[0.0], np.cumsum(legs)])
    for at in np.arange(0.3 * half, s[-1], half):
        leg = min(int(np.searchsorted(s, at)), len(legs)) - 1
        along = (true.axis[leg + 1] - true.axis[leg]) / legs[leg]
        point = true.axis[leg] + (at - s[leg]) * along
        moves.append(strokes.line(point, np.cross([0.0, 0.0, 1.0], along), 2.2 * half, 2.2 * half))
    if not _returns(true.axis) and kind_named(true.kind).has_ends:
        for end, inner in ((true.axis[0], true.axis[1]), (true.axis[-1], true.axis[-2])):
            away = (end - inner) / np.linalg.norm(end - inner)
            moves.append(strokes.line(end, away, half, 2.0 * half))
    return moves


def classify_table(records: list[dict[str, Any]]) -> str:
    """One CSV line for each body, noise and pattern: shares of true features found and named, inventions, all right."""
    lines = ["body,noise,sweeps,trials,found,named,invented per trial,right,seconds"]
    groups: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for record in records:
        groups.setdefault((record["body"], record["noise"], record["sweeps"]), []).append(record)
    for key, some in groups.items():
        true = max(sum(r["true"] for r in some), 1)
        shares = [sum(r[name] for r in some) / true for name in ("found", "typed")]
        rest = [float(np.mean([r[name] for r in some])) for name in ("invented", "right", "seconds")]
        lines.append(",".join([*key, str(len(some)), *(f"{value:.3g}" for value in [*shares, *rest])]))
    return "\n".join(lines) + "\n"
