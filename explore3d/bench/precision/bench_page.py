"""The bench as one page, for someone who meets the project for the first time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from explore3d.bench.precision.work_precision import LeftOutMethod, Point
from explore3d.report import Html, element, figure, machine_section, page, paragraph, section, table

if TYPE_CHECKING:
    from explore3d.bench.precision.work_precision import Measured

LEAD = (
    "A round fingertip slides over a body and has to find what is finer than itself. Every step on the way trades time "
    "for error. Each diagram shows one step: to the left is faster, down is more exact, so the lower left corner wins. "
    "One curve is one method; its points are settings of that method, of which the first and the last are named."
)


def bench_page(measured: Sequence[Measured], pictures: Mapping[str, bytes], quick: bool) -> str:
    """The whole page.

    Args:
        pictures: PNG of each stage that has points, by the stage's name.
    """
    links = element("nav", *(element("a", each.stage.name, href=f"#{_name(each)}") for each in measured))
    how = (
        "Times are wall times on one machine, the median of the repeats that the table names; importing and compiling "
        "are not counted. Ratios travel to other machines, seconds do not."
    )
    hurry = "This is the quick version: fewer settings and repeats than the whole bench. " if quick else ""
    return page("Bench", "Error against run time", LEAD, paragraph(hurry, how), links,
                *(_stage(each, pictures.get(each.stage.name)) for each in measured), machine_section())  # fmt: skip


def _name(measured: Measured) -> str:
    return measured.stage.name.replace(" ", "-")


def _stage(measured: Measured, picture: bytes | None) -> Html:
    stage = measured.stage
    content: list[str] = []
    if picture is not None:
        content.append(figure(picture, f"Error of the {stage.name} over time", f"What to look at: {stage.look}"))
    about = element("b", "Error: "), f"{stage.error}. ", element("b", "Measured against: "), stage.reference
    content.append(paragraph(*about))
    if measured.points:
        rows = [_row(point) for point in measured.points]
        head = ("method", "setting", "computing", "finger", "error", "repeats")
        content.append(element("details", element("summary", "The figures"), table(head, rows, numeric=(2, 3, 4, 5))))
    if measured.omissions:
        rows = [_omission(each) for each in measured.omissions]
        content.append(element("details", element("summary", "Not shown, and why"), table(("what", "why"), rows)))
    return section(stage.name[0].upper() + stage.name[1:], _name(measured), *content)


def _row(point: Point) -> tuple[str, ...]:
    finger = f"{point.finger:.0f} s" if point.finger else ""
    return point.method, point.setting, f"{point.seconds:.3g} s", finger, f"{point.error:.2e}", str(point.repeats)


def _omission(each: LeftOutMethod) -> tuple[str, str]:
    return each.method, each.reason
