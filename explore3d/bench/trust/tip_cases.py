"""One recording under a tip that is not as said: analysed as `explore3d analyze` does, and held against the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path as File
from time import process_time
from typing import Any

import numpy as np

from explore3d.analysis import Stages, TrueFeature, build_model
from explore3d.bench.trust.case import TRUST_SETS, against_truth, finished, told
from explore3d.bench.trust.laws import Level
from explore3d.bench.trust.paths import bare_path, plane, wires_on
from explore3d.bench.trust.tips import WRONG_TIPS, recorded
from explore3d.bench.trust.verdicts import MOST_FEATURES, MOST_TIMES_ASKED, TRUE_VALUES, markdown, rate_text, share_text
from explore3d.log import Log

# An offset of so many levels of the noise has to be named
SURELY_OFF = 5.0
TIP_HEAD = (
    "tip",
    "recordings",
    "offset, r",
    f"named, of offsets over {SURELY_OFF:g} levels",
    "radius refuted",
    "wires found",
    "invented/m",
    *(f"{name} in 90 %" for name in TRUE_VALUES),
    "height, error %",
    "CPU s",
)


@dataclass(frozen=True)
class TipCase:
    """One recording.

    Args:
        of: name of its set.
        tip: name.
        number: of the recording among those of its tip.
    """

    of: str
    tip: str
    number: int


def bench_tips(
    of: str, tips: Sequence[str], seeds: int, store: File, seconds: float = np.inf
) -> Iterator[dict[str, Any]]:
    """Run what is not yet in the store and append it there, until so many seconds have passed; yields new records."""
    asked = [TipCase(of, tip, number) for number in range(seeds) for tip in tips]
    yield from finished(asked, run_tip_case, store, seconds)


def run_tip_case(case: TipCase) -> dict[str, Any]:
    """Simulate and analyse one recording over a plate, and compare with the truth."""
    of, tip = TRUST_SETS[case.of], WRONG_TIPS[case.tip]
    seed = of.first_seed + case.number
    rng = np.random.default_rng((seed, list(WRONG_TIPS).index(case.tip)))
    said, size = of.tips[case.number % len(of.tips)], of.sizes[0]
    level = Level(float(np.exp(rng.uniform(*np.log(of.levels))) * said), said)
    path, base = bare_path("plane", size, said)
    wires = wires_on(plane(size), said, (seed,))
    trace = recorded(tip, said, path, wires, level, rng)
    begin = process_time()
    analysis = build_model(Log(trace), None, base, Stages())
    cpu = process_time() - begin
    truth = [TrueFeature("ridge", wire.axis, wire.diameter, wire.diameter) for wire in wires]
    deviation, refuted = analysis.deviation, analysis.refuted_tip
    return (
        told(analysis, cpu)
        | {"said": said, "level": level.sd, "offset": tip.offset(said)}
        | {"causes": [] if deviation is None else list(deviation.causes)}
        | {"yields": None if analysis.yielding is None else analysis.yielding.record()}
        | {"told_offset": 0.0 if deviation is None else deviation.offset}
        | {"refuted": None if refuted is None else refuted.largest}
        | against_truth(analysis, path, truth, [wire.axis + said * wire.up for wire in wires])
    )


def tip_line(record: dict[str, Any]) -> str:
    """What one recording came to."""
    causes = ", ".join(_named(record)) or "nothing"
    inside = ", ".join(f"{name} {sum(v)}/{len(v)}" for name, v in record["inside"].items())
    return f"{causes} named, {record['found']} wires found, {record['invented']} invented, inside: {inside}"


def _named(record: dict[str, Any]) -> list[str]:
    """What the analysis says that is not as told."""
    return [*(["yielding"] if record["yields"] else []), *record["causes"]]


def tip_table(records: Sequence[dict[str, Any]]) -> str:
    """A row of TIP_HEAD for each tip that there are records of."""
    return markdown(
        TIP_HEAD, [_row(tip, own) for tip in WRONG_TIPS if (own := [e for e in records if e["tip"] == tip])]
    )


def _row(tip: str, records: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    surely = [each for each in records if abs(each["offset"]) > SURELY_OFF * each["level"]]
    inside = {name: [yes for each in records for yes in each["inside"][name]] for name in TRUE_VALUES}
    errors = [error for each in records for error in each["height_errors"]]
    found, missed = (sum(each[name] for each in records) for name in ("found", "missed"))
    metres = float(sum(each["metres"] for each in records))
    return (
        tip,
        str(len(records)),
        f"{np.mean([each['offset'] / each['said'] for each in records]):+.3f}",
        share_text((sum(bool({"offset", "yielding"} & {*_named(each)}) for each in surely), len(surely))),
        share_text((sum(each["refuted"] is not None for each in records), len(records))),
        share_text((found, found + missed)),
        rate_text((sum(each["invented"] for each in records), metres), MOST_FEATURES / MOST_TIMES_ASKED),
        *(share_text((sum(values), len(values))) for values in inside.values()),
        f"{100 * np.mean(errors):+.1f}" if errors else "–",
        f"{np.mean([each['cpu'] for each in records]):.1f}",
    )
