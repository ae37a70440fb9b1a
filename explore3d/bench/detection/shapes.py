"""Shapes: are courses, letters, neighbours and lines on curved bodies told as what they are, in kind, count and size?

Each trial writes a table of positions and analyses it as `explore3d analyze TABLE --tip-radius "10 mm" --units mm`
does, without report, mesh or any other hint. Every trial is one line of a JSONL file; what is in it is not run again.

    explore3d bench shapes --store shapes.jsonl --seeds 20 --out shapes
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

import numpy as np

from explore3d.bench import is_flagged, is_stated, judged_size
from explore3d.bench.scenes import SECTION_TIP, SHAPE_PITCH, FeltShape, felt_shape, resampled
from explore3d.jobs import analyze
from mapping import Feature, FloatArray, Trace
from mapping.geometry.mesh import distances

# Places along courses that are asked, m
COURSE_SPACING = 0.2e-3
# Share of the places along a course that must be told, and of those told that must be of it: a corner of two strokes
# may be cut by a few millimetres
WHOLE_SHARE = 0.95
# More than half of a feature that is of no course is invented
INVENTED_SHARE = 0.5
# A width is off by a factor if all of its interval is so many times too wide, or too narrow
OFF_FACTOR = 2.0
# What a trial is, from best to worst
JUDGEMENTS = ("right", "flagged", "undecided", "wrong size", "off course", "miscounted", "invented", "missed")


def bench_shapes(shapes: Sequence[str], seeds: range, store: Path, seconds: float = np.inf) -> Iterator[dict[str, Any]]:
    """Run what is not yet in the store and append it there, until so many seconds have passed; yields all records."""
    begin = perf_counter()
    lines = store.read_text(encoding="utf-8").splitlines() if store.exists() else []
    done = {(each["shape"], each["seed"]): each for each in map(json.loads, lines)}
    for seed, shape in itertools.product(seeds, shapes):
        if (shape, seed) not in done:
            if perf_counter() - begin > seconds:
                return
            done[shape, seed] = {"shape": shape, "seed": seed} | shape_trial(felt_shape(shape, seed))
            with store.open("a", encoding="utf-8") as file:
                file.write(json.dumps(done[shape, seed]) + "\n")
        yield done[shape, seed]


def shape_trial(felt: FeltShape) -> dict[str, Any]:
    """Analyse the table of one shape, and judge what is told."""
    begin = process_time()
    with TemporaryDirectory() as folder:
        table = write_table(felt.trace, Path(folder) / "rows.csv")
        begin = process_time()
        features = analyze(table, tip_radius=SECTION_TIP, units="mm", report=False).model.features
    return {"cpu": process_time() - begin} | judged(felt, features)


def write_table(trace: Trace, path: Path) -> Path:
    """A trace as a table of sweep, x, y and z in mm, to 10 nm."""
    columns = np.column_stack([trace.sweep, 1e3 * trace.centers])
    np.savetxt(path, columns, "%d,%.5f,%.5f,%.5f", header="sweep,x,y,z", comments="")
    return path


def judged(felt: FeltShape, features: Sequence[Feature]) -> dict[str, Any]:
    """What is right and wrong in the features told of a shape.

    An axis is where the wire is if it lies within it: off the course by less than its radius. Ends lie between two
    rows: a course is asked up to a row's distance before its ends, and may be told as far beyond them.
    """
    shape, tolerance = felt.shape, 0.5 * felt.widths[1]
    features = [feature for feature in features if not (shape.has_edge and feature.kind == "edge")]
    axes = [resampled(feature.axis, COURSE_SPACING) for feature in features]
    places = np.vstack([resampled(course, COURSE_SPACING) for course in felt.courses])
    ends = np.vstack([course[[0, -1]] for course in felt.courses])
    ended = _apart(places, [end[None] for end in ends]) < SHAPE_PITCH
    asked = places if ended.all() or shape.closed else places[~ended]
    covered = float((_apart(asked, axes) < tolerance).mean())
    off = [
        (_apart(axis, felt.courses) > tolerance) & (_apart(axis, [end[None] for end in ends]) > SHAPE_PITCH)
        for axis in axes
    ]
    invented = sum(float(each.mean()) > INVENTED_SHARE for each in off)
    strayed = float(np.concatenate(off).mean()) if off else 0.0
    fewest, most = shape.counts
    kinds = [feature.kind for feature in features]
    returns = not shape.closed or len(features) != 1 or features[0].closed
    named = set(kinds) == {shape.kind} and fewest <= len(kinds) <= most and returns
    sizes = [_sizes(feature, felt) for feature in features]
    stated = any(is_stated(features, count * [shape.kind]) for count in range(fewest, most + 1))
    record: dict[str, Any] = {
        "kinds": [kind + (" closed" if each.closed else "") for kind, each in zip(kinds, features, strict=True)],
        "named": named,
        "stated": stated,
        "covered": covered,
        "strayed": strayed,
        "invented": invented,
        "sizes": sizes,
        "true": [felt.height, *felt.widths],
        "courses": [_in_um(course) for course in felt.courses],
        "axes": [_in_um(axis) for axis in axes],
    }
    return record | {"judged": _judgement(record)}


def _judgement(record: dict[str, Any]) -> str:
    """Which of JUDGEMENTS a trial is."""
    if not record["kinds"]:
        return "missed"
    if record["invented"]:
        return "invented"
    if not record["named"]:
        return "undecided" if record["stated"] else "miscounted"
    if record["covered"] < WHOLE_SHARE or record["strayed"] > 1.0 - WHOLE_SHARE:
        return "off course"
    if any(not each["held"] and not each["flagged"] for each in record["sizes"]):
        return "wrong size"
    return "right" if all(each["held"] for each in record["sizes"]) else "flagged"


def _sizes(feature: Feature, felt: FeltShape) -> dict[str, Any]:
    """The sizes of a feature as intervals, and whether they hold what is true of each wire."""
    # what runs out is said to be as wide as at half of its height
    true = felt.widths[0] if feature.details.exponent is not None else felt.widths[1]
    height, width = judged_size(feature.height, (felt.height,) * 2), judged_size(feature.width, (true, true))
    interval, flagged = feature.width, is_flagged(feature)
    factor = max(interval.low / felt.widths[1], felt.widths[0] / max(interval.high, np.finfo(float).tiny))
    return {
        "height": [feature.height.low, feature.height.high],
        "width": [interval.low, interval.high],
        "height_held": height != "wrong",
        "width_held": width != "wrong",
        "held": "wrong" not in (height, width),
        "flagged": flagged,
        "off by a factor": not flagged and not interval.censored and factor > OFF_FACTOR,
    }


def _apart(places: FloatArray, courses: Sequence[FloatArray]) -> FloatArray:
    """(N,) distances of places (N, 3) from the nearest of some courses, m; endless without one."""
    apart = [distances(places, course) for course in courses]
    return np.asarray(np.min([np.full(len(places), np.inf), *apart], axis=0))


def _in_um(axis: FloatArray) -> list[list[int]]:
    """Places in plan, in micrometres, about a millimetre apart: for pictures."""
    return [[int(x), int(y)] for x, y in np.rint(1e6 * resampled(axis[:, :2], 1e-3))]


def shape_lines(records: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A line of CSV for each shape and one for all: what its trials are, shares that hold, and computing time.

    named: kind and count right. heights, widths: shares of features whose size is within its interval or its bound, or
    is remarked upon. factor: features whose width is off by a factor, with neither bound nor remark.
    """
    yield ",".join(
        ["shape", "trials", "right or flagged %", *JUDGEMENTS, "named %", "heights %", "widths %", "factor",
         "covered %", "invented", "CPU s"]
    )  # fmt: skip
    names = list(dict.fromkeys(record["shape"] for record in records))
    groups = [(name, [record for record in records if record["shape"] == name]) for name in names]
    for name, some in [*groups, *([("all", list(records))] if len(groups) > 1 else [])]:
        counts = [sum(record["judged"] == each for record in some) for each in JUDGEMENTS]
        sizes = [size for record in some for size in record["sizes"]]
        held = [
            100.0 * np.mean([size[of] or size["flagged"] for size in sizes]) if sizes else np.nan
            for of in ("height_held", "width_held")
        ]
        numbers = [
            *counts,
            f"{100.0 * np.mean([record['named'] for record in some]):.0f}",
            *(f"{share:.0f}" for share in held),
            sum(size["off by a factor"] for size in sizes),
            f"{100.0 * np.mean([record['covered'] for record in some]):.0f}",
            sum(record["invented"] for record in some),
            f"{np.mean([record['cpu'] for record in some]):.1f}",
        ]
        right = 100.0 * (counts[0] + counts[1]) / len(some)
        yield ",".join(map(str, [name, len(some), f"{right:.0f}", *numbers]))
