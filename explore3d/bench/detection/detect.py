"""Detection bench: recall and false alarms per metre against size and noise, for each detector of a single sweep.

A wire lies on a plate, or a groove is cut into it, somewhere under a sweep of the paper's finger; the trace is the
closed form of theory section 4. Detectors are the significance test on heights, with the noise estimated from the
same sweep, stated beforehand, or known, and the paper's algorithms 1 to 4 by curvature with the noise known. Every
sweep is one line of a JSONL file; what is already in the file is not run again.

    explore3d bench detect --store OUT.jsonl --out FOLDER
"""

from __future__ import annotations

import itertools
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from explore3d.bench.scenes import SAMPLE_SPACING, simulate_noise
from mapping import Surface, Trace
from mapping.base import Base
from mapping.detection import curvature_features, detect
from mapping.geometry.templates import cap_height, groove_height
from mapping.instrument import Noise, StatedNoise

TIP_RADIUS = 0.01
SWEEP_LENGTH = 0.1
# The paper's 1e-3 false alarms per 100 mm.
FALSE_ALARM_RATE = 0.01
CORRELATION_LENGTH = 1e-3
# The paper's contact angle is good to 1 degree where its centre is good to 0.2 mm; both scale together here.
ANGLE_PER_NOISE = np.deg2rad(1.0) / 0.2e-3

FEATURE_SIZES = {"wire": (0.005, 0.01, 0.02, 0.035, 0.065, 0.1, 0.15), "groove": (0.05, 0.1, 0.2, 0.4)}
NOISE_LEVELS = (0.002, 0.01, 0.02)
NOISE_KINDS = ("white", "correlated")
HEIGHTS = ("height", "height, noise stated", "height, noise known")
DETECTORS = (*HEIGHTS, "algorithm 1", "algorithm 2", "algorithm 3", "algorithm 4")


@dataclass(frozen=True)
class Case:
    """One simulated sweep.

    Args:
        feature: "wire" or "groove".
        size: diameter of the wire or width of the groove, in tip radii.
        kind: "white" or "correlated" (over 1 mm).
        noise: standard deviation of the centre, in tip radii.
        seed: of the feature's place and the noise.
    """

    feature: str
    size: float
    kind: str
    noise: float
    seed: int


@dataclass(frozen=True)
class Cell:
    """What all sweeps of one size and one noise gave for one detector.

    Args:
        feature, size, kind, noise: see `Case`.
        detector: one of DETECTORS.
        sweeps: their number.
        recall: share of them that found the feature.
        bound: probability that the matched filter of the known shape finds it (theory section 6).
        false_alarms_per_metre: of path away from the feature, 1/m.
        location_rms: of the found places along the sweep, m; NaN where none is found.
    """

    feature: str
    size: float
    kind: str
    noise: float
    detector: str
    sweeps: int
    recall: float
    bound: float
    false_alarms_per_metre: float
    location_rms: float


def all_cases(seeds: int, quick: bool) -> Iterator[Case]:
    """The whole campaign, seed by seed; quick: two sizes and one level of noise."""
    noises = NOISE_LEVELS[-1:] if quick else NOISE_LEVELS
    for seed, kind, noise in itertools.product(range(seeds), NOISE_KINDS, noises):
        for feature, sizes in FEATURE_SIZES.items():
            for size in sizes[1::3] if quick else sizes:
                yield Case(feature, size, kind, noise, seed)


def bench_detect(cases: Iterable[Case], out: Path, seconds: float = np.inf) -> list[dict[str, Any]]:
    """Run what is not yet in `out` and append it there, for no longer than some seconds; every record of the cases."""
    done: dict[Case, dict[str, Any]] = {}
    if out.exists():
        for record in map(json.loads, out.read_text().splitlines()):
            done[Case(**record["case"])] = record
    begin, records = monotonic(), []
    for case in cases:
        if case not in done and monotonic() - begin < seconds:
            done[case] = {"case": asdict(case), "detectors": run_case(case)}
            with out.open("a") as file:
                file.write(json.dumps(done[case]) + "\n")
        if case in done:
            records.append(done[case])
    return records


def run_case(case: Case) -> dict[str, dict[str, Any]]:
    """For each detector: whether it found the feature, how far off (m), its false alarms, and the path for them (m)."""
    trace, place, extent = simulated_sweep(case)
    base, noise, sign = plate(), noise_of(case), 1 if case.feature == "wire" else -1
    result = {}
    settings: tuple[dict[str, Any], ...] = ({}, {"stated": StatedNoise(noise)}, {"noise": noise})
    for name, known in zip(HEIGHTS, settings, strict=True):
        crossings = detect(trace, base, false_alarms_per_metre=FALSE_ALARM_RATE, **known).crossings
        spans = [(c.point[0], c.point[0], np.sign(c.height), c.point[0]) for c in crossings]
        result[name] = _judged(spans, place, extent, sign)
    for number in (1, 2, 3, 4):
        features = curvature_features(trace, number, noise)
        shift = trace.centers[0, 0]
        spans = [(f.start + shift, f.stop + shift, f.sign, f.place + shift) for f in features]
        result[f"algorithm {number}"] = _judged(spans, place, extent, sign)
    return result


