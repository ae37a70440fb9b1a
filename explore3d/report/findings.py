"""Findings: what a run or an analysis found, told on the terminal."""

from __future__ import annotations

from math import isfinite
from pathlib import Path

from explore3d import count_text, interval_text, length_text
from explore3d.analysis import Analysis
from mapping import Feature, Interval

# Share of the surface from which on it counts as all of it: it is printed in whole per cent
NEARLY_ALL = 0.995
MOST_LISTED_FEATURES = 20  # features that are listed one by one; the report has them all


def show(analysis: Analysis, out: Path, as_json: bool) -> None:
    """Print the model's record as JSON, or a few lines for people."""
    import json

    if as_json:
        print(json.dumps(analysis.model.document(), ensure_ascii=False, allow_nan=False))
    else:
        place = out if analysis.folder is None else analysis.folder
        print("\n".join([*stop_lines(analysis), *summary(analysis), f"report: {place / 'report.html'}"]))


def stop_lines(analysis: Analysis) -> list[str]:
    """What must be read before anything else: that the exploration ended early, and how to go on."""
    if analysis.stopped is None:
        return []
    return [f"{analysis.stopped.text}; go on with: {analysis.go_on}" if analysis.go_on else analysis.stopped.text]


def summary(analysis: Analysis) -> list[str]:
    """One line on the whole, one a feature, and one on what would have been seen."""
    features = analysis.model.features
    finer = sum(feature.curvature_feature for feature in features)
    lines = [f"{count_text(len(features), 'feature')} found{swept_part(analysis)}"]
    account = analysis.account
    if features:
        lines[0] += f", {finer} of them finer than the tip of {length_text(analysis.trace.tip_radius)}"
    lines = [*(f"read as: {line}" for line in analysis.model.provenance.get("read_as", [])), *lines]
    if analysis.recovered:
        lines.append(analysis.recovered)
    more = (
        [f"  and {len(features) - MOST_LISTED_FEATURES} more, see the report"]
        if len(features) > MOST_LISTED_FEATURES
        else []
    )
    return [
        *([account.warning()] if account is not None and account.short else []),
        *lines,
        *(feature_line(feature) for feature in features[:MOST_LISTED_FEATURES]),
        *more,
        limit_sentence(analysis),
        *warning_lines(analysis),
        *([account.sentence()] if account is not None else []),
    ]


def limit_sentence(analysis: Analysis) -> str:
    """What would have been seen."""
    detections = analysis.detections
    if not isfinite(detections.detection_limit):
        return "The trace is too short to say what would have been seen."
    return (
        f"A sharp crest {length_text(detections.detection_limit, 2)} high or higher is seen with "
        f"{100 * detections.probability:.0f} % probability where a sweep crosses it{swept_part(analysis)}"
        f"{measured_part(analysis)}."
    )


def measured_part(analysis: Analysis) -> str:
    """'': measured, 58 of 60 that were put into this log were found'' where that was done, else ''."""
    detections = analysis.detections
    if not detections.injected:
        return ""
    return f": measured, {detections.recovered} of {detections.injected} that were put into this log were found"


def warning_lines(analysis: Analysis) -> list[str]:
    """What was promised and had to be changed."""
    return [f"Warning: {remark}." for remark in analysis.detections.remarks]


def swept_part(analysis: Analysis) -> str:
    """'' on the 21 % of the surface that was swept'' where the sweeps did not come near all of it, else ''."""
    inspected = analysis.inspected
    if inspected is None or analysis.base.kind == "profile":
        return ""
    # the account of a scene leaves out what no ball can reach
    untouched = inspected.untouched if analysis.account is None else analysis.account.unswept
    return (
        "" if 1.0 - untouched > NEARLY_ALL else f" on the {100 * (1.0 - untouched):.0f} % of the surface that was swept"
    )


def feature_line(feature: Feature) -> str:
    """A feature's name and its sizes with their intervals, in one line."""
    sizes = [("height", feature.height), ("width", feature.width), ("length", feature.length)]
    known = [f"{name} {_text(interval)}" for name, interval in sizes if interval.median or interval.censored]
    return f"  {feature.id}: {', '.join(known)}"


def _text(interval: Interval) -> str:
    median, spread = interval_text(interval)
    return f"{median} ({spread})" if spread else median
