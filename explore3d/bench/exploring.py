"""Exploration bench: error of the found extents against finger time, for exploring and for blind baselines.

Every run is one line of a JSONL file; what is already in the file is not run again.

    explore3d bench explore --store OUT.jsonl --seeds 3 --scenes straight,empty
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from explore3d.analysis import Comparison, TrueFeature, compare
from explore3d.bench.scenes import SCENES, BenchScene
from hw import Move
from hw.simulated import SimulatedFinger
from mapping import Trace
from mapping.assembly import assemble
from mapping.base import Base, estimate_pose, refined as base_refined
from mapping.detection import detect
from mapping.inference import refine_all
from mapping.instrument import Noise
from mapping.model import ObjectModel
from planners import Plan, drive
from planners.explore import Discover, Explore, Locate
from planners.survey import Ergodic, RandomSweeps, Raster, fastest_speed

TIP_RADIUS = 0.01
# Wanted half-width of the 90 % interval of an end, m: as good as it gets while nobody knows whether an end is round or
# square (0.03 mm for the wire); and others, for the curve of error against time
PRECISION, CURVE_PRECISIONS = 0.05e-3, (0.02e-3, 0.1e-3, 0.2e-3)
# Speeds between which everyone may sweep, m/s: the paper's, and one at which a tip of 0.1 kg on a contact of 1e5 N/m
# still keeps contact over the wire and lags by at most 0.012 mm behind the rigid trace (hw.simulated.dynamics)
SLOW, FAST = 0.03, 0.1
# The apparatus of the paper (theory section 1.1), and one whose noise is correlated over as much as a wire disturbs
APPARATUS: dict[str, Any] = {"rate": 5000.0, "white": 0.2e-3, "correlated": 0.02e-3, "correlation_length": 1e-3}
FINGER_NOISES = {"apparatus": APPARATUS, "correlated": APPARATUS | {"correlated": 0.06e-3, "correlation_length": 2e-3}}

Strategy = Callable[[BenchScene, np.random.Generator], Plan]


def _explore(precision: float) -> Strategy:
    return lambda scene, rng: _exploration(scene, precision)


def _exploration(scene: BenchScene, precision: float) -> Plan:
    """Find the base and explore it; the outcome's value is the base."""
    base = Base(scene.base)
    if scene.misplaced:
        locate = Locate(base=base, tip_radius=TIP_RADIUS, smallest=scene.smallest, speed=_speed(scene))
        located = yield from locate.plan()
        if located.value is None:
            return located
        base = located.value.moved(base)
    if scene.sides:
        low, high = scene.region
        discover = Discover(
            low=low, high=high, tip_radius=TIP_RADIUS, smallest=scene.smallest, sides=scene.sides, speed=_speed(scene)
        )
        discovered = yield from discover.plan()
        if discovered.value is None:
            return discovered
        base = discovered.value
    explore = Explore(
        base=base,
        tip_radius=TIP_RADIUS,
        smallest=scene.smallest,
        shortest_ridge=scene.shortest_ridge,
        precision=precision,
        speed=_speed(scene),
    )
    explored = yield from explore.plan()
    return replace(explored, value=base)


def _speed(scene: BenchScene) -> float:
    """As fast as the apparatus, by its data sheet, still sees the smallest feature asked for, m/s."""
    noise = Noise(APPARATUS["white"], APPARATUS["correlated"], APPARATUS["correlation_length"])
    return fastest_speed(noise, APPARATUS["rate"], TIP_RADIUS, scene.smallest, SLOW, FAST)


def _raster(pitch: float, speed: float) -> Strategy:
    return lambda scene, rng: Raster(base=Base(scene.base), tip_radius=TIP_RADIUS, pitch=pitch, speed=speed).plan(rng)


def _random(seconds: float, speed: float) -> Strategy:
    return lambda scene, rng: RandomSweeps(
        base=Base(scene.base), tip_radius=TIP_RADIUS, seconds=seconds, speed=speed
    ).plan(rng)


def _ergodic(seconds: float, speed: float) -> Strategy:
    return lambda scene, rng: Ergodic(base=Base(scene.base), tip_radius=TIP_RADIUS, seconds=seconds, speed=speed).plan(
        rng
    )


def _strategies() -> dict[str, Strategy]:
    """Exploring to several precisions, and every baseline at both speeds."""
    known = {"explore": _explore(PRECISION)}
    known |= {f"explore to {1e3 * precision:g} mm": _explore(precision) for precision in CURVE_PRECISIONS}
    for speed, ending in ((SLOW, ""), (FAST, f" at {1e3 * FAST:g} mm/s")):
        known |= {f"raster {1e3 * p:g} mm{ending}": _raster(p, speed) for p in (8e-3, 4e-3, 2e-3, 1e-3, 0.5e-3)}
        known |= {f"random {s:g} s{ending}": _random(s, speed) for s in (90.0, 180.0, 360.0)}
        known |= {f"ergodic {s:g} s{ending}": _ergodic(s, speed) for s in (90.0, 180.0, 360.0)}
    return known


