"""Counts bench: where a model says "one ridge 78 %, two 22 %", are there two in 22 % of such cases?

Random plates bear none to five details that stand out, bumps and wires, anywhere, so that some overlap. They are swept,
detected and assembled as a log is; the probability of each number of details is what the accounts of the found ones say
together. A detail that leaves too little in the trace to be detected, the others being there, is not laid down: nobody
could say whether to count it.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from explore3d.bench.posterior.calibration import plate, record, straight_path
from explore3d.bench.posterior.odds import OddsCase, reliability
from explore3d.bench.scenes import FIRST_BUILT_WITH
from mapping import Feature, FloatArray, Interval, Support
from mapping.assembly import assemble
from mapping.base import LaidTrace
from mapping.detection import detect
from mapping.inference.configuration import PROPOSALS, UNEXPLAINED, numbers_in
from mapping.inference.kinds import feature_trace, kind_made_of

# Sweeps over a square of twice this, m, one pitch apart; details stay inside by the margin
COUNTED_HALF_SIDE, COUNTED_PITCH, MARGIN = 20e-3, 3e-3, 4e-3
MOST_DETAILS = 5
# Heights equally probable in their logarithm, as far as a single crossing tells them under this noise, m
LOWEST_COUNTED, HIGHEST_COUNTED, WHITE = 0.15e-3, 0.6e-3, 0.2e-3
SHORTEST_WIRE, LONGEST_WIRE = 6e-3, 20e-3
# Standard deviation of the place of one that lies beside another, m: the half-width of the disturbance of the highest
BESIDE = 3.5e-3
# What leaves less than so many standard deviations over what the others leave cannot be counted: the threshold of
# crossings at 0.01 false alarms a metre is 5 to 6. Of 7 numbers that were too high where plates bore such details
# and did not count them 4 were the true numbers of all (building seeds 1200 to 1299)
COUNTED_SNR = 8.0
DECILES = np.linspace(0.0, 1.0, 11)


@dataclass(frozen=True)
class CountCase:
    """One plate: how many details it bears, and the probability that was stated of each number.

    `without` names the proposal that was not made. `left_open` is True if it is said of some details that they do not
    explain what was felt: no probability is stated then, and `stated` holds how many were told.
    """

    seed: int
    true: int
    stated: dict[int, float]
    seconds: float
    without: str = ""
    left_open: bool = False


def run_counts(seed: int, without: str = "") -> CountCase:
    """Draw a plate, sweep it, and count."""
    rng = np.random.default_rng([7, seed])
    details: list[Feature] = []
    for _ in range(int(rng.integers(0, MOST_DETAILS + 1))):
        details.append(drawn(rng, details))
    offset = rng.uniform(0.0, COUNTED_PITCH)
    paths = [
        straight_path((-COUNTED_HALF_SIDE, y), (COUNTED_HALF_SIDE, y))
        for y in np.arange(-COUNTED_HALF_SIDE, COUNTED_HALF_SIDE, COUNTED_PITCH) + offset
    ]
    feet: FloatArray = np.concatenate(paths)
    up = np.tile([0.0, 0.0, 1.0], (len(feet), 1))
    tip = record([feet], np.zeros(len(feet))).tip_radius
    each = np.array([feature_trace(detail, feet, up, tip) for detail in details]).reshape(len(details), len(feet))
    each = counted(each)
    true, heights = len(each), each.max(axis=0, initial=0.0)
    trace, base = record(paths, heights + WHITE * rng.standard_normal(len(feet))), plate()
    start = time.process_time()
    laid = LaidTrace.of(trace, base)
    proposals = [proposal for proposal in PROPOSALS if proposal.name != without]
    features = assemble(detect(laid, base), laid, base, proposals=proposals)
    seconds, left_open = time.process_time() - start, any(UNEXPLAINED in feature.notes for feature in features)
    return CountCase(seed, true, stated_counts(features), seconds, without, left_open)


def counted(each: FloatArray) -> FloatArray:
    """Of what details leave (K, n), m, that of those which stay: the one that leaves least beside the others goes until
    each leaves enough to be counted."""
    while len(each):
        rests = [np.delete(each, k, axis=0).max(axis=0, initial=0.0) for k in range(len(each))]
        left = np.linalg.norm(each.max(axis=0) - rests, axis=1)
        weakest = int(np.argmin(left))
        if left[weakest] > COUNTED_SNR * WHITE:
            break
        each = np.delete(each, weakest, axis=0)
    return each


def drawn(rng: np.random.Generator, others: Sequence[Feature] = ()) -> Feature:
    """A bump or a straight wire that lies on the plate, anywhere or as often beside another one."""
    height = float(np.exp(rng.uniform(np.log(LOWEST_COUNTED), np.log(HIGHEST_COUNTED))))
    inside = COUNTED_HALF_SIDE - MARGIN
    middle, is_line = np.array([*rng.uniform(-inside, inside, 2), 0.0]), bool(rng.integers(2))
    if others and rng.random() < 0.5:
        middle[:2] = others[int(rng.integers(len(others)))].axis.mean(axis=0)[:2] + BESIDE * rng.standard_normal(2)
        middle = np.clip(middle, -inside, inside)
    axis = middle[None]
    if is_line:
        heading, half = rng.uniform(0.0, np.pi), 0.5 * rng.uniform(SHORTEST_WIRE, LONGEST_WIRE)
        axis = middle + half * np.array([[-1.0], [1.0]]) * [np.cos(heading), np.sin(heading), 0.0]
        axis = np.clip(axis, -inside, inside)
    size = Interval(height, height, height)
    kind = kind_made_of("convex", line=is_line).name
    return Feature(kind, axis, np.tile([0.0, 0.0, 1.0], (len(axis), 1)), size, size, size, Support(9.0, 9), True, 1e-4)


def stated_counts(features: Sequence[Feature]) -> dict[int, float]:
    """Probability of each number of details, by the accounts of those that were found; others count as they are."""
    total = np.ones(1)
    for account, number in Counter(feature.details.account for feature in features).items():
        if account is None:
            total = np.convolve(total, np.eye(number + 1)[number])
            continue
        own = np.zeros(1 + max(numbers_in(words).total() for words, _ in account))
        for words, share in account:
            own[numbers_in(words).total()] += share
        own /= own.sum()
        for _ in range(max(1, round(number / numbers_in(account[0][0]).total()))):
            total = np.convolve(total, own)
    return {number: float(p) for number, p in enumerate(total) if p > 0.0}


def bench_counts(
    store: Path, seeds: int, seconds: float = float("inf"), *, building: bool = False, without: str = ""
) -> list[CountCase]:
    """Run what the store does not hold; returns all cases of the request."""
    done = {(case.seed, case.without): case for case in load_counts(store)} if store.exists() else {}
    end, first = time.monotonic() + seconds, FIRST_BUILT_WITH if building else 0
    asked = [(seed, without) for seed in range(first, first + seeds)]
    with store.open("a", encoding="utf-8") as file:
        for key in asked:
            if key not in done and time.monotonic() < end:
                done[key] = case = run_counts(*key)
                file.write(json.dumps(case.__dict__) + "\n")
                file.flush()
    return [done[key] for key in asked if key in done]


def load_counts(store: Path) -> list[CountCase]:
    """Cases of a store."""
    cases = []
    for line in store.read_text(encoding="utf-8").splitlines():
        case = json.loads(line)
        cases.append(CountCase(**case | {"stated": {int(k): p for k, p in case["stated"].items()}}))
    return cases


def counts_table(cases: Sequence[CountCase], line: Callable[[str], None]) -> None:
    """Print how often a number was true that was stated with a probability in each decile, and the errors by number.

    Plates whose number was left open count among the errors alone.
    """
    stated = [
        OddsCase("number", case.seed, number == case.true, _log_odds(case.stated.get(number, 0.0)))
        for case in cases
        if not case.left_open
        for number in sorted({*case.stated, case.true})
    ]
    for row in reliability(stated, DECILES):
        line(
            f"stated {100 * row.low:3.0f} to {100 * row.high:3.0f} %: {row.count:5} numbers, "
            f"mean {100 * row.stated:5.1f} %, came true {100 * row.came_true:5.1f} % (+- {100 * row.tolerance:.1f} %)"
        )
    likeliest = [max(case.stated.items(), key=lambda one: one[1])[0] for case in cases]
    right = sum(most == case.true for most, case in zip(likeliest, cases, strict=True))
    fewer = sum(most < case.true for most, case in zip(likeliest, cases, strict=True))
    took = np.mean([case.seconds for case in cases])
    line(
        f"{len(cases)} plates: the likeliest number is right in {right}, too low in {fewer}, too high in "
        f"{len(cases) - right - fewer}; {_open_text(cases, likeliest)}; {took:.2f} CPU s a plate"
    )


def _open_text(cases: Sequence[CountCase], likeliest: Sequence[int]) -> str:
    """ "in 3 it is left open, of which 1 is right"."""
    left = [most == case.true for most, case in zip(likeliest, cases, strict=True) if case.left_open]
    return f"in {len(left)} it is left open, of which {sum(left)} right"


def _log_odds(p: float) -> float:
    p = min(max(p, 1e-9), 1.0 - 1e-9)
    return float(np.log(p / (1.0 - p)))
