"""Verdicts: what many recordings of each law came to, as lines, Markdown, page and JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from explore3d.bench.trust.case import COUNTED_RATE, TRUST_SETS
from explore3d.bench.trust.laws import LAWS
from explore3d.report import machine_section, page, paragraph, section, table
from explore3d.scene import AnalysisSettings
from mapping import length_text
from mapping.geometry.mesh import write_whole

# A promise is broken beyond this many times the rate that was asked for, and beyond so many features a metre
MOST_TIMES_ASKED, MOST_FEATURES = 3.0, 0.05
TRUE_VALUES = ("place", "height", "width", "length", "crossing")
VERDICT_HEAD = (
    "law",
    "m",
    "false/m, 1 asked",
    "false/m, 0.01 asked",
    "features/m",
    "warned",
    "limit/level",
    "found at limit",
    "wires found",
    "invented/m beside wires",
    *(f"{name} in 90 %" for name in TRUE_VALUES),
    "CPU s/m",
)


@dataclass(frozen=True)
class Verdict:
    """What the recordings of one law came to; shares are (successes, trials), rates (count, metres).

    Args:
        name: of the law, or of body and tip.
        recordings, wired: how many bare ones, and how many with wires.
        often: false candidates where COUNTED_RATE was asked for.
        seldom: false candidates at the rate that the product asks for unless told otherwise.
        features: in the models of bare recordings.
        warned: bare recordings with a named warning.
        raised: bare recordings that say that crests are weighed otherwise than by the fitted law.
        limit: median of the printed limit over the law's level.
        recovered: crests of the printed limit found.
        found: wires found.
        invented: features beside wires.
        inside: true values within 90 % intervals, by what they are of.
        cpu: seconds of analysis a metre of bare path.
    """

    name: str
    recordings: int
    wired: int
    often: tuple[int, float]
    seldom: tuple[int, float]
    features: tuple[int, float]
    warned: tuple[int, int]
    raised: tuple[int, int]
    limit: float
    recovered: tuple[int, int]
    found: tuple[int, int]
    invented: tuple[int, float]
    inside: dict[str, tuple[int, int]]
    cpu: float

    @property
    def row(self) -> tuple[str, ...]:
        """The cells of VERDICT_HEAD."""
        cells = [
            self.name,
            f"{self.often[1]:.0f}",
            rate_text(self.often, COUNTED_RATE),
            rate_text(self.seldom, AnalysisSettings().false_alarms_per_metre),
            rate_text(self.features, MOST_FEATURES / MOST_TIMES_ASKED),
            share_text(self.warned),
            f"{self.limit:.2g}",
            share_text(self.recovered),
            share_text(self.found),
            rate_text(self.invented, MOST_FEATURES / MOST_TIMES_ASKED),
            *(share_text(self.inside[name]) for name in TRUE_VALUES),
            f"{self.cpu:.2f}",
        ]
        return tuple(cells)


def law_verdicts(records: Sequence[dict[str, Any]]) -> list[Verdict]:
    """One for each law that there are records of, in the order of LAWS."""
    return [_verdict(law, own) for law in LAWS if (own := [each for each in records if each["law"] == law])]


def body_verdicts(records: Sequence[dict[str, Any]]) -> list[Verdict]:
    """One for each body and tip, over all laws."""
    groups = dict.fromkeys((each["body"], each["tip"]) for each in records)
    return [
        _verdict(
            f"{body}, {length_text(tip)}",
            [each for each in records if each["body"] == body and each["tip"] == tip],
        )
        for body, tip in groups
    ]


def _verdict(name: str, records: Sequence[dict[str, Any]]) -> Verdict:
    bare = [each for each in records if not each["wires"]]
    wired = [each for each in records if each["wires"]]
    metres = float(sum(each["metres"] for each in bare))
    limits = [each["limit"] / each["level"] for each in bare if np.isfinite(each["limit"])]
    inside = {name: [yes for each in wired for yes in each["inside"][name]] for name in TRUE_VALUES}
    weighed = [any("crests are weighed" in said for said in each["warnings"]) for each in bare]
    return Verdict(
        name,
        len(bare),
        len(wired),
        (sum(each["often"] for each in bare), float(sum(each["often_metres"] for each in bare))),
        (sum(each["crossings"] for each in bare), metres),
        (sum(len(each["features"]) for each in bare), metres),
        (sum(bool(each["warnings"]) for each in bare), len(bare)),
        (sum(weighed), len(bare)),
        float(np.median(limits)) if limits else np.nan,
        (sum(each.get("put_found", 0) for each in bare), sum(each.get("put", 0) for each in bare)),
        (sum(each["found"] for each in wired), sum(each["found"] + each["missed"] for each in wired)),
        (sum(each["invented"] for each in wired), float(sum(each["metres"] for each in wired))),
        {name: (sum(values), len(values)) for name, values in inside.items()},
        sum(each["cpu"] for each in bare) / metres if metres else np.nan,
    )


def poisson_range(count: int, metres: float) -> tuple[float, float]:
    """Rates, 1/m, under which no less and no more events than these are seen once in twenty times (Garwood 1936)."""
    from scipy.stats import chi2

    low = 0.5 * float(chi2.ppf(0.05, 2 * count)) if count else 0.0
    return low / metres, 0.5 * float(chi2.ppf(0.95, 2 * count + 2)) / metres


def rate_text(rate: tuple[int, float], asked: float) -> str:
    """The rate, its 90 % range, and a mark where all of that is more than may be."""
    count, metres = rate
    if not metres:
        return "–"
    low, high = poisson_range(count, metres)
    mark = " !" if low > MOST_TIMES_ASKED * asked else " ?" if count / metres > MOST_TIMES_ASKED * asked else ""
    return f"{count / metres:.2g} ({low:.2g}–{high:.2g}){mark}"


def share_text(share: tuple[int, int]) -> str:
    """Successes of trials, in per cent."""
    return f"{100 * share[0] / share[1]:.0f} % of {share[1]}" if share[1] else "–"


def trust_line(record: dict[str, Any]) -> str:
    """What one recording came to."""
    warned = "warned" if record["warnings"] else "not warned"
    cost = f"{warned}, {record['cpu']:.1f} s"
    if record["wires"]:
        inside = ", ".join(f"{name} {sum(v)}/{len(v)}" for name, v in record["inside"].items())
        return f"{record['found']} wires found, {record['invented']} invented, inside: {inside}, {cost}"
    counts = f"{record['often']} and {record['crossings']} candidates in {record['metres']:.1f} m"
    put = f", {record['put_found']} of {record['put']} crests found" if "put" in record else ""
    return f"{counts}, {len(record['features'])} features{put}, {cost}"


def verdict_lines(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """A line for each law, for the terminal."""
    for each in verdicts:
        yield ", ".join(f"{name}: {cell}" for name, cell in zip(VERDICT_HEAD, each.row, strict=True))


TRUST_LEAD = (
    "Simulated instruments of many laws of error sweep bare bodies and bodies that wires lie on. Each recording is "
    "analysed as explore3d analyze does, its body's mesh given, and held against what was promised."
)
HOW_TO_READ_IT = (
    "Rates are a metre of inspected path, with the range of rates (90 %) that the count allows; ! marks a rate that is "
    "surely more than three times what was asked for (features: more than 0.05 a metre), ? one that is so by its count "
    "alone. A law is in units of its level, the standard deviation of single samples, and so is the printed limit of "
    "detection. Warned: share of bare recordings of which the analysis says what is unusual. Found at limit: crests of "
    "the printed limit that were put into bare recordings and found, 95 % promised. Intervals hold the truth in 90 % "
    "of cases if they are right; crossing: the place of a single sweep's crossing. The gate asks for 300 m and 200 "
    "wires of each law; the columns say how much was run."
)


def write_trust(records: Sequence[dict[str, Any]], of: str, out: Path) -> tuple[Path, ...]:
    """The verdicts as trust.html, trust.md and trust.json in a folder."""
    out.mkdir(parents=True, exist_ok=True)
    verdicts = law_verdicts(records)
    rows = [each.row for each in verdicts]
    by_body = [each.row for each in body_verdicts(records)]
    head_of_bodies = ("body, tip", *VERDICT_HEAD[1:])
    scales = TRUST_SETS[of].sentence()
    laws = [(name, law.sentence) for name, law in LAWS.items()]
    warned = [(law, said) for law in LAWS if (said := _usual_warnings(records, law))]
    numeric = tuple(range(1, len(VERDICT_HEAD)))
    written = {
        "trust.html": page(
            "Trust",
            "What is promised, under laws of error",
            TRUST_LEAD,
            paragraph(scales, " ", HOW_TO_READ_IT),
            section("Verdicts", "verdicts", table(VERDICT_HEAD, rows, numeric=numeric)),
            section("Bodies and tips", "bodies", table(head_of_bodies, by_body, numeric=numeric)),
            section("Warnings", "warnings", table(("law", "what is said, share of bare recordings"), warned)),
            section("Laws", "laws", table(("law", "what it is"), laws)),
            machine_section(),
        ),
        "trust.md": "\n\n".join(
            [
                f"# Trust: promises under laws of error ({of})",
                TRUST_LEAD,
                f"`explore3d bench trust --set {of} --store trust.jsonl --out trust` makes this page.",
                scales,
                HOW_TO_READ_IT,
                markdown(VERDICT_HEAD, rows),
                "## Bodies and tips",
                "All laws together.",
                markdown(head_of_bodies, by_body),
                "## Warnings",
                markdown(("law", "what is said, share of bare recordings"), warned),
                "## Laws",
                markdown(("law", "what it is"), laws),
            ]
        )
        + "\n",
        "trust.json": json.dumps({"set": of, "verdicts": [asdict(each) for each in verdicts]}, indent=1) + "\n",
    }
    for name, text in written.items():
        write_whole(out / name, text)
    return tuple(out / name for name in written)


def _usual_warnings(records: Sequence[dict[str, Any]], law: str) -> str:
    """The kinds of warnings of a law, each with the share of bare recordings that have it."""
    bare = [each for each in records if each["law"] == law and not each["wires"]]
    kinds = {
        "crests weighed by what was measured": "crests are weighed",
        "limit raised": "detection limit was raised",
        "samples or details not felt": "were not felt",
        "sweeps drift": "sweeps drift",
        "instrument drifts": "instrument drifts",
        "path cut": "path was cut",
        "too few samples": "too few to inspect",
        "may be rounding": "may be rounding",
        "tip refuted": "the tip was no ball",
        "readings hang behind": "hang behind",
    }
    shares = {
        kind: np.mean([any(words in said for said in each["warnings"]) for each in bare])
        for kind, words in kinds.items()
        if bare
    }
    return ", ".join(f"{kind} {100 * share:.0f} %" for kind, share in shares.items() if share)


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
