"""Calibration bench: do 90 % intervals cover 90 %, and are the ranks of the truth uniform?

Simulation-based calibration (Talts et al., arXiv:1804.06788, 2018): truths are drawn from the prior, traces are
simulated from them at the sampling rate of the apparatus and analysed by the same code as real ones; the place of each
true value within its posterior must then be uniform. Every simulation is one line of a JSONL file: an interrupted run
goes on where it stopped, and the same seeds give the same lines.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.bench.scenes import SAMPLE_SPACING, simulate_noise
from mapping import KINDS, Feature, FloatArray, Interval, Support, Surface, Trace
from mapping.base import Base
from mapping.geometry.templates import width_of_cap
from mapping.inference import Solution, pose_problem, solve_problem
from mapping.inference.families import PosteriorProblem, Surroundings
from mapping.inference.kinds import kind_named
from mapping.inference.likelihood import Normal, Prior, Uniform
from mapping.instrument import Noise

TIP_RADIUS = 10e-3
CALIBRATED_NOISES = ("white", "ell 0.3 mm", "ell 1 mm", "ell 3 mm", "low white")
CALIBRATED_KINDS = tuple(name for name in KINDS if kind_named(name).typical is not None)


@dataclass(frozen=True)
class Case:
    """One simulation: which feature, which noise, which seed.

    `assumed` names the noise that the analysis believes: "true", or "white" to show that the test can fail.
    """

    kind: str
    noise: str
    seed: int
    method: str = "importance"
    assumed: str = "true"


@dataclass(frozen=True, eq=False)
class Row:
    """What came of a case: for each parameter the share of the posterior below the truth, and how it was found."""

    case: Case
    below: dict[str, float]
    k_hat: float
    status: str


def noise_of(name: str, rng: np.random.Generator) -> Noise:
    """The noise of a condition: 0.2 mm white, 0.02 to 0.2 mm (log-uniform) white, or 0.02 mm white + 0.05 mm OU."""
    if name == "white":
        return Noise(0.2e-3)
    if name == "low white":
        return Noise(float(np.exp(rng.uniform(np.log(0.02e-3), np.log(0.2e-3)))))
    return Noise(0.05e-3, 0.05e-3, float(name.split()[1]) * 1e-3)


def run_case(case: Case) -> Row:
    """Simulate, analyse, and find the truth's place in the posterior."""
    rng = np.random.default_rng([CALIBRATED_KINDS.index(case.kind), CALIBRATED_NOISES.index(case.noise), case.seed])
    noise = noise_of(case.noise, rng)
    feature, paths = nominal(case.kind)
    blank = _blank(case.kind)
    truth = np.array([float(prior.draw(rng, 1)[0]) for prior in blank.target.shape.priors])
    feet = np.concatenate(paths)
    up = np.tile([0.0, 0.0, 1.0], (len(feet), 1))
    heights = kind_named(case.kind).heights(blank.target.shape, truth, feet, up)
    trace = record(paths, heights + simulate_noise(noise, paths, rng))
    believed = noise if case.assumed == "true" else Noise(noise.sd)
    problem = _with_priors(_about(blank, pose_problem(feature, Surroundings(trace, plate(), believed))))
    # Believing noise to be white is to show that the test can fail: the misfit test would mend it.
    solution = solve_problem(problem, rng, confirm=case.method == "emcee", adapt=case.assumed == "true")
    return Row(case, _places(solution, truth), solution.importance.k_hat, solution.posterior.status)


@cache
def _blank(kind: str) -> PosteriorProblem:
    """The problem of a feature's nominal shape over a bare plate: it holds the prior and the chart."""
    feature, paths = nominal(kind)
    bare = record(paths, np.zeros(sum(len(path) for path in paths)))
    problem = _with_priors(pose_problem(feature, Surroundings(bare, plate(), Noise(0.2e-3))))
    shape: Any = problem.target.shape
    if not hasattr(shape, "spot"):
        return problem
    # nothing was felt yet: where the optimum of that lies is chance
    placed = replace(shape, spot=replace(shape.spot, point=feature.axis[0]))
    return replace(problem, target=replace(problem.target, shape=placed))


def nominal(kind: str) -> tuple[Feature, list[FloatArray]]:
    """The feature as a detector would report it, and the sweeps over it: crossings, and slides off both ends."""
    found = kind_named(kind)
    if found.typical is None:
        raise UserError(f"no calibration of a {kind!r}; possible: {', '.join(CALIBRATED_KINDS)}")
    (height, width), point = found.typical, not found.line
    axis = np.zeros((1, 3)) if point else np.array([[-12e-3, 0.0, 0.0], [12e-3, 0.0, 0.0]])
    zero = Interval(0.0, 0.0, 0.0)
    feature = Feature(
        kind,
        axis,
        np.tile([0.0, 0.0, 1.0], (len(axis), 1)),
        Interval.normal(height, 0.05 * abs(height)),
        Interval(width, 0.5 * width, 1.5 * width),
        zero if point else Interval.normal(24e-3, 1e-3),
        Support(50.0, 5),
        True,
        0.1e-3,
    )
    reach = 11e-3
    if point:
        sweeps = [((x, -reach), (x, reach)) for x in (-1.5e-3, 0.2e-3, 1.3e-3)]
        sweeps += [((-reach, y), (reach, y)) for y in (-1e-3, 1.2e-3)]
    else:
        sweeps = [((x, -reach), (x, reach)) for x in (-9e-3, -3e-3, 3e-3, 9e-3)]
        sweeps += [((side * 6e-3, 0.0), (side * 22e-3, 0.0)) for side in (-1, 1)]
    return feature, [straight_path(start, stop) for start, stop in sweeps]