def simulated_sweep(case: Case) -> tuple[Trace, float, float]:
    """A sweep along x with contact normals, the feature's place and the half-width of what it disturbs, m."""
    rng = np.random.default_rng([list(FEATURE_SIZES).index(case.feature), NOISE_KINDS.index(case.kind), case.seed])
    x = np.arange(-SWEEP_LENGTH / 2, SWEEP_LENGTH / 2, SAMPLE_SPACING)
    place, size = float(rng.uniform(-0.25, 0.25)) * SWEEP_LENGTH, case.size * TIP_RADIUS
    if case.feature == "wire":
        height, extent = cap_height(x - place, size, size / 2, TIP_RADIUS), float(np.sqrt(2 * TIP_RADIUS * size))
    else:
        height, extent = groove_height(x - place, size, TIP_RADIUS), size / 2
    level = case.noise * TIP_RADIUS
    angle = np.arctan(np.gradient(height, x)) + ANGLE_PER_NOISE * level * rng.standard_normal(len(x))
    z = TIP_RADIUS + height + simulate_noise(noise_of(case), [np.zeros((len(x), 3))], rng)
    normals = np.column_stack([-np.sin(angle), np.zeros(len(x)), np.cos(angle)])
    centers = np.column_stack([x, np.zeros(len(x)), z])
    return (
        Trace(x / 0.03 - x[0] / 0.03, centers, np.zeros(len(x), dtype=np.int64), TIP_RADIUS, normals=normals),
        place,
        extent,
    )


def noise_of(case: Case) -> Noise:
    """The noise of the centre in metres."""
    level = case.noise * TIP_RADIUS
    return Noise(level) if case.kind == "white" else Noise(0.0, level, CORRELATION_LENGTH)


def plate() -> Base:
    """A plate under the sweep."""
    return Base(Surface([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]], [[0, 1, 2], [0, 2, 3]]))


def matched_filter_bound(case: Case) -> float:
    """Probability that a filter which knows the shape of a wire, not its place, finds it: Phi(d' - u).

    White: d' = D/sigma sqrt(16 x_c/(15 Delta)); an OU process of length L: d'^2 is the integral of
    (T'^2 L + T^2/L)/(2 sigma^2) over the cap T. u = sqrt(2 ln(nu0/rate)), nu0 = 1.581/(2 pi x_c). NaN for grooves.

    Reference: theory section 6.
    """
    from scipy.special import ndtr

    if case.feature != "wire":
        return float("nan")
    diameter, level = case.size * TIP_RADIUS, case.noise * TIP_RADIUS
    reach = np.sqrt(2 * TIP_RADIUS * diameter)
    if case.kind == "white":
        visible = diameter / level * np.sqrt(16 * reach / (15 * SAMPLE_SPACING))
    else:
        ratio = CORRELATION_LENGTH / reach
        visible = diameter / level * np.sqrt(0.5 * (8 * ratio / 3 + 16 / (15 * ratio)))
    threshold = np.sqrt(2 * np.log(1.581 / (2 * np.pi * reach * FALSE_ALARM_RATE)))
    return float(ndtr(visible - threshold))


def cells(records: Iterable[dict[str, Any]]) -> list[Cell]:
    """The records averaged over seeds."""
    groups: dict[tuple[Case, str], list[dict[str, Any]]] = defaultdict(list)
    for record in records:
        case = replace(Case(**record["case"]), seed=0)
        for detector, outcome in record["detectors"].items():
            groups[case, detector].append(outcome)
    return [_averaged(case, detector, outcomes) for (case, detector), outcomes in groups.items()]


def _averaged(case: Case, detector: str, outcomes: list[dict[str, Any]]) -> Cell:
    errors = [o["error"] for o in outcomes if o["found"]]
    return Cell(
        case.feature,
        case.size,
        case.kind,
        case.noise,
        detector,
        sweeps=len(outcomes),
        recall=float(np.mean([o["found"] for o in outcomes])),
        bound=matched_filter_bound(case),
        false_alarms_per_metre=sum(o["false"] for o in outcomes) / sum(o["path"] for o in outcomes),
        location_rms=float(np.sqrt(np.mean(np.square(errors)))) if errors else float("nan"),
    )


def _judged(spans: list[tuple[float, float, float, float]], place: float, extent: float, sign: int) -> dict[str, Any]:
    """Spans (start, stop, sign, place) on the feature and away from it; what a fit's width blurs counts as neither."""
    beside = extent + 0.5 * TIP_RADIUS
    hits = [float(p) for a, b, s, p in spans if s == sign and a <= place + extent and b >= place - extent]
    false = sum(bool(b < place - beside or a > place + beside) for a, b, _, _ in spans)
    error = min((p - place for p in hits), key=abs, default=None)
    return {"found": bool(hits), "error": error, "false": false, "path": SWEEP_LENGTH - 2 * beside}
