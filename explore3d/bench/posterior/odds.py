"""Odds bench: do stated probabilities of "bump or nothing", "ridge or bump", "two ridges or one" come true?

Of each pair one is chosen by a fair coin, its parameters are drawn from their prior, its trace over the bins of a
window from the likelihood (noise and base included), and the probability of the first is computed from the two
evidences. Of all cases that were given 70 % about 70 % must be the first. Results go to a JSONL file and are not
computed again.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from explore3d.bench.posterior.calibration import plate, record, straight_path
from mapping import Feature, FloatArray, Interval, Support
from mapping.inference import as_broken, as_bump, log_evidence, log_evidence_of_nothing, pose_problem
from mapping.inference.families import BrokenRidgeShape, BumpShape, PosteriorProblem, Surroundings
from mapping.inference.kinds import kind_named
from mapping.instrument import Noise

# So low that most of what the priors hold is not plain to see.
LOW_CREST_HEIGHT = 0.04e-3
ODDS_NOISE = Noise(0.2e-3, 0.01e-3, 1e-3)
PAIRS = ("bump or nothing", "ridge or bump", "two ridges or one")
EDGES = np.array([0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0])


@dataclass(frozen=True)
class OddsCase:
    """One simulation: whether the first of the pair was true, and the log odds that it was given."""

    pair: str
    seed: int
    first: bool
    log_odds: float


@cache
def hypotheses(pair: str) -> tuple[PosteriorProblem, PosteriorProblem | None]:
    """The two problems on one window; None is nothing but the base."""
    kind = "bump" if pair == "bump or nothing" else "ridge"
    height = LOW_CREST_HEIGHT if pair != "two ridges or one" else 4.0 * LOW_CREST_HEIGHT
    feature = _feature(kind, height, 6e-3 if pair == "two ridges or one" else 1.5e-3)
    places = (-5e-3, -2.5e-3, 0.0, 2.5e-3, 5e-3) if pair == "two ridges or one" else (-1e-3, -0.3e-3, 0.4e-3, 1.1e-3)
    paths = [straight_path((x, -5e-3), (x, 5e-3)) for x in places]
    paths += [straight_path((-8e-3, 0.1e-3), (8e-3, 0.1e-3))]
    trace = record(paths, np.zeros(sum(len(path) for path in paths)))
    around = Surroundings(trace, plate(), ODDS_NOISE)
    first = pose_problem(feature, around)
    if pair == "bump or nothing":
        return first, None
    return (first, as_bump(first, feature, around)) if pair == "ridge or bump" else (as_broken(first), first)


def _feature(kind: str, height: float, half: float) -> Feature:
    axis = np.zeros((1, 3)) if not kind_named(kind).line else np.array([[-half, 0.0, 0.0], [half, 0.0, 0.0]])
    sizes = Interval.normal(height, 0.1 * height), Interval(height, 0.5 * height, 2.0 * height)
    length = Interval.normal(2.0 * half, half)
    return Feature(kind, axis, np.tile([0.0, 0.0, 1.0], (len(axis), 1)), *sizes, length, Support(5.0, 4), True, 0.2e-3)


def run_odds(pair: str, seed: int) -> OddsCase:
    """Draw what is true, simulate, and compute the odds."""
    rng = np.random.default_rng([PAIRS.index(pair), seed])
    first, second = hypotheses(pair)
    truth = bool(rng.random() < 0.5)
    heights, theta = simulated(first if truth else second, first, rng)
    place = None if theta is None else _place(first if truth else second, theta)
    asked = _begun(_given(first, heights), place, theta)
    if second is None:
        return OddsCase(pair, seed, truth, log_evidence(asked, rng) - log_evidence_of_nothing(asked.target))
    other = _begun(_given(second, heights), place, theta)
    if pair == "two ridges or one":
        asked = as_broken(other)  # where the search begins depends on the data
    return OddsCase(pair, seed, truth, log_evidence(asked, rng) - log_evidence(other, rng))


def _place(true: PosteriorProblem | None, theta: FloatArray) -> FloatArray:
    """(3,) middle of what is there, m."""
    assert true is not None
    shape: Any = true.target.shape
    if isinstance(shape, BumpShape):
        return np.asarray(shape.spot.lifted(theta[None, :2], np.zeros(1))[0])
    ridge = shape.whole if isinstance(shape, BrokenRidgeShape) else shape
    own = theta[-len(ridge.names) :]
    s = np.array([0.5 * (own[-4] + own[-3])])
    points, laterals, _, _ = ridge.chart.at(s)
    return np.asarray(points[0] + ridge.modes.lateral(own[None, : ridge.modes.count], s)[0, 0] * laterals[0])


def _begun(problem: PosteriorProblem, place: FloatArray | None, theta: FloatArray | None) -> PosteriorProblem:
    """The problem with its search begun near what is there, as it is after a detection, under either hypothesis."""
    shape: Any = problem.target.shape
    start = shape.start.copy()
    if place is None or theta is None:
        more = start[None]
    elif isinstance(shape, BumpShape):
        start[:2] = (place - shape.spot.point) @ shape.spot.axes.T
        more = start[None]
    else:
        ridge = shape.whole if isinstance(shape, BrokenRidgeShape) else shape
        s, lateral, _ = ridge.chart.coordinates(place[None])
        half = 0.25 * problem.sizes.half_width
        start[-len(ridge.names)] = lateral[0]
        start[-4:-2] = s[0] - half, s[0] + half
        more = np.array([start, theta[-len(start) :]]) if len(theta) >= len(start) else start[None]
    inside = np.clip(more, problem.target.low, problem.target.high)
    return replace(problem, beginnings=np.concatenate([problem.beginnings, inside]))


def simulated(
    true: PosteriorProblem | None, window_of: PosteriorProblem, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray | None]:
    """(n,) bin heights drawn from the prior of a problem (None: nothing is there) and from the likelihood.

    The parameters that were drawn come with them.
    """
    window, nuisance = window_of.window, window_of.nuisance
    heights, theta = np.zeros(len(window)), None
    if true is not None:
        shape = true.target.shape
        theta = np.array([float(prior.draw(rng, 1)[0]) for prior in shape.priors])
        theta = np.clip(theta, true.target.low, true.target.high)
        heights = shape.templates(theta[None])[0].copy()
    unit = np.linalg.inv(window_of.target.likelihood.filter.whiten(np.eye(len(window))).T)
    heights += unit @ rng.standard_normal(len(window))
    for start, stop in zip(window.starts[:-1], window.starts[1:], strict=True):
        place = np.linspace(-1.0, 1.0, stop - start)
        heights[start:stop] += nuisance.offset * rng.standard_normal() + nuisance.slope * rng.standard_normal() * place
    return heights, theta


def _given(problem: PosteriorProblem, heights: FloatArray) -> PosteriorProblem:
    likelihood = replace(problem.target.likelihood, window=replace(problem.window, height=heights))
    return replace(problem, target=problem.target.with_likelihood(likelihood))


def bench_odds(
    store: Path, seeds: int, seconds: float = float("inf"), pairs: Sequence[str] = PAIRS
) -> dict[str, list[OddsCase]]:
    """Run what the store does not hold; returns the cases of each pair."""
    done = {(each.pair, each.seed): each for each in load_odds(store)} if store.exists() else {}
    end = time.monotonic() + seconds
    with store.open("a", encoding="utf-8") as file:
        for seed in range(seeds):
            for pair in pairs:
                if (pair, seed) not in done and time.monotonic() < end:
                    done[pair, seed] = case = run_odds(pair, seed)
                    file.write(json.dumps(case.__dict__) + "\n")
                    file.flush()
    return {pair: [case for (name, _), case in done.items() if name == pair] for pair in pairs}


def load_odds(store: Path) -> list[OddsCase]:
    """Cases of a store."""
    return [OddsCase(**json.loads(line)) for line in store.read_text(encoding="utf-8").splitlines()]


@dataclass(frozen=True)
class Reliability:
    """Cases that were given a probability within one of the ranges of EDGES.

    Args:
        low, high: the range.
        count: cases.
        stated: mean probability of the first that they were given.
        came_true: share of them in which it was the first.
        tolerance: two standard deviations of that share if the stated probabilities are right.
    """

    low: float
    high: float
    count: int
    stated: float
    came_true: float
    tolerance: float


def reliability(cases: Sequence[OddsCase], edges: FloatArray = EDGES) -> list[Reliability]:
    """Stated probabilities beside frequencies."""
    stated = 1.0 / (1.0 + np.exp(-np.clip([case.log_odds for case in cases], -700.0, 700.0)))
    first = np.array([case.first for case in cases], dtype=np.float64)
    group = np.clip(np.searchsorted(edges, stated, side="right") - 1, 0, len(edges) - 2)
    rows = []
    for k in range(len(edges) - 1):
        p = stated[group == k]
        if len(p):
            sd = float(np.sqrt((p * (1.0 - p)).sum())) / len(p)
            share = float(first[group == k].mean())
            rows.append(Reliability(float(edges[k]), float(edges[k + 1]), len(p), float(p.mean()), share, 2.0 * sd))
    return rows


def odds_table(found: dict[str, list[OddsCase]], line: Callable[[str], None]) -> None:
    """Print the reliability of each pair."""
    for pair, cases in found.items():
        for row in reliability(cases):
            line(
                f"{pair:18} {row.low:.1f} to {row.high:.1f}: {row.count:4} cases, stated {100 * row.stated:5.1f} %"
                f", came true {100 * row.came_true:5.1f} % (+- {100 * row.tolerance:.1f} %)"
            )
