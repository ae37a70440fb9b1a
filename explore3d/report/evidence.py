"""The report's second part: what the findings rest on, and how far they are from the truth where it is known."""

from __future__ import annotations

from math import isfinite

from explore3d.analysis import STANDARDS_SENTENCE, Analysis, Comparison
from explore3d.report.markup import Html, Row, badge, element, figure, folded, paragraph, section, table
from explore3d.report.pictures import Pictures, shown_features
from mapping import UNKNOWN_TEXT, length_text

BADGES = {"found": "good", "missed": "bad", "invented": "bad"}


def cross_sections(analysis: Analysis, pictures: Pictures) -> Html:
    """Traced against estimated profiles across each feature."""
    if "sections" not in pictures.files:
        return Html("")
    shown, all_of_them = len(shown_features(analysis)), len(analysis.model.features)
    more = (
        f" The {shown} features with the strongest evidence of {all_of_them} are shown." if shown < all_of_them else ""
    )
    fitted = any(not feature.details.free_section for feature in shown_features(analysis))
    red = (
        "Red: the trace that the feature found would leave, on the level of the samples about it, with its 90 % band. "
        if fitted
        else ""
    )
    caption = (
        f"Height over the base where a sweep crosses each feature. Dots: what the finger traced. {red}Black: the body "
        "itself, as the balls allow it; dotted where the tip bridged it and nothing was touched." + more
    )
    picture = figure(pictures.files["sections"], "Profiles across the features", caption)
    return section("Traced and estimated profiles", "profiles", picture)


def posteriors(pictures: Pictures) -> Html:
    """Extents with their intervals, and the draws behind all intervals."""
    content: list[str] = []
    if "extents" in pictures.files:
        caption = (
            "Lines laid out straight, along and beside them not to one scale: 90 % band about the median; bars: 90 % "
            "intervals of the ends; triangles: the line goes on beyond what was explored."
        )
        content.append(figure(pictures.files["extents"], "Extents with their intervals", caption))
    for name, picture in pictures.files.items():
        if name.startswith("corner-"):
            caption = "Draws of the posterior, each parameter and each pair: 90 % intervals, contours of 50 and 90 %."
            feature = name.removeprefix("corner-")
            drawn = figure(picture, f"Posterior of {feature}", caption)
            content.append(folded(f"{feature}: every parameter", name, drawn))
    return section("Posteriors", "posteriors", *content) if content else Html("")


def curvature_maps(analysis: Analysis, pictures: Pictures) -> Html:
    """Principal curvatures of the estimated surface."""
    if "curvature" not in pictures.files:
        return Html("")
    caption = (
        "Principal curvatures of the estimated surface in units of the tip's own curvature 1/r. Red bulges out, blue "
        "bends in; the paler, the less sure it is which of both; grey is further than r from all that was felt. "
        "Between the sweeps that cross a line it is read along the line. "
        "A fillet of exactly −1 is the tip's own shape, left where it could not reach."
    )
    maps = figure(pictures.files["curvature"], "Maps of curvature", caption)
    who = analysis.curvature
    answered = [] if who is None else [paragraph(who.sentence(analysis.trace.tip_radius))]
    proven = [] if analysis.estimate is None else [paragraph(analysis.estimate.sentence())]
    return section("Curvature", "curvature", maps, *answered, *proven)


def roughness_table(analysis: Analysis) -> Html:
    """What the surface is like beside the features, by the standards."""
    rough = analysis.roughness
    if rough is None:
        return Html("")
    rows: list[Row] = list(rough.rows())
    content = [table(("parameter", "value", "90 % interval"), rows, numeric=(1, 2)), paragraph(rough.sentence())]
    return section("Roughness beside the features", "roughness", *content)


def standard_heights_table(analysis: Analysis) -> Html:
    """What ridges, grooves and steps measure by the standards, where a section of them can be had."""
    known = analysis.standard_heights
    if not any(each.height is not None or each.wolf is not None for each in known):
        return Html("")
    rows: list[Row] = [each.row() for each in known]
    columns = ("feature", "method", "height (90 % of the mean)", "Wolf pruning height")
    return section("Heights by the standards", "standards", table(columns, rows), paragraph(STANDARDS_SENTENCE))


def deviation_map(analysis: Analysis, pictures: Pictures) -> Html:
    """Where the body departs from the model that was given."""
    if analysis.deviation is None or "deviation" not in pictures.files:
        return Html("")
    before, after = (length_text(value, 2) for value in (analysis.deviation.rms, analysis.deviation.left))
    caption = (
        "By how much the body departs from the model that was given, along its normals: red stands out of it, blue "
        f"lies under it. Typical heights over the model were {before} before it was corrected, and are {after} now."
    )
    picture = figure(pictures.files["deviation"], "Map of the deviation from the model", caption)
    return section("Deviation from the model", "deviation", picture)


def compared_with_truth(analysis: Analysis, pictures: Pictures) -> Html:
    """Errors of the features, and of the exploration over time; nothing if no truth is known."""
    if not analysis.truth and not analysis.errors and "time" not in pictures.files:
        return Html("")
    content: list[str] = []
    if not analysis.errors:
        content.append(paragraph("Nothing was there to be found, and nothing was invented."))
    else:
        content.append(paragraph(_verdict(analysis)))
        head = ("feature", "", "axis, rms", "axis, worst", "ends", "height", "width", "length")
        content.append(table(head, [_row(row) for row in analysis.errors]))
    if "sizes" in pictures.files:
        caption = "Errors with 90 % intervals. The green line is the truth; open dots: it lies outside of the interval."
        content.append(figure(pictures.files["sizes"], "Errors of the sizes found", caption))
    if "time" in pictures.files:
        caption = (
            "Worst distance between a true axis, its ends included, and the one found from what had been felt by then; "
            "the last point is the finished model, after its posterior."
        )
        content.append(figure(pictures.files["time"], "Error against time", caption))
    return section("Against the truth", "truth", *content)


def _verdict(analysis: Analysis) -> str:
    errors, scene = analysis.errors, analysis.scene
    simulated = scene is not None and not scene.finger.is_real
    number = {status: sum(row.status == status for row in errors) for status in BADGES}
    true = number["found"] + number["missed"]
    inside = [
        flag for row in errors for flag in (row.height_inside, row.width_inside, row.length_inside) if flag is not None
    ]
    why = "The object is simulated, so the truth is known" if simulated else "The scene states the truth"
    sentence = (
        f"{why}: {number['found']} of {true} features found, {number['missed']} missed, {number['invented']} invented."
    )
    if inside:
        sentence += f" The truth lies within the 90 % interval for {sum(inside)} of {len(inside)} sizes."
    return sentence


def _row(row: Comparison) -> Row:
    name = row.found.id if row.found else (row.true.kind if row.true else "")
    status = row.status
    if row.found and row.true and row.found.kind != row.true.kind:
        name += f" (truly a {row.true.kind})"
    distances = [length_text(value, 2) for value in (row.axis_rms, row.axis_max, row.end_error)]
    sizes = [
        _error(getattr(row, f"{size}_error"), getattr(row, f"{size}_inside")) for size in ("height", "width", "length")
    ]
    return (element("b", name), badge(status, BADGES[status]), *distances, *sizes)


def _error(value: float, inside: bool | None) -> Html:
    if not isfinite(value):
        return Html(UNKNOWN_TEXT)
    sign = "+" if value > 0 else ""
    remark = "" if inside is None else "truth inside 90 %" if inside else "truth outside 90 %"
    return Html(element("span", sign + length_text(value, 2)) + element("small", remark))
