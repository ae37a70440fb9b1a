"""Sections: does a line that is no half-cylinder get sizes that are true, bounds, or a remark, and no confident error?

Each trial builds the model as `explore3d analyze` does, without pictures and report, from a trace over a plate whose
section was dilated by brute force. Every trial is one line of a JSONL file; what is already in it is not run again.

    explore3d bench sections --store sections.jsonl --seeds 20
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from explore3d.analysis import Stages, build_model
from explore3d.bench.scenes import SECTION_TIP, TRUE_FAMILIES, section_body, section_trace
from explore3d.log import Log
from mapping import Feature, Interval
from mapping.inference.configuration import in_words

# What a trial's line may be judged to be: right; right as far as anybody can tell, for what is true is among what was
# said to make 90 %; and wrong
JUDGED_RIGHT = ("true", "bounded", "flagged")
JUDGED_OPEN = ("undecided",)
JUDGED_WRONG = ("wrong", "miscounted", "missed")
STATED_SHARE = 0.9


def bench_sections(
    bodies: Sequence[str],
    noises: Sequence[str],
    seeds: range,
    store: Path,
    seconds: float = np.inf,
    tips: Sequence[float] = (SECTION_TIP,),
) -> Iterator[dict[str, Any]]:
    """Run what is not yet in the store and append it there, until so many seconds have passed; yields all records."""
    begin = perf_counter()
    lines = store.read_text(encoding="utf-8").splitlines() if store.exists() else []
    done = {_trial_of(each): each for each in map(json.loads, lines)}
    for seed, body, noise, tip in itertools.product(seeds, bodies, noises, tips):
        trial = {"body": body, "noise": noise, "seed": seed, "tip": tip}
        if _trial_of(trial) not in done:
            if perf_counter() - begin > seconds:
                return
            record = trial | section_trial(body, noise, seed, tip)
            with store.open("a", encoding="utf-8") as file:
                file.write(json.dumps(record) + "\n")
            done[_trial_of(trial)] = record
        yield done[_trial_of(trial)]


def _trial_of(record: dict[str, Any]) -> tuple[str, str, int, float]:
    """What tells a trial from others: section, noise, seed, and the tip's radius, m."""
    return record["body"], record["noise"], record["seed"], record.get("tip", SECTION_TIP)


def section_trial(body: str, noise: str, seed: int, tip: float = SECTION_TIP) -> dict[str, Any]:
    """Analyse one trace, and judge what is said of its line."""
    truth, trace = section_body(body, seed), section_trace(body, noise, seed, tip)
    begin = process_time()
    analysis = build_model(Log(trace), None, None, Stages())
    features = analysis.model.features
    record: dict[str, Any] = {
        "sweeps": int(trace.sweep.max()) + 1,
        "kinds": [feature.kind for feature in features],
        "cpu": process_time() - begin,
        "posterior": analysis.timings.get("posterior", 0.0),
        "true_height": truth.height,
        "true_widths": list(truth.widths),
        "half_way": truth.width_half_way,
    }
    if not features:
        return record | {"judged": "missed"}
    main = max(features, key=lambda feature: feature.evidence.snr)
    # what runs out is said to be as wide as at half of its height
    widths = truth.widths if main.details.exponent is None else (truth.width_half_way,) * 2
    judged = {"height": judged_size(main.height, (truth.height,) * 2), "width": judged_size(main.width, widths)}
    flagged = is_flagged(main)
    if record["kinds"] != truth.count * [truth.kind]:
        stated = is_stated(features, truth.count * [truth.kind])
        whole = "flagged" if flagged else "undecided" if stated else "miscounted"
    elif "wrong" in judged.values():
        whole = "flagged" if flagged else "wrong"
    else:
        whole = "bounded" if "bounded" in judged.values() else "true"
    sizes = {
        name: [size.median, size.low, size.high, size.censored]
        for name, size in (("height", main.height), ("width", main.width))
    }
    return (
        record
        | {"runs_out": main.details.exponent is not None}
        | {"judged": whole, "flagged": flagged, "sizes": sizes, "notes": list(main.notes)}
        | {f"{name}_judged": each for name, each in judged.items()}
    )


def is_flagged(feature: Feature) -> bool:
    """True if a remark says that the feature is not of the form that its sizes are those of."""
    return feature.details.misfit is not None


def is_stated(features: Sequence[Feature], kinds: Sequence[str]) -> bool:
    """True if these kinds are among the likeliest of what the features were said to be, to 90 % together."""
    told = {feature.details.account for feature in features}
    (account,) = told if len(told) == 1 else (None,)
    shares = dict(account or ())
    true = shares.get(in_words(kinds), 0.0)
    return true > 0.0 and sum(share for share in shares.values() if share > true) < STATED_SHARE


def judged_size(interval: Interval, truth: tuple[float, float]) -> str:
    """Whether the interval holds one of the true values ("true"), or is a bound that they keep to, or is "wrong"."""
    if interval.censored:
        largest = max(abs(each) for each in truth)
        kept = largest >= min(abs(interval.low), abs(interval.high))
        return "bounded" if kept and not (interval.bounded and min(truth) > interval.high) else "wrong"
    return "true" if interval.low <= truth[1] and truth[0] <= interval.high else "wrong"


def section_lines(records: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A line for each section, noise and tip: share and sorts of what is right, and coverage and bias of the height."""
    groups: dict[tuple[str, str, float], list[dict[str, Any]]] = {}
    for record in records:
        body, noise, _, tip = _trial_of(record)
        groups.setdefault((body, noise, tip), []).append(record)
    judged = (*JUDGED_RIGHT, *JUDGED_OPEN, *JUDGED_WRONG)
    yield ",".join(["section", "noise", "tip mm", "trials", "right %", *judged, "covered %", "bias %", "posterior s"])
    for (body, noise, tip), some in groups.items():
        counts = {name: sum(each["judged"] == name for each in some) for name in JUDGED_RIGHT}
        rest = {name: sum(each["judged"] == name for each in some) for name in JUDGED_OPEN + JUDGED_WRONG}
        shares = [100.0 * sum(counts.values()) / len(some), *counts.values(), *rest.values()]
        sized = [each for each in some if "sizes" in each and not each["sizes"]["height"][3]]
        covered = 100.0 * float(np.mean([each["height_judged"] == "true" for each in sized])) if sized else np.nan
        ratios = [each["sizes"]["height"][0] / each["true_height"] - 1.0 for each in sized]
        bias = 100.0 * float(np.mean(ratios)) if sized else np.nan
        seconds = float(np.mean([each["posterior"] for each in some]))
        numbers = [*(f"{share:.0f}" for share in shares), f"{covered:.0f}", f"{bias:+.1f}", f"{seconds:.2f}"]
        yield ",".join([body, noise, f"{1e3 * tip:g}", str(len(some)), *numbers])
    known = [each for each in records if each["body"] in TRUE_FAMILIES and "flagged" in each]
    if known:
        false = sum(each["flagged"] for each in known)
        yield f"remarks on sections of a family that the house has: {false} of {len(known)}"
