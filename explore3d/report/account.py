"""The report's last part: what was left out and why, where the time went, and where everything came from."""

from __future__ import annotations

import json
from collections.abc import Sequence

from explore3d import seconds_text
from explore3d.analysis import Analysis, forecast
from explore3d.report.markup import Html, Row, element, paragraph, section, table
from explore3d.report.pictures import Pictures
from mapping import Dropped, LeftOut, length_text

# Dropped detections that the page lists: what a reader looks through
MOST_DROPPED_SHOWN = 20


def what_was_left_out(analysis: Analysis, pictures: Pictures) -> Html:
    """Stages that were not needed or could not be done."""
    silent = tuple(LeftOut("part of the trace", sentence) for sentence in analysis.detections.left_out)
    everything = (*analysis.left_out, *silent, *pictures.left_out)
    content = []
    if everything:
        rows = [(element("b", each.stage), each.reason, each.saved) for each in everything]
        content.append(table(("stage", "why", "what that saved"), rows))
    if analysis.model.dropped:
        content.append(_dropped(analysis.model.dropped))
    return section("What was left out", "left-out", *(content or [paragraph("Nothing.")]))


def _dropped(dropped: Sequence[Dropped]) -> Html:
    """Detections that are no feature, the plainest first."""
    head = ("detected, and no feature", "at", "height", "signal to noise", "why")
    plainest = sorted(dropped, key=lambda each: -each.snr)
    rows: list[Row] = [
        (
            element("b", each.kind),
            ", ".join(f"{1e3 * value:.2f}" for value in each.point) + " mm",
            length_text(each.height, 2),
            f"{each.snr:.1f}",
            each.reason,
        )
        for each in plainest[:MOST_DROPPED_SHOWN]
    ]
    more = len(dropped) - MOST_DROPPED_SHOWN
    rest = [paragraph(f"and {more} more, in model.json.")] if more > 0 else []
    return Html("".join([table(head, rows), *rest]))


def account_of_time(analysis: Analysis) -> Html:
    """Seconds per stage, with bars."""
    if not analysis.timings:
        return Html("")
    longest = max(analysis.timings.values()) or 1.0
    rows: list[Row] = [
        (name, seconds_text(seconds), element("span", class_="bar", style=f"width:{14 * seconds / longest:.2f}rem"))
        for name, seconds in analysis.timings.items()
    ]
    rows.append((element("b", "together"), seconds_text(sum(analysis.timings.values())), ""))
    content = [table(("stage", "time", ""), rows, numeric=(1,))]
    if analysis.computing is not None and len(analysis.trace):
        content.append(paragraph(analysis.computing.sentence(float(analysis.trace.t[-1]))))
    content.extend(_what_time_buys(analysis))
    return section("Where the time went", "time", *content)


def _what_time_buys(analysis: Analysis) -> list[Html]:
    """Error now, and predicted for half and double the finger's time."""
    known = forecast(analysis)
    if known is None:
        return []
    kind = "error of the worst axis" if analysis.time_curve else "largest standard deviation of a place or height"
    what, told = ("time", "finger") if known.seconds is not None else ("path", "samples")

    def spent(share: float) -> str:
        return f"{share * known.samples:,.0f}" if known.seconds is None else seconds_text(share * known.seconds)

    rows: list[Row] = [
        (name, spent(share), length_text(error, 2))
        for name, share, error in (
            (f"half the {what} (predicted)", 0.5, known.half),
            ("as it was", 1.0, known.error),
            (f"twice the {what} (predicted)", 2.0, known.double),
        )
    ]
    how = f"Predicted {known.how} (error ~ time^{-known.exponent:.2f}). Computing grows in proportion to the samples."
    return [table((f"what the finger's {what} buys", told, kind), rows, numeric=(1, 2)), paragraph(how)]


def provenance(analysis: Analysis) -> Html:
    """Everything needed to do it again."""
    about = json.dumps(analysis.model.document()["provenance"], indent=1, ensure_ascii=False)
    content = [
        paragraph(
            "The same in numbers: ",
            element("code", "model.json"),
            ". In 3D for any glTF viewer: ",
            element("code", "model.glb"),
            ".",
        ),
        element("details", element("summary", "Provenance"), element("pre", about)),
    ]
    if analysis.scene is not None:
        content.append(element("details", element("summary", "Scene"), element("pre", analysis.scene.resolved)))
    return section("Where it came from", "provenance", *content)
