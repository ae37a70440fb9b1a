"""Pictures of an analysis: one SVG per figure of the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from explore3d.analysis import Analysis
from explore3d.pictures import (
    SweepPath,
    corner_picture,
    cross_section,
    curvature_picture,
    deviation_picture,
    extent_picture,
    object_picture,
    profile_picture,
    section_picture,
    size_picture,
    time_picture,
)
from mapping import Feature, LeftOut

# So many features get a panel of their own.
MOST_SECTIONS = 12
# A corner plot takes 0.2 MB of the page.
MOST_CORNERS = 6


@dataclass(frozen=True)
class Pictures:
    """SVG files by name ("object", "profile", "sections", "extents", "corner-ID", ...), and those left out."""

    files: dict[str, bytes]
    left_out: tuple[LeftOut, ...] = ()


def draw_pictures(analysis: Analysis, sweeps: Sequence[SweepPath], rendered: bool = False) -> Pictures:
    """Every picture that the analysis has the data for.

    Args:
        analysis: what was found.
        sweeps: the sweeps as lines on the base.
        rendered: render the object even where nothing was found on it.
    """
    files: dict[str, bytes | None] = {}
    left_out: list[LeftOut] = []
    profile = is_profile(analysis)
    if profile:
        limit = analysis.detections.detection_limit
        files["profile"] = profile_picture(analysis.trace, analysis.base, analysis.model.features, limit)
    files["sections"] = _sections(analysis)
    files["extents"] = _extents(analysis)
    for feature in shown_features(analysis)[:MOST_CORNERS]:
        files[f"corner-{feature.id}"] = corner_picture(feature)
    bare = not profile and not analysis.model.features and analysis.deviation is None and not rendered
    if bare:  # nothing to see
        why = "nothing was found: the page's own view shows the object and the sweeps"
        left_out.append(LeftOut("rendered pictures", why, "about 0.4 s (estimated: a picture of 2 million rays)"))
    files |= {} if profile or bare else _rendered(analysis, sweeps)
    files["sizes"] = size_picture(analysis.errors)
    files["time"] = time_picture(analysis.time_curve, analysis.scene.explore.precision if analysis.scene else None)
    return Pictures({name: data for name, data in files.items() if data is not None}, tuple(left_out))


def is_profile(analysis: Analysis) -> bool:
    """True if everything was recorded along one line."""
    return analysis.base.kind == "profile"


def shown_features(analysis: Analysis) -> tuple[Feature, ...]:
    """The features that get a panel: those with the strongest evidence, in the order of the model."""
    ranked = sorted(analysis.model.features, key=lambda feature: -feature.evidence.snr)[:MOST_SECTIONS]
    names = {feature.id for feature in ranked}
    return tuple(feature for feature in analysis.model.features if feature.id in names)


def _sections(analysis: Analysis) -> bytes | None:
    trace, crossings = analysis.trace, analysis.detections.crossings
    true = {row.found.id: row.true.height for row in analysis.errors if row.found and row.true}
    others = analysis.model.features
    sections = [
        found
        for feature in shown_features(analysis)
        if (found := cross_section(feature, trace, analysis.base, crossings, analysis.estimate, others)) is not None
    ]
    if not sections:
        return None
    return section_picture(sections, [true.get(each.feature.id) for each in sections])


def _extents(analysis: Analysis) -> bytes | None:
    true = {row.found.id: row.true.axis for row in analysis.errors if row.found and row.true and len(row.true.axis) > 1}
    shown = shown_features(analysis)
    return extent_picture(shown, [true.get(feature.id) for feature in shown])


def _rendered(analysis: Analysis, sweeps: Sequence[SweepPath]) -> dict[str, bytes | None]:
    picture = object_picture(analysis.base.surface, analysis.model.features, sweeps)
    files: dict[str, bytes | None] = {"object": picture}
    if analysis.estimate is not None and analysis.estimate.surface is not None and analysis.curvature is not None:
        files["curvature"] = curvature_picture(
            analysis.estimate,
            analysis.curvature,
            analysis.trace.tip_radius,
            analysis.base.surface,
            analysis.model.features,
        )
    if analysis.deviation is not None and analysis.deviation.of_the_model:
        files["deviation"] = deviation_picture(analysis.base.surface, analysis.deviation.heights)
    return files