def straight_path(start: tuple[float, float], stop: tuple[float, float]) -> FloatArray:
    """(N, 3) samples on a line over the plate at the apparatus' spacing, m."""
    count = int(np.linalg.norm(np.subtract(stop, start)) / SAMPLE_SPACING) + 1
    return np.column_stack([np.linspace(start, stop, count), np.zeros(count)])


def plate() -> Base:
    """A bare plate, z = 0."""
    half = 0.1
    corners = np.array([[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def record(paths: list[FloatArray], heights: FloatArray) -> Trace:
    """The trace of one sweep for each path, its centres at `heights` (N,) over the plate's trace, m."""
    centers: FloatArray = np.concatenate(paths)
    centers[:, 2] += TIP_RADIUS + heights
    sweep = np.repeat(np.arange(len(paths)), [len(path) for path in paths])
    return Trace(2e-4 * np.arange(float(len(centers))), centers, sweep, TIP_RADIUS)


def _about(blank: PosteriorProblem, problem: PosteriorProblem) -> PosteriorProblem:
    """The problem with a point's place as the blank one has it: a spot at the optimum's place moves with the data."""
    shape: Any = problem.target.shape
    if not hasattr(shape, "spot"):
        return problem
    frame: Any = blank.target.shape
    return replace(problem, target=replace(problem.target, shape=replace(shape, spot=frame.spot)))


def _with_priors(problem: PosteriorProblem) -> PosteriorProblem:
    """The problem under priors that truths can be drawn from: proper, and about the nominal feature."""
    shape: Any = problem.target.shape
    half = problem.sizes.half_width
    named: dict[str, Callable[[float], Prior]] = {
        "offset": lambda start: Normal(start, 0.2 * half),
        "heading": lambda start: Normal(start, 0.03),
        "along": lambda start: Normal(start, 0.2 * half),
        "across": lambda start: Normal(start, 0.2 * half),
        "end rounding": lambda start: Uniform(0.0, 1.0),
        "start": lambda start: Uniform(start - 1.5e-3, start + 1.5e-3),
        "end": lambda start: Uniform(start - 1.5e-3, start + 1.5e-3),
        "height": lambda start: Uniform(0.7 * start, 1.3 * start),
        "log radius": lambda start: Normal(start, 0.5),
        "log width": lambda start: Normal(start, 0.15),
        "log depth": lambda start: Normal(start, 0.5),
    }
    priors = tuple(named[name](float(start)) for name, start in zip(shape.names, shape.start, strict=True))
    return replace(problem, target=replace(problem.target, shape=replace(shape, priors=priors)))


def _places(solution: Solution, truth: FloatArray) -> dict[str, float]:
    """Share of the posterior below the truth, for each parameter and for what follows from them.

    From the chain where one ran (asked for, or because importance sampling could not be trusted), else from all
    weighted draws.
    """
    names = solution.posterior.names
    if solution.chain is None:
        draws, weights = solution.importance.draws, solution.importance.weights
    else:
        draws, weights = solution.posterior.samples, np.full(len(solution.posterior.samples), 1.0)
    values, true = _with_derived(names, draws), _with_derived(names, truth[None])
    return {name: float(weights @ (values[name] < true[name]) / weights.sum()) for name in values}


def _with_derived(names: tuple[str, ...], draws: FloatArray) -> dict[str, FloatArray]:
    """Draws (S,) by name, with the length between two ends and the width of a round section."""
    values = {name: draws[:, i] for i, name in enumerate(names)}
    if "start" in values:
        values["length"] = values["end"] - values["start"]
    if "log radius" in values:
        values["width"] = width_of_cap(values["height"], np.exp(values["log radius"]))
    return values


def campaign(kinds: Sequence[str], seeds: int, method: str = "importance", assumed: str = "true") -> list[Case]:
    """Every shape under every noise, `seeds` times: interrupted anywhere, all have had about as many."""
    noises = (
        CALIBRATED_NOISES if assumed == "true" else [noise for noise in CALIBRATED_NOISES if noise.startswith("ell")]
    )
    return [Case(kind, noise, seed, method, assumed) for seed in range(seeds) for kind in kinds for noise in noises]


def calibrate(cases: Iterable[Case], store: Path, seconds: float = float("inf")) -> list[Row]:
    """Run the cases that the store does not hold yet; every finished one is appended at once.

    After `seconds` no further case is begun; those that the store holds count all the same.
    """
    done = {row.case: row for row in load(store)} if store.exists() else {}
    rows, end = [], time.monotonic() + seconds
    cut_short = bool(done) and not store.read_bytes().endswith(b"\n")
    with store.open("a", encoding="utf-8") as file:
        file.write("\n" if cut_short else "")
        for case in cases:
            if case not in done:
                if time.monotonic() > end:
                    continue
                done[case] = row = run_case(case)
                file.write(json.dumps(_as_json(row)) + "\n")
                file.flush()
            rows.append(done[case])
    return rows


def load(store: Path) -> list[Row]:
    """Rows of a store; lines cut short by an interruption are left out."""
    rows = []
    for line in store.read_text(encoding="utf-8").splitlines():
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue
        rows.append(Row(Case(**entry["case"]), entry["below"], entry["k_hat"], entry["status"]))
    return rows


def _as_json(row: Row) -> dict[str, Any]:
    return {"case": row.case.__dict__, "below": row.below, "k_hat": row.k_hat, "status": row.status}
