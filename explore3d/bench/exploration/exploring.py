"""Exploration bench: error of the found extents against finger time, for exploring and for blind baselines.

Each body is a scene whose meshes stay in memory; finger and explorer are made from it as `explore3d run` makes them
(explore3d.jobs.expedition), and what was felt goes into the model by the same stages (build_model), without a log.
Every run is one line of a JSONL file; what is already in the file is not run again.

    explore3d bench explore --store OUT.jsonl --seeds 3 --scenes straight,empty
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from explore3d.analysis import Comparison, Stages, TrueFeature, build_model, compare
from explore3d.bench.scenes import BENCH_TIP_RADIUS, SCENES, BenchScene
from explore3d.jobs import Explored, Explorer, Waits, explorer, scene_finger
from explore3d.log import Event, Log, move_event
from explore3d.scene import Scene
from hw import Finger, Move
from hw.simulated import TOP_SPEED_RADII, SimulatedFinger
from mapping import Trace
from mapping.base import Base
from mapping.geometry.mesh import algebra_in_one_thread
from mapping.model import ObjectModel
from planners import Outcome, Plan
from planners.survey import Ergodic, RandomSweeps, Raster

# Wanted half-width of the 90 % interval of an end, m: as good as it gets while nobody knows whether an end is round or
# square (0.03 mm for the wire); and others, for the curve of error against time
PRECISION, CURVE_PRECISIONS = 0.05e-3, (0.02e-3, 0.1e-3, 0.2e-3)
# Speeds at which baselines sweep, m/s: the paper's; one at which a tip of 0.1 kg on a contact of 1e5 N/m still keeps
# contact over the wire and lags by at most 0.012 mm behind the rigid trace (hw.simulated.dynamics); and the rigid
# finger's own limit, which exploring takes, whose scenes name no speed
SLOW, FAST, FULL = 0.03, 0.1, TOP_SPEED_RADII * BENCH_TIP_RADIUS
# The apparatus of the paper (theory section 1.1), and one whose noise is correlated over as much as a wire disturbs
APPARATUS: dict[str, float] = {"rate": 5000.0, "white": 0.2e-3, "correlated": 0.02e-3, "correlation_length": 1e-3}
FINGER_NOISES = {"apparatus": APPARATUS, "correlated": APPARATUS | {"correlated": 0.06e-3, "correlation_length": 2e-3}}

# Of whoever sweeps blindly: the plan of all sweeps over a base
Blind = Callable[[Base, np.random.Generator], Plan]


def _raster(pitch: float, speed: float) -> Blind:
    return lambda base, rng: Raster(base=base, tip_radius=BENCH_TIP_RADIUS, pitch=pitch, speed=speed).plan(rng)


def _random(seconds: float, speed: float) -> Blind:
    return lambda base, rng: RandomSweeps(base=base, tip_radius=BENCH_TIP_RADIUS, seconds=seconds, speed=speed).plan(
        rng
    )


def _ergodic(seconds: float, speed: float) -> Blind:
    return lambda base, rng: Ergodic(base=base, tip_radius=BENCH_TIP_RADIUS, seconds=seconds, speed=speed).plan(rng)


def _baselines() -> dict[str, Blind]:
    """Every baseline at every speed."""
    known: dict[str, Blind] = {}
    for speed in (SLOW, FAST, FULL):
        ending = "" if speed == SLOW else f" at {1e3 * speed:g} mm/s"
        known |= {f"raster {1e3 * p:g} mm{ending}": _raster(p, speed) for p in (8e-3, 4e-3, 2e-3, 1e-3, 0.5e-3)}
        known |= {f"random {s:g} s{ending}": _random(s, speed) for s in (90.0, 180.0, 360.0)}
        known |= {f"ergodic {s:g} s{ending}": _ergodic(s, speed) for s in (90.0, 180.0, 360.0)}
    return known


# Exploring, by the precision that it is asked for, m; and the baselines
EXPLORING = {"explore": PRECISION} | {f"explore to {1e3 * wanted:g} mm": wanted for wanted in CURVE_PRECISIONS}
BASELINES = _baselines()
STRATEGIES = (*EXPLORING, *BASELINES)


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


def write_bench_scenes(scenes: list[str], seeds: int, folder: Path, noise: str = "apparatus") -> Iterator[Path]:
    """Write what "explore" runs on as scene files with their meshes, for `explore3d run`; yields every scene file."""
    for name in scenes:
        for seed in range(seeds):
            body = SCENES[name](np.random.default_rng(seed))
            text = body.text(seed, FINGER_NOISES[noise], PRECISION)
            yield body.write(text, folder / f"{name.replace(' ', '_')}-{seed}")


def bench_scene(body: BenchScene, strategy: str, seed: int, noise: str = "apparatus") -> Scene:
    """The scene of one run; the precision is exploring's, baselines have none."""
    return body.scene(body.text(seed, FINGER_NOISES[noise], EXPLORING.get(strategy, PRECISION)))


