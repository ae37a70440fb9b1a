"""The stability table as a page, for someone who meets it for the first time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from math import isnan

from explore3d.report import Html, badge, element, machine_section, page, paragraph, section, table
from explore3d.stability.table import Row, cells, digits, summary

HEAD = ("case", "asked", "found", "digits kept", "explained by", "time", "")
GROUP_EXPLANATIONS = {
    "closed forms": "Formulas against 60 decimal digits. “Printed form” is how the paper or a textbook writes it: with "
    "large balls or small features its differences cancel, and digits are lost that the question does not cost.",
    "contact": "Where a ball first touches a triangle mesh, asked in ways that geometry does not know: another unit, "
    "another origin, another order of triangles. A condition number of a million is six digits that nobody can keep.",
    "curvature": "Second derivatives: the hardest to keep. A sphere has no principal direction: none may be given.",
    "meshes": "Meshes as they come from scanners and bad exports.",
    "stiff contact": "A fingertip on a hard body is a spring of up to a billion newtons per metre; explicit steps at "
    "the rate of the control explode on it.",
    "detection": "Sweeps over a plate under the noise of the paper's apparatus, at the sizes where detection should "
    "begin or end, and in other units of length.",
    "posterior": "Questions that the data answer only in part: what is not known must come out as unknown.",
}


def stability_page(rows: Sequence[Row]) -> str:
    """The whole page."""
    lead = (
        "Does the answer survive extremes? Every line asks a question whose answer is known, and counts the correct "
        "digits. A question has a condition number: the factor by which it magnifies the rounding of its own input. "
        "Losing more digits than that explains is a failure, and so are a crash and more than a minute."
    )
    verdict = badge("no case fails", "good") if all(row.passed for row in rows) else badge("cases fail", "bad")
    sections = [
        section(
            name[0].upper() + name[1:],
            name.replace(" ", "-"),
            paragraph(GROUP_EXPLANATIONS.get(name, "")),
            _table(list(group)),
        )
        for name, group in groupby(rows, key=lambda row: row.group)
    ]
    return page("Stability", "Digits kept at the extremes", lead, paragraph(verdict, " ", summary(rows)), *sections,
                machine_section())  # fmt: skip


def _table(rows: Sequence[Row]) -> Html:
    return table(HEAD, [_row(row) for row in rows], numeric=(5,))


def _row(row: Row) -> tuple[str, ...]:
    _, name, asked, found, _, _, _, _, reason, seconds, verdict = cells(row)
    mark = badge("ok", "good") if verdict == "ok" else badge("fails", "bad")
    return element("b", name), asked, found, _digits(row), _explained(row, reason), f"{seconds} s", mark


def _digits(row: Row) -> Html:
    error = row.answer.error
    if isnan(error):
        return Html("–")
    width = f"width:{0.35 * digits(error):.2f}rem"
    kept = element("span", f"{digits(error):.1f} ", element("span", class_="bar", style=width))
    if isnan(row.answer.paper):
        return kept
    return Html(kept + element("small", f"printed form: {digits(row.answer.paper):.1f}"))


def _explained(row: Row, reason: str) -> Html:
    if isnan(row.answer.error):
        return Html(element("span", reason, style="white-space:normal"))
    allowed = f"at least {digits(min(row.allowed, 1.0)):.1f} digits; condition {row.answer.condition:.0e}"
    return Html(allowed + element("small", reason))
