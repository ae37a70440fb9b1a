"""The circle: a body is explored, its model displayed, and the display explored; are the features the same?

Both times as `explore3d run` does: with the scene's finger on the body, then with a DisplayFinger on what is displayed
of the first model, its noise another's. What is displayed has the sizes of the first model, so the second model's 90 %
intervals should hold those. Every trial is one line of a JSONL file; what is already in it is not run again.

    explore3d bench circle --store circle.jsonl --seeds 3
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

import numpy as np

import explore3d
from explore3d.analysis import Comparison, TrueFeature, compare
from explore3d.bench.exploration import FAST, FINGER_NOISES, PRECISION
from explore3d.bench.scenes import BENCH_TIP_RADIUS, DRAWN_KINDS
from explore3d.jobs import scene_finger
from hw.display import DisplayFinger
from hw.simulated import SimulatedFinger
from mapping import Feature
from mapping.geometry.proxy import Bar, Chain, Part
from mapping.geometry.templates import width_of_cap
from mapping.inference.kinds import kind_named
from mapping.model import touchable

# The finger on the display has the seed of the finger on the body and this
OTHER_NOISE = 500_000
JUDGED_SIZES = ("height", "width", "length")


def bench_circle(bodies: Sequence[str], seeds: range, store: Path, seconds: float = np.inf) -> Iterator[dict[str, Any]]:
    """Run what is not yet in the store and append it there, until so many seconds have passed; yields all records.

    Args:
        bodies: names of DRAWN_KINDS.
        seeds: of bodies and noises.
        store: JSONL file.
        seconds: after which no trial begins.
    """
    begin = perf_counter()
    lines = store.read_text(encoding="utf-8").splitlines() if store.exists() else []
    done = {(each["body"], each["seed"]): each for each in map(json.loads, lines)}
    for seed in seeds:
        for body in bodies:
            if (body, seed) not in done:
                if perf_counter() - begin > seconds:
                    return
                done[body, seed] = {"body": body, "seed": seed} | circle_trial(body, seed)
                with store.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(done[body, seed]) + "\n")
            yield done[body, seed]


def circle_trial(body: str, seed: int) -> dict[str, Any]:
    """Explore, display and explore again: how many features were displayed and found, and the sizes of each."""
    begin = process_time()
    scene = DRAWN_KINDS[body](np.random.default_rng((seed, sorted(DRAWN_KINDS).index(body))))
    first, second = (
        scene.scene(scene.text(each, FINGER_NOISES["apparatus"], PRECISION, FAST))
        for each in (seed, seed + OTHER_NOISE)
    )
    with TemporaryDirectory() as folder:
        model = explore3d.run(first, Path(folder, "first"), report=False).model
        shown, left_out = touchable(model, BENCH_TIP_RADIUS)
        finger = scene_finger(second)
        assert isinstance(finger, SimulatedFinger)  # every bench scene names it
        again = DisplayFinger(
            object=model.base.surface, display=shown, tip_radius=finger.tip_radius, rate=finger.rate,
            white=finger.white, correlated=finger.correlated, correlation_length=finger.correlation_length,
            seed=finger.seed,
        )  # fmt: skip
        felt = explore3d.run(second, Path(folder, "second"), finger=again, report=False).model
    hidden = {each.stage for each in left_out}
    features = [each for each in model.features if each.id not in hidden]
    truth = [_displayed(feature, part) for feature, part in zip(features, shown.parts, strict=True)]
    pairs = compare(felt, truth, BENCH_TIP_RADIUS)
    return {
        "displayed": len(truth),
        "left_out": [each.reason for each in left_out],
        "found": sum(pair.status == "found" for pair in pairs),
        "invented": sum(pair.status == "invented" for pair in pairs),
        "sizes": [size for pair in pairs if pair.true is not None for size in _sizes(pair)],
        "cpu": process_time() - begin,
    }


def circle_lines(records: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Of each kind of feature, and of all: sizes displayed, and the share within the intervals of what was felt."""
    sizes = [size for record in records for size in record["sizes"]]
    yield "| displayed | sizes | height | width | length | all |"
    yield "|---|---|---|---|---|---|"
    for kind in (*dict.fromkeys(size["kind"] for size in sizes), None):
        some = [size for size in sizes if kind in (None, size["kind"])]
        cells = [[each["inside"] for each in some if each["size"] == name] for name in JUDGED_SIZES]
        shares = " | ".join(f"{sum(cell)} of {len(cell)}" if cell else "" for cell in cells)
        inside = 100.0 * float(np.mean([each["inside"] for each in some])) if some else np.nan
        yield f"| {kind or 'all'} | {len(some)} | {shares} | {inside:.0f} % |"
    for name in ("displayed", "found", "invented"):
        yield f"features {name}: {sum(record[name] for record in records)}"


def _displayed(feature: Feature, part: Part) -> TrueFeature:
    """The feature with the sizes of the body that was displayed of it."""
    # of sections that leave one trace the model says between which widths; the body has one of them
    width = feature.width.median
    if isinstance(part, Chain):
        width = float(width_of_cap(part.height, part.radius))
    elif isinstance(part, Bar):
        width = part.top + 2.0 * part.run
    sized = feature.width.median > 0.0
    length = feature.length.median if len(feature.axis) > 1 else None
    return TrueFeature(feature.kind, feature.axis, feature.height.median, width if sized else None, length)


def _sizes(pair: Comparison) -> Iterator[dict[str, Any]]:
    """Each size that the displayed feature has; one that was not found has none of them right."""
    assert pair.true is not None
    true = pair.true
    # of a kind without ends the model says how far it was explored, which is no size of it
    length = true.length if len(true.axis) > 1 and kind_named(true.kind).has_ends else None
    for name, displayed in (("height", true.height), ("width", true.width), ("length", length)):
        if displayed is None:
            continue
        felt = None if pair.found is None else getattr(pair.found, name)
        inside = bool(getattr(pair, f"{name}_inside"))
        interval = None if felt is None else [felt.low, felt.median, felt.high, felt.censored]
        yield {"kind": true.kind, "size": name, "displayed": displayed, "felt": interval, "inside": inside}
