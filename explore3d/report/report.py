"""Report: one page that opens without a network, and an SVG of each of its figures beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from explore3d.analysis import Analysis
from explore3d.pictures import SweepPath, over_features, sweep_paths
from explore3d.report.account import account_of_time, provenance, what_was_left_out
from explore3d.report.evidence import (
    compared_with_truth,
    cross_sections,
    curvature_maps,
    deviation_map,
    posteriors,
    roughness_table,
    standard_heights_table,
)
from explore3d.report.findings_section import against_tolerances, facts, headline, what_was_found
from explore3d.report.markup import Html, choice_of_units, contents, element, text, units_script
from explore3d.report.page import REPORT_CSS
from explore3d.report.pictures import Pictures, draw_pictures, is_profile
from explore3d.report.view3d import object_view, profile_view
from mapping.geometry.mesh import write_whole

REPORT = "report.html"
PICTURES = "pictures"

# Nothing may be fetched: everything that the page shows is inside it.
REPORT_SECURITY_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


def write_report(analysis: Analysis, folder: Path | str, rendered: bool = False) -> Path:
    """Write report.html and pictures/*.svg into the folder; returns the page's path.

    The page's title is set when everything on it is drawn: a browser test can wait for it.

    Args:
        rendered: render the object even where nothing was found on it (the page's own view shows it too).

    Raises:
        OSError: the folder cannot be written.
    """
    place = Path(folder)
    flat = sweep_paths(analysis.trace, analysis.base, analysis.detections.crossings)
    sweeps = over_features(flat, analysis.model.features)
    pictures = draw_pictures(analysis, sweeps, rendered)
    page = report_page(analysis, pictures, sweeps)
    (place / PICTURES).mkdir(parents=True, exist_ok=True)
    for name, picture in pictures.files.items():
        write_whole(place / PICTURES / f"{name}.svg", picture)
    return write_whole(place / REPORT, page)


def report_page(analysis: Analysis, pictures: Pictures, sweeps: Sequence[SweepPath]) -> str:
    """The whole page as HTML."""
    if is_profile(analysis):
        view = profile_view(analysis.trace, analysis.base, analysis.model.features)
    else:
        view = object_view(analysis.base.surface, analysis.model.features, sweeps, analysis.trace.tip_radius)
    sections = [
        what_was_found(analysis, pictures, view),
        against_tolerances(analysis),
        deviation_map(analysis, pictures),
        roughness_table(analysis),
        standard_heights_table(analysis),
        cross_sections(analysis, pictures),
        posteriors(pictures),
        curvature_maps(analysis, pictures),
        compared_with_truth(analysis, pictures),
        what_was_left_out(analysis, pictures),
        account_of_time(analysis),
        provenance(analysis),
    ]
    content = element("main", headline(analysis), facts(analysis), contents(sections), choice_of_units(), *sections)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{REPORT_SECURITY_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>explore3d: drawing</title><style>{REPORT_CSS}</style></head>"
        f"<body>{content}{units_script()}{_ready(analysis.title)}</body></html>\n"
    )


def _ready(title: str) -> Html:
    """Sets the page's title once it is drawn; the title travels as text, never as script."""
    name = element("span", text(title), id="title", hidden="hidden")
    return Html(
        f"{name}<script>window.addEventListener('load', () => requestAnimationFrame(() => requestAnimationFrame(() => "
        "{ document.title = document.getElementById('title').textContent + ' · explore3d'; })));</script>"
    )
