"""One recording under one law: analysed as `explore3d analyze` does, and held against the truth."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, astuple, dataclass, fields, replace
from math import ceil
from pathlib import Path as File
from time import perf_counter, process_time
from typing import Any

import numpy as np

from explore3d.analysis import Analysis, Stages, TrueFeature, build_model, compare
from explore3d.bench.trust.laws import LAWS, Level, Path
from explore3d.bench.trust.paths import (
    PATH_LENGTH,
    SPACING_SHARE,
    SWEEPS_SIDE_BY_SIDE,
    TRUST_BODIES,
    WIRE_DRAWS,
    WIRE_PLACES,
    bare_path,
    wired_path,
)
from explore3d.log import Log
from mapping import Feature, FloatArray, Trace, length_text
from mapping.base import LaidTrace, Pose
from mapping.detection import detect
from mapping.geometry.mesh import nearest_on, resample, write_whole

# Candidates that are asked for a metre, beside the default rate: enough to be counted
COUNTED_RATE = 1.0
# Crests of the printed limit that are put into a recording, and half-widths from one to the next at least
CRESTS, CRESTS_APART = 30, 12.0
# Of the bare recordings, one in so many has crests put into it
CRESTS_EVERY = 3
# Standard deviations to either side that hold 90 % of a normal law
NINETY_PERCENT = 1.6449


@dataclass(frozen=True)
class CaseSet:
    """Scenes, scales and seeds of a comparison.

    Args:
        name: of the set.
        first_seed: the n-th recording of a case has this seed plus n.
        tips: radii of the tips, m.
        sizes: radii of the round bodies, m.
        levels: least and largest level of the law, in tip radii.
        lengths: least and largest length over which errors are shared, in tip radii.
    """

    name: str
    first_seed: int
    tips: tuple[float, ...]
    sizes: tuple[float, ...]
    levels: tuple[float, float]
    lengths: tuple[float, float]

    def sentence(self) -> str:
        """Its scales and seeds."""
        tips, sizes = (" and ".join(length_text(each) for each in values) for values in (self.tips, self.sizes))
        return (
            f"The set {self.name!r}: tips of {tips}, bodies of {sizes} radius, levels of {self.levels[0]:g} to "
            f"{self.levels[1]:g} tip radii, correlation over {self.lengths[0]:g} to {self.lengths[1]:g} tip radii, "
            f"seeds from {self.first_seed} on; {SWEEPS_SIDE_BY_SIDE} sweeps of {length_text(PATH_LENGTH)} a recording, "
            f"a sample every {SPACING_SHARE:g} tip radii."
        )


# What the detection was built with, and what is reported; the latter was never run while anything was mended
BUILDING = CaseSet("building", 1_000, (4e-3, 8e-3), (0.045, 0.055), (0.003, 0.006), (0.1, 0.3))
REPORTED_TRUST = CaseSet("reported", 7_000_000, (3e-3, 10e-3), (0.04, 0.06), (0.002, 0.007), (0.08, 0.4))
TRUST_SETS = {each.name: each for each in (BUILDING, REPORTED_TRUST)}


@dataclass(frozen=True)
class Case:
    """One recording.

    Args:
        of: name of its set.
        law, body: names.
        number: of the recording among those of its law and body.
        wires: True if wires lie on the body.
    """

    of: str
    law: str
    body: str
    number: int
    wires: bool


def recordings_of(metres: float, wires: int) -> tuple[int, int]:
    """How many bare recordings are so many metres, and how many with wires have so many."""
    return ceil(metres / (SWEEPS_SIDE_BY_SIDE * PATH_LENGTH)), ceil(wires / len(WIRE_PLACES))


def cases(of: str, laws: Sequence[str], bodies: Sequence[str], bare: int, wired: int) -> Iterator[Case]:
    """Of every law so many bare recordings and so many with wires, over the bodies in turn; all laws grow together."""
    for turn in range(max(bare, wired)):
        for law in laws:
            body, number = bodies[turn % len(bodies)], turn // len(bodies)
            for wires, count in ((False, bare), (True, wired)):
                if turn < count:
                    yield Case(of, law, body, number, wires)


def bench_trust(
    of: str, laws: Sequence[str], bodies: Sequence[str], bare: int, wired: int, store: File, seconds: float = np.inf
) -> Iterator[dict[str, Any]]:
    """Run what is not yet in the store and append it there, until so many seconds have passed; yields new records."""
    yield from finished(list(cases(of, laws, bodies, bare, wired)), run_trust_case, store, seconds)


def finished(
    asked: Sequence[Any], run: Callable[[Any], dict[str, Any]], store: File, seconds: float
) -> Iterator[dict[str, Any]]:
    """Run cases, all of one dataclass, that are not yet in a store and append them there, until so many seconds have
    passed; yields the new records, which hold the fields of their cases."""
    begin = perf_counter()
    if store.exists() and len(whole := _whole_lines(store)) < len(store.read_text()):
        write_whole(store, whole)
    done = {tuple(each[name.name] for name in fields(asked[0])) for each in trust_records(store)}
    for case in asked:
        if astuple(case) in done:
            continue
        if perf_counter() - begin > seconds:
            return
        record = asdict(case) | run(case)
        with store.open("a") as file:
            file.write(json.dumps(record) + "\n")
        yield record


def trust_records(store: File) -> list[dict[str, Any]]:
    """The finished recordings in a store; none if there is no such file."""
    return [json.loads(text) for text in _whole_lines(store).splitlines()]


def _whole_lines(store: File) -> str:
    """What a store holds, less a last line that was being written when its run was ended."""
    text = store.read_text() if store.exists() else ""
    return text[: text.rfind("\n") + 1]


def run_trust_case(case: Case) -> dict[str, Any]:
    """Simulate and analyse one recording, and compare with the truth."""
    of = TRUST_SETS[case.of]
    which = list(LAWS).index(case.law), list(TRUST_BODIES).index(case.body)
    rng = np.random.default_rng((of.first_seed + case.number, *which, int(case.wires)))
    tip = of.tips[case.number % len(of.tips)]
    size = of.sizes[case.number // len(of.tips) % len(of.sizes)]
    if case.wires:
        draw = of.first_seed, which[1], case.number % WIRE_DRAWS
        path, base, truth, crests = wired_path(case.body, size, tip, draw)
    else:
        (path, base), truth, crests = bare_path(case.body, size, tip), (), ()
    level, length = (np.exp(rng.uniform(*np.log(bounds))) * tip for bounds in (of.levels, of.lengths))
    index, centers = LAWS[case.law].record(path, Level(float(level), float(length)), rng)
    trace = Trace(path.t[index], centers, path.sweep[index], tip)
    begin = process_time()
    analysis = build_model(Log(trace), None, base, Stages())
    seconds = process_time() - begin
    record = told(analysis, seconds) | {"tip": tip, "level": float(level), "length": float(length)}
    if case.wires:
        return record | against_truth(analysis, path, truth, crests)
    laid = LaidTrace.of(analysis.trace, analysis.base)
    often = detect(laid, analysis.base, false_alarms_per_metre=COUNTED_RATE)
    record |= {"often": len(often.crossings), "often_metres": often.inspected_length}
    if case.number % CRESTS_EVERY == 0 and np.isfinite(analysis.detections.detection_limit):
        record |= _recovery(analysis, laid, rng)
    return record


def told(analysis: Analysis, seconds: float) -> dict[str, Any]:
    """What an analysis says, whatever the truth."""
    found, deviation = analysis.detections, analysis.deviation
    warnings = [*found.remarks, *(why for why in found.left_out if "limit is computed" not in why)]
    warnings += [] if deviation is None else [deviation.sentence()]
    warnings += [] if analysis.refuted_tip is None else [analysis.refuted_tip.sentence()]
    warnings += [f"the path was cut: {reason}" for reason, _ in analysis.path.cuts] if analysis.path else []
    return {
        "crossings": len(found.crossings),
        "metres": found.inspected_length,
        "features": [each.kind for each in analysis.model.features],
        "warnings": warnings,
        "limit": found.detection_limit,
        "cpu": seconds,
    }


def _recovery(analysis: Analysis, laid: LaidTrace, rng: np.random.Generator) -> dict[str, Any]:
    """Sharp crests of the printed limit at places by chance along the recording, and how many of them are found."""
    height, tip = analysis.detections.detection_limit, laid.tip_radius
    half_width = float(np.sqrt(2 * tip * height))
    room = [
        (number, float(place))
        for number, sweep in enumerate(laid.laid_sweeps)
        if len(sweep.arclength) > 1
        for place in np.arange(
            rng.uniform(2.0, CRESTS_APART) * half_width,
            sweep.arclength[-1] - 2.0 * half_width,
            CRESTS_APART * half_width,
        )
    ]
    chosen = [room[i] for i in np.sort(rng.permutation(len(room))[:CRESTS])]
    centers, begins = laid.centers.copy(), np.cumsum([0, *(len(sweep.trace) for sweep in laid.laid_sweeps)])
    put = []
    for number, place in chosen:
        sweep = laid.laid_sweeps[number]
        low, high = np.searchsorted(sweep.arclength, [place - half_width, place + half_width])
        if high - low < 3 or np.diff(sweep.arclength[low:high]).max() > 0.25 * half_width:
            continue  # nothing was felt there
        lift = np.maximum(height - (sweep.arclength[low:high] - place) ** 2 / (2 * tip), 0.0)
        centers[begins[number] + low : begins[number] + high] += lift[:, None] * sweep.feet(slice(low, high)).normals
        put.append((sweep.number, place, sweep.arclength))
    lifted = replace(laid.select(slice(None)), centers=centers)
    found = detect(LaidTrace.of(lifted, analysis.base), analysis.base)
    count = 0
    for number, place, s in put:
        inside = [
            s[min(c.start, len(s) - 1)] - half_width < place < s[min(c.stop, len(s)) - 1] + half_width
            for c in found.crossings
            if c.sweep == number and c.height > 0
        ]
        count += any(inside)
    return {"put": len(put), "put_found": count}


def against_truth(
    analysis: Analysis, path: Path, truth: Sequence[TrueFeature], crests: Sequence[FloatArray]
) -> dict[str, Any]:
    """How many wires were found, whether their intervals hold them, and by which shares their heights are off.

    Where the analysis took the object for moved, a wire lies where it lies on the object.

    Args:
        analysis: of the recording.
        path: that was recorded, without error.
        truth: the wires.
        crests: of each wire the places (K, 3) on the bare body's trace at which sweeps cross it, m.
    """
    pose = Pose.of(analysis.base)
    if pose is not None:
        truth = [replace(each, axis=pose.onto(each.axis)) for each in truth]
        crests = [pose.onto(each) for each in crests]
    rows = compare(analysis.model, truth, path.tip_radius)
    found = [row for row in rows if row.status == "found"]
    inside: dict[str, list[bool]] = {
        name: [bool(value) for row in found if (value := getattr(row, f"{name}_inside")) is not None]
        for name in ("height", "width", "length")
    }
    inside["place"] = [_place_inside(row.found, row.true.axis) for row in found if row.found and row.true]
    inside["crossing"] = []
    for crossing in analysis.detections.crossings:
        place = crossing.point + path.tip_radius * crossing.normal
        gaps = [_away(place[None], crest)[0] for crest in crests]
        gap, true = min(gaps), truth[int(np.argmin(gaps))]
        # a crossing near an end, or of nothing, has no place to compare with
        ends = np.linalg.norm(true.axis[[0, -1]] - crossing.point, axis=1).min()
        strip = np.sqrt(2 * path.tip_radius * true.height)
        if gap < strip and ends > strip and crossing.kind == "convex":
            side = abs(np.cross(true.axis[-1] - true.axis[0], crossing.normal) @ crossing.tangent)
            side /= max(float(np.linalg.norm(true.axis[-1] - true.axis[0])), 1e-300)
            inside["crossing"].append(bool(gap < NINETY_PERCENT * crossing.position_sd * side))
    statuses = [row.status for row in rows]
    return {
        "found": statuses.count("found"),
        "missed": statuses.count("missed"),
        "invented": statuses.count("invented"),
        "inside": inside,
        "height_errors": [row.height_error / row.true.height for row in found if row.true],
    }


def _away(points: FloatArray, axis: FloatArray) -> FloatArray:
    """(N,) distances of points (N, 3) from an axis (K, 3), m."""
    return np.asarray(np.linalg.norm(points - nearest_on(points, axis)[0], axis=1))


def _place_inside(found: Feature, axis: FloatArray) -> bool:
    """True if the true axis passes within the 90 % interval of the middle of the found one."""
    sd = found.details.axis_sd
    at = found.position_sd if sd is None else float(sd[len(sd) // 2])
    middle = resample(found.axis, 3)[1:2] if len(found.axis) > 1 else found.axis
    return bool(_away(middle, axis)[0] <= NINETY_PERCENT * at)