@algebra_in_one_thread()
def one_run(body: BenchScene, strategy: str, seed: int, noise: str = "apparatus") -> dict[str, Any]:
    """Sweep the body by one strategy, build its model, and compare it with the truth; as `run` does, in one thread."""
    scene = bench_scene(body, strategy, seed, noise)
    with scene_finger(scene) as finger:
        assert isinstance(finger, SimulatedFinger)  # every bench scene names it
        clock = _Clock(finger)
        outcome = _swept(strategy, explorer(scene, finger.workspace), body, clock, seed)
    clock.waits.ended()
    start = process_time()
    model = build_model(clock.log(), scene, outcome.value.base, Stages()).model
    modelling = process_time() - start
    return {
        "finger_seconds": finger.clock,
        "planning_seconds": clock.waits.planning,
        "modelling_seconds": modelling,
        "latency_median": clock.waits.median,
        "latency_worst": clock.waits.worst,
        "moves": len(clock.waits.each),
        "outcome": outcome.reason,
    } | errors(model, body)


def _swept(strategy: str, explorer: Explorer, body: BenchScene, clock: _Clock, seed: int) -> Outcome:
    """Explore, or sweep blindly under the same checks; the outcome's value is an Explored."""
    if strategy in EXPLORING:
        return explorer.go(clock.execute, clock.event, meanwhile=clock.waits.meanwhile)
    base = Base(body.base)
    outcome, _ = explorer.carry_out(BASELINES[strategy](base, np.random.default_rng(seed)), base, clock.execute)
    return Outcome(outcome.reason, outcome.detail, Explored(base))


def errors(model: ObjectModel, body: BenchScene) -> dict[str, Any]:
    """Counts of found, mistaken, missed and invented features, and the largest errors of the found ones, m."""
    pairs = compare(model, body.truth, BENCH_TIP_RADIUS)
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
    """Executes moves, keeps how long the finger waited for each of them, and what a log would hold, in memory."""

    def __init__(self, finger: Finger) -> None:
        self.waits = Waits(finger.execute, finger.workspace.max_speed)
        self.felt: list[Trace] = []
        self.events: list[Event] = []
        self._samples = 0

    def execute(self, move: Move) -> Trace:
        before = float(self.felt[-1].t[-1]) if self.felt else None
        trace = self.waits(move)
        self.events.append(move_event(move, before, self._samples, len(trace)))
        if len(trace):
            self.felt.append(trace)
            self._samples += len(trace)
        return trace

    def event(self, kind: str, data: dict[str, Any]) -> None:
        """Note something beside the samples."""
        self.events.append(Event(kind, float(self.felt[-1].t[-1]) if self.felt else None, data))

    def log(self) -> Log:
        """What was recorded, as the log of a run would give it."""
        return Log(Trace.concatenate(self.felt), events=tuple(self.events))
