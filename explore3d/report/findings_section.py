"""The report's first part: what was found, in a sentence, in figures, in a table, and in a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from explore3d import count_text
from explore3d.analysis import Analysis
from explore3d.report.findings import (
    account_lines,
    deviation_warning,
    dropped_warning,
    form_warnings,
    kinds_found,
    lifted_sentence,
    limit_sentence,
    misfit_warnings,
    number_text,
    numbers_found,
    path_sentence,
    path_warning,
    stop_lines,
    swept_part,
    tip_warning,
    undecided_text,
    unexplained_warnings,
    warning_lines,
    yielding_sentence,
)
from explore3d.report.markup import Html, Row, badge, element, figure, paragraph, section, table
from explore3d.report.pictures import Pictures, is_profile
from mapping import UNKNOWN_TEXT, Feature, Interval, length_text, place_decimals
from mapping.detection import narrowest_groove
from mapping.geometry.mesh import arclengths
from mapping.inference.kinds import kind_named, kind_of
from mapping.model import FAIL, PASS, UNDECIDED

VERDICT_BADGES = {PASS: "good", FAIL: "bad", UNDECIDED: "plain"}


def headline(analysis: Analysis) -> Html:
    """The title, and the result in a sentence or two."""
    warnings = [*stop_lines(analysis), *([analysis.recovered] if analysis.recovered else [])]
    return element(
        "header",
        element("p", _when_and_who(analysis), class_="kind"),
        element("h1", analysis.title or "Untitled"),
        *(element("p", f"{_capital(sentence)}.", class_="warning") for sentence in warnings),
        *(element("p", sentence, class_="warning") for sentence in tip_warning(analysis)),
        element("p", found_sentence(analysis), class_="lead"),
    )


def _when_and_who(analysis: Analysis) -> str:
    """When it was recorded, by whom and with what, as far as anybody said."""
    known, about = analysis.model.provenance, analysis.model.provenance.get("about", {})
    parts = ["Haptic exploration"]
    if known.get("recorded"):
        parts.append(f"{known['recorded'][:16].replace('T', ' ')} UTC")
    words = (("part", "part {}"), ("operator", "by {}"), ("instrument", "with {}"))
    parts += [phrase.format(about[name]) for name, phrase in words if name in about]
    return " · ".join(parts)


def found_sentence(analysis: Analysis) -> str:
    """What was found, and what a lone feature measures."""
    features = analysis.model.features
    if analysis.refused:
        return limit_sentence(analysis)
    if not features:
        return f"Nothing was found that the base does not explain{swept_part(analysis)}. {limit_sentence(analysis)}"
    numbers = {kind: numbers_found(features, kind) for kind in kinds_found(features)}
    counts = [number_text(each, kind, kind_named(kind).plural) for kind, each in numbers.items()]
    odds, is_one = undecided_text(features), numbers_found(features) == [1]
    sentence = f"{_listed(counts)} {'was' if is_one else 'were'} found{odds and f': {odds}'}."
    if len(features) == 1:
        sizes = [f"{_described(getattr(features[0], name))} {word}" for name, word in _sizes(features[0])]
        sentence += f" {f'As one {features[0].kind} it' if odds else 'It'} is {_listed(sizes)}."
    return sentence[0].upper() + sentence[1:]


def facts(analysis: Analysis) -> Html:
    """Boxes with the figures that everything else rests on."""
    trace, detections = analysis.trace, analysis.detections
    # the account of the path where there is one: what is left out of it is told beside it
    inspected = detections.inspected_length if analysis.path is None else analysis.path.inspected
    pairs = [
        (length_text(trace.tip_radius), "radius of the fingertip"),
        (length_text(inspected), "of path inspected"),
        (f"{len(trace):,}", "samples in contact"),
        (length_text(detections.noise.sd, 2), "noise of a sample (estimated)"),
        (length_text(detections.detection_limit, 2), "detection limit of a sharp crest"),
        (
            length_text(narrowest_groove(detections.detection_limit, trace.tip_radius), 2),
            "narrowest groove that is seen",
        ),
    ]
    return element("div", *(element("div", element("b", a), element("span", b)) for a, b in pairs), class_="facts")


def what_was_found(analysis: Analysis, pictures: Pictures, view: Html) -> Html:
    """Counts, the table of features, and the views."""
    features = analysis.model.features
    content: list[str] = [_counts(analysis)]
    of_the_trace = *lifted_sentence(analysis), *yielding_sentence(analysis), *deviation_warning(analysis)
    content.extend(element("p", warning, class_="warning") for warning in of_the_trace)
    content.extend(element("p", warning, class_="warning") for warning in warning_lines(analysis))
    if features:
        head = ("feature", "height", "width", "length", "place", "evidence", "kind of detail", "posterior")
        shared = _shared_notes(features)
        content.append(table(head, [_row(feature, analysis, pictures, shared) for feature in features]))
        content.extend(paragraph(f"{_capital(note)} (all of them).") for note in shared)
        content.extend(paragraph(each) for each in account_lines(analysis))
        content.append(paragraph("Ranges are central 90 % intervals. ", limit_sentence(analysis)))
    if analysis.inspected is not None and not is_profile(analysis):
        content.append(paragraph(analysis.inspected.sentence()))
    if analysis.account is not None:
        warning = analysis.account.warning()
        content.extend([element("p", warning, class_="warning")] if warning else [])
        content.append(paragraph(analysis.account.sentence()))
    content.extend(element("p", each, class_="warning") for each in form_warnings(analysis))
    wrong = [*misfit_warnings(analysis), *unexplained_warnings(analysis)]
    content.extend(element("p", each, class_="warning") for each in wrong)
    content.extend(element("p", each, class_="warning") for each in dropped_warning(analysis))
    if analysis.path is not None:
        kind = "warning" if path_warning(analysis) else ""
        content.append(element("p", path_sentence(analysis.path), class_=kind))
    if analysis.ended:
        content.append(paragraph(f"Why the exploration ended: {analysis.ended.rstrip('.')}."))
    picture = "profile" if is_profile(analysis) else "object"
    if picture in pictures.files:
        content.append(figure(pictures.files[picture], f"Picture of the {picture}", _caption(analysis)))
    content.append(element("h2", "To look around", class_="to-look"))
    content.append(view)
    return section("What was found", "found", *content)


def against_tolerances(analysis: Analysis) -> Html:
    """What the drawing allows, and whether that is proved; nothing where no tolerance was named."""
    if not analysis.judgements:
        return Html("")
    rows = [
        (badge(each.verdict, VERDICT_BADGES[each.verdict]), element("span", each.tolerance.text()), each.reason())
        for each in analysis.judgements
    ]
    rule = (
        "Passed or failed is what is proved with 95 % probability (the default of ISO 14253-1); the rest is undecided, "
        "and a longer exploration, or a slower one, may decide it."
    )
    table_of_them = table(("verdict", "tolerance", "what it rests on"), rows)
    return section("Tolerances", "tolerances", table_of_them, paragraph(rule))


def _counts(analysis: Analysis) -> Html:
    """How many details are finer than the tip, how many gentler, for each radius considered."""
    features = analysis.model.features
    if not features:
        return paragraph("No detail stands out of the noise.")
    finer = sum(feature.curvature_feature for feature in features)
    gentler, definition = len(features) - finer, "finer than the tip (curvature features, the paper's definition 1)"
    if gentler == 0 or finer == 0:
        how = definition if finer else "gentler than the tip (no curvature features, the paper's definition 1)"
        how = f"all {how}" if len(features) > 1 else how.replace("features", "feature")
    else:
        how = f"{finer} {definition}, {gentler} gentler than the tip"
    stands = "stands" if len(features) == 1 else "stand"
    intro = paragraph(f"{_capital(count_text(len(features), 'detail'))} {stands} out of the noise: {how}.")
    if len(analysis.tip_counts) < 2:
        return intro
    rows = [(length_text(each.tip_radius), str(each.finer), str(each.gentler)) for each in analysis.tip_counts]
    head = ("read with a tip of radius", "finer than the tip", "gentler")
    return Html(intro + table(head, rows, numeric=(1, 2)))


def _shared_notes(features: Sequence[Feature]) -> tuple[str, ...]:
    """Notes that every one of several features has: said once, below the table."""
    if len(features) < 2:
        return ()
    return tuple(note for note in features[0].notes if all(note in feature.notes for feature in features))


def _row(feature: Feature, analysis: Analysis, pictures: Pictures, shared: Sequence[str]) -> Row:
    cells = [_with_range(getattr(feature, name)) for name in ("height", "width")]
    length = _with_range(feature.length) if len(feature.axis) > 1 else Html("point")
    evidence = element("span", f"S/N {feature.evidence.snr:.0f}") + element(
        "small", count_text(feature.evidence.crossings, "crossing")
    )
    if feature.curvature_feature:
        detail = badge("finer than the tip", "good")
    else:
        detail = badge("gentler than the tip", "plain")
    own = [note for note in feature.notes if note not in shared]
    notes = element("small", "; ".join(own), class_="note") if own else Html("")
    name = element("button", feature.id, type="button", class_="feature", data_feature=feature.id, aria_pressed="false")
    name = Html(name + notes)
    return (name, *cells, length, _place(feature, analysis), Html(evidence), detail, _posterior(feature, pictures))


def _place(feature: Feature, analysis: Analysis) -> Html:
    """Where the feature hangs: its anchor, and how well its place is known."""
    point = feature.axis[0] if feature.anchor is None else feature.anchor.position
    factor, name = (1e-3, "mm") if analysis.base.surface.size < 10.0 else (1.0, "m")
    values = point[:1] if is_profile(analysis) else point
    decimals = 4 if is_profile(analysis) else max(2, place_decimals(analysis.trace.tip_radius))
    text = ", ".join(f"{value / factor:.{decimals}f}" for value in values)
    where = "along" if is_profile(analysis) else "across"
    known = f"± {length_text(1.645 * feature.position_sd, 2)} {where}" if feature.position_sd > 0 else ""
    return Html(element("span", f"{text} {name}") + element("small", known))


def _posterior(feature: Feature, pictures: Pictures) -> Html:
    if feature.posterior is None:
        return badge("measured, not fitted" if feature.details.free_section else "none", "plain")
    kind = "good" if feature.posterior.trusted else "bad"
    label = "by Laplace" if feature.posterior.status == "not needed" else feature.posterior.status
    draws, picture = f"{len(feature.posterior.samples)} draws", f"corner-{feature.id}"
    shown = element("a", draws, href=f"#{picture}") if picture in pictures.files else draws
    return Html(badge(label, kind) + element("small", shown))


def _with_range(interval: Interval) -> Html:
    if not interval.high and not interval.low:
        return Html(UNKNOWN_TEXT)  # the kind has no such size: a step has no width
    median, span = interval.text()
    # the range is written without its unit, which the page's choice of units has to know
    unit = median.rpartition(" ")[2]
    return Html(element("span", median) + (element("small", span, data_unit=unit) if span else ""))


def _caption(analysis: Analysis) -> str:
    if is_profile(analysis):
        return (
            "Above: the profile with its base. Below: its height over the base. Triangles mark what was found: filled "
            "if finer than the tip, open if gentler."
        )
    return (
        "The base in grey, the sweeps in blue, in orange where a sweep felt something that the base does not explain, "
        "the features found in colour. Features too small to be seen are drawn larger."
    )


def _sizes(feature: Feature) -> list[tuple[str, str]]:
    """Sizes worth a word in the first sentence."""
    words = kind_of(feature).words.items()
    return [(name, word) for name, word in words if name != "length" or arclengths(feature.axis)[-1] > 0]


def _described(interval: Interval) -> str:
    if interval.median < 0:
        interval = replace(interval, median=-interval.median, low=-interval.high, high=-interval.low)
    median, span = interval.text()
    return f"{median} ({span})" if span else median


def _listed(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1]


def _capital(sentence: str) -> str:
    return sentence[0].upper() + sentence[1:]