STRATEGIES = _strategies()


def bench_exploring(
    scenes: list[str], strategies: list[str], seeds: int, out: Path, noise: str = "apparatus", seconds: float = np.inf
) -> Iterator[dict[str, Any]]:
    """Run what is not yet in `out` and append it there, until so many seconds have passed; yields every new record."""
    begin = perf_counter()
    done = {tuple(record[key] for key in ("scene", "strategy", "noise", "seed")) for record in records(out)}
    for seed in range(seeds):
        for scene in scenes:
            for strategy in strategies:
                if (scene, strategy, noise, seed) in done:
                    continue
                if perf_counter() - begin > seconds:
                    return
                body = SCENES[scene](np.random.default_rng(seed))
                record = {"scene": scene, "strategy": strategy, "noise": noise, "seed": seed}
                record |= one_run(body, strategy, seed, noise)
                with out.open("a") as file:
                    file.write(json.dumps(record) + "\n")
                yield record


def records(store: Path) -> list[dict[str, Any]]:
    """The finished runs in a store; none if there is no such file."""
    return [json.loads(text) for text in store.read_text().splitlines()] if store.exists() else []


def one_run(body: BenchScene, strategy: str, seed: int, noise: str = "apparatus") -> dict[str, Any]:
    """Sweep the body by one strategy, build its model, and compare it with the truth."""
    finger = SimulatedFinger(object=body.object, tip_radius=TIP_RADIUS, seed=seed, **FINGER_NOISES[noise])
    clock = _Clock(finger)
    record, outcome = drive(STRATEGIES[strategy](body, np.random.default_rng(seed)), clock.execute)
    after = clock.idle
    trace = Trace.concatenate([felt for _, felt in record if len(felt)])
    start = perf_counter()
    model = modelled(trace, body, seed, outcome.value if body.sides else None)
    modelling = perf_counter() - start
    return {
        "finger_seconds": finger.clock,
        "planning_seconds": float(sum(clock.waits)) + after,
        "modelling_seconds": modelling,
        "latency_median": float(np.median(clock.waits[1:])),
        "latency_worst": float(max(clock.waits[1:])),
        "moves": len(record),
        "outcome": outcome.reason,
    } | errors(model, body)


def modelled(trace: Trace, body: BenchScene, seed: int, found: Base | None = None) -> ObjectModel:
    """The annotated model of all samples, by the stages of `explore3d analyze`, on the base that was found, if any."""
    base = Base(body.base) if found is None else base_refined(found, trace)
    if body.misplaced:
        base = estimate_pose(trace, base).moved(base)
    detections = detect(trace, base)
    features = assemble(detections, trace, base)
    refined = refine_all(features, trace, seed, base=base, noise=detections.noise, confirm=False)
    return ObjectModel.attach(base, tuple(f for f in refined if f.evidence.likely), provenance={})


def errors(model: ObjectModel, body: BenchScene) -> dict[str, Any]:
    """Counts of found, mistaken, missed and invented features, and the largest errors of the found ones, m."""
    pairs = compare(model, body.truth, TIP_RADIUS)
    found = [pair for pair in pairs if pair.status == "found" and pair.true and pair.found]
    ends = [error for pair in found for error in free_end_errors(pair, body.truth)]
    return {
        "true": len(body.truth),
        "found": len(found),
        "mistyped": sum(pair.true.kind != pair.found.kind for pair in found if pair.true and pair.found),
        "missed": sum(pair.status == "missed" for pair in pairs),
        "invented": sum(pair.status == "invented" for pair in pairs),
        "end_error": max(ends, default=None),
        "axis_rms": max((pair.axis_rms for pair in found if pair.true and len(pair.true.axis) > 1), default=None),
        "center_error": max((pair.axis_rms for pair in found if pair.true and len(pair.true.axis) == 1), default=None),
        "height_error": max((abs(pair.height_error) for pair in found), default=None),
    }


def free_end_errors(pair: Comparison, truth: Sequence[TrueFeature]) -> list[float]:
    """Distances of a ridge's true ends from the found ones, m; an end at which it meets another ridge is none."""
    if pair.true is None or pair.found is None or np.isnan(pair.end_error):
        return []
    mine = pair.found.axis[[0, -1]]
    others = [each.axis for each in truth if each is not pair.true]
    ends = pair.true.axis[[0, -1]]
    free = [end for end in ends if all(np.linalg.norm(axis - end, axis=1).min() > pair.true.height for axis in others)]
    return [float(np.linalg.norm(mine - end, axis=1).min()) for end in free]


class _Clock:
    """Executes moves, and keeps how long the finger waited for each of them: the simulation is no part of planning."""

    def __init__(self, finger: SimulatedFinger) -> None:
        self.finger = finger
        self.waits: list[float] = []
        self._idle = perf_counter()

    @property
    def idle(self) -> float:
        """Time since the last move ended, s."""
        return perf_counter() - self._idle

    def execute(self, move: Move) -> Trace:
        self.waits.append(self.idle)
        trace = self.finger.execute(move)
        self._idle = perf_counter()
        return trace
