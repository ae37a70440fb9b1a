"""Grammar: crossings of sweeps become bumps, ridges, pits, grooves, steps and edges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapping.base import Base
from mapping.crest_trace import distances
from mapping.crossing import Crossing
from mapping.detectors import Detections
from mapping.edge_feature import edge_features
from mapping.faint_feature import with_faint_lines
from mapping.feature import Feature
from mapping.inspection import inspect
from mapping.line_feature import Around, line_features
from mapping.linking import groups
from mapping.open_crest import comes_down, is_open, on_a_step
from mapping.outline import outline
from mapping.point_feature import point_feature
from mapping.runs import Run, split_runs
from mapping.step_feature import step_features
from mapping.trace import Trace

FloatArray = NDArray[np.float64]

NAMES = {1: ("bump", "ridge"), -1: ("pit", "groove")}
# A group of crossings that spreads over more than this many half-widths cannot be one round bump: sweeps further
# than one half-width from its crest miss it.
WIDEST_SPOT = 2.6


def assemble(
    detections: Detections, trace: Trace, base: Base, *, false_alarms_per_metre: float = 0.01
) -> tuple[Feature, ...]:
    """Features of the base, the strongest evidence first, with preliminary intervals.

    Crossings of one sign are linked where no inspected place between them denies a line. A group is one bump (or pit)
    unless the heights of all places around say that it is longer: then a ridge (or groove), or several that meet,
    each with its ends, closed if it returns to its beginning. Steps are linked likewise; those that a ridge explains,
    because a sweep ran along it, are dropped, and crests that the sweep began or ended on are believed only if no step
    explains them. Ridges and grooves too low for any one sweep are found where many sweeps agree. In a single profile
    every crossing is a bump, a pit or a step.

    Args:
        detections: of the trace.
        trace: any set of sweeps.
        base: the global model.
        false_alarms_per_metre: expected number of lines found in noise alone, 1/m of inspected path.

    Reference: paper definitions 2 and 3; theory section 5.
    """
    crossings = detections.crossings
    if len(np.unique(trace.sweep)) == 1:
        return _strongest_first([point_feature([c], _name(c), detections, trace.tip_radius) for c in crossings])
    features = _linked(detections, trace, base) if crossings else []
    return _strongest_first(with_faint_lines(features, detections, trace, base, false_alarms_per_metre))


def _linked(detections: Detections, trace: Trace, base: Base) -> list[Feature]:
    """Features of the crossings that single sweeps detected."""
    crossings: Sequence[Crossing] = detections.crossings
    scale = _scale(crossings, trace.tip_radius)
    around = Around(inspect(trace, base, detections.noise, 0.2 * scale), base, detections, trace.tip_radius)
    edges, crossings = edge_features(crossings, around)
    runs, steps = split_runs(
        [c for c in crossings if not c.kind.startswith("step") or comes_down(c, around.inspection)]
    )
    lines, bands = _sorted_runs(runs, steps, around)
    steps += [edge for band in bands for edge in (band.first, band.last)]
    pitch = around.inspection.pitch
    along = [point for run in lines for point in run.points(max(min(pitch, run.length), scale), base, trace.tip_radius)]
    details: list[Feature] = []
    doubtful: list[tuple[int, list[Crossing]]] = []
    for sign, kind in ((1, "convex"), (-1, "concave")):
        crests = [c for c in [*crossings, *along] if c.kind == kind]
        for members in groups(crests, around.inspection, scale) if crests else []:
            group = [crests[i] for i in members]
            top = max(abs(c.height) for c in group)
            if all(is_open(c, around.inspection) for c in group if abs(c.height) > 0.5 * top):
                doubtful.append((sign, group))
            else:
                details += _details(group, sign, around)
    features = _without_shadows(details, trace.tip_radius)
    stepped = step_features(steps, features, around, scale)
    for sign, group in doubtful:
        rest = [c for c in group if not on_a_step(c, steps, stepped)]
        details += _details(rest, sign, around) if rest else []
    return [*_without_shadows(details, trace.tip_radius), *stepped, *edges]


def _name(crossing: Crossing) -> str:
    """What a crossing of a single profile is called."""
    return "step" if crossing.kind.startswith("step") else NAMES[1 if crossing.height > 0 else -1][0]


def _strongest_first(features: Sequence[Feature]) -> tuple[Feature, ...]:
    return tuple(sorted(features, key=lambda f: -f.evidence.snr))


def _scale(crossings: Sequence[Crossing], tip_radius: float) -> float:
    """Half-width of a sharp crest of the typical height, m."""
    heights = np.array([abs(c.height) for c in crossings])
    return float(np.sqrt(2 * tip_radius * np.median(heights)))


def _sorted_runs(runs: list[Run], steps: list[Crossing], around: Around) -> tuple[list[Run], list[Run]]:
    """Runs along a line, and runs over a band that other sweeps found as well."""
    edges = [c for run in runs for c in (run.first, run.last)] + steps
    bands = [run for run in runs if run.is_band(edges, around.inspection.pitch, around.tip_radius)]
    return [run for run in runs if run not in bands], bands


def _details(members: list[Crossing], sign: int, around: Around) -> list[Feature]:
    """One bump, one ridge, or the ridges that meet."""
    highest = max(members, key=lambda c: abs(c.height))
    half_width = float(np.sqrt(2 * around.tip_radius * abs(highest.height)))
    half_width = max(half_width, min(c.half_width for c in members if abs(c.height) > 0.7 * abs(highest.height)))
    points = np.array([c.point for c in members])
    if np.linalg.norm(points - highest.point, axis=1).max() <= WIDEST_SPOT * half_width:
        spot = outline(members, around.inspection, half_width)
        if spot.length == 0.0:
            return [point_feature(members, NAMES[sign][0], around.detections, around.tip_radius, spot)]
    lines = line_features(members, NAMES[sign][1], around)
    return lines or [point_feature(members, NAMES[sign][0], around.detections, around.tip_radius)]


def _without_shadows(features: list[Feature], tip_radius: float) -> list[Feature]:
    """Features less what is only the flank of a higher one of either sign."""
    kept: list[Feature] = []
    for feature in sorted(features, key=lambda f: -abs(f.height.median)):
        shadow = False
        for other in kept:
            reach = 1.3 * np.sqrt(2 * tip_radius * abs(other.height.median))
            small = abs(feature.height.median) < 0.5 * abs(other.height.median)
            if small and distances(feature.axis, other.axis).max() < reach:
                shadow = True
        if not shadow:
            kept.append(feature)
    return kept
