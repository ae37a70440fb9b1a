"""Assemble: by the paper's grammar, crossings of sweeps become bumps, ridges, pits, grooves, steps and edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping import Feature, FloatArray, Trace
from mapping.assembly.details import along_rested, details_of, made_of
from mapping.assembly.edges import between_levels, edge_features, step_features
from mapping.assembly.faint_features import faint_spacing, why_none_sought, with_faint_lines
from mapping.assembly.false_crossings import (
    PLACES_OF_HALF,
    comes_down,
    cut_off,
    is_cut,
    is_open,
    is_plateau_end,
    is_unseen,
    on_a_step,
)
from mapping.assembly.free import free_sections, free_spot, outweighed, round_lines, uncrossed
from mapping.assembly.free_lines import free_lines, lies_on
from mapping.assembly.lines import Around
from mapping.assembly.linking import Inspection, Inspections, groups
from mapping.assembly.plateaus import across_sweeps, plateau_features
from mapping.assembly.points import point_feature
from mapping.assembly.runs import along, split_runs, told_crests
from mapping.base import Base, LaidTrace
from mapping.detection import Crossing, Detections
from mapping.geometry.mesh import distances
from mapping.geometry.templates import SHAPE_ERROR
from mapping.inference.configuration import (
    NEIGHBOURHOOD_REACH,
    PROPOSALS,
    Configuration,
    Places,
    Proposal,
    accounted,
    as_round,
    explains,
    is_two,
)
from mapping.inference.families import Surroundings
from mapping.inference.kinds import kind_made_of, kind_of

# A crossing lower than this share of its group's is an outlier if it lies so many half-widths off the others, and so
# many from any other low one; where others are so many that they are a line, not a spot with low rims.
STRAY, STRAY_DISTANCE, MATES, LINE = 0.6, 1.3, 3.0, 5


def assemble(
    detections: Detections,
    trace: Trace,
    base: Base,
    *,
    false_alarms_per_metre: float = 0.01,
    spacing: float | None = None,
    faint: bool = True,
    inspections: Inspections | None = None,
    proposals: Sequence[Proposal] = PROPOSALS,
) -> tuple[Feature, ...]:
    """Features of the base, the strongest evidence first, with preliminary intervals.

    Crossings of one sign are linked unless an inspected place between them was found clearly lower. A group is one bump
    (or pit) unless the heights of all places around say that it is longer: then a ridge (or groove), or several that
    meet, each with its ends, closed if it returns to its beginning. Steps are linked likewise; those that a ridge
    explains, because a sweep ran along it, are dropped, and crests that the sweep began or ended on are accepted only
    if no step explains them. What the rules say of details that are felt together, and of lines wider than a wire, is
    then improved as one configuration (`accounted`). Ridges and grooves too low for any one sweep are found where many
    sweeps agree. What is wide, on a base that was fitted, is measured as free sections. In a single profile every
    crossing is a bump, a pit or a step, or belongs to one of these.

    Args:
        detections: of the trace.
        trace: any set of sweeps; of a LaidTrace nothing is laid on the base again.
        base: the global model.
        false_alarms_per_metre: expected number of lines found in noise alone, 1/m of inspected path.
        spacing: distance between the places of a sweep whose heights are looked at, m; None: `place_spacing`.
        faint: False to leave out the search for lines too low for any one sweep.
        inspections: the heights of this trace, if they were looked at already (`inspected_for`).
        proposals: what the features of a neighbourhood may be instead, by evidence; none: what the rules say.

    Reference: paper definitions 2 and 3; theory section 5.
    """
    crossings = detections.crossings
    laid = LaidTrace.of(trace, base)
    if _is_profile(laid):
        return _of_profile(detections, laid)
    inspections = inspections or inspected_for(detections, laid, base, spacing=spacing, faint=faint)
    spacing = place_spacing(crossings, trace.tip_radius) if spacing is None and crossings else spacing
    wide, flat, round_it, spots = list[Feature](), list[Feature](), list[Feature](), list[Feature]()
    around = Surroundings(laid, base, detections.noise.rounded(laid.resolution))
    if spacing is not None and crossings:
        plain = Around(inspections.at(spacing), base, detections, trace.tip_radius)
        flat, crossings = plateau_features(crossings, plain)
        detections = replace(detections, crossings=crossings)
        round_it, crossings = round_lines(detections, plain.inspection.over_terraces, trace.tip_radius)
        detections = replace(detections, crossings=crossings)
    if base.kind != "mesh":  # a given base that is off is no detail, however wide
        sections, upon, rest = free_sections(detections, laid)
        sections = [section for section in sections if not any(lies_on(section.crossing, each) for each in flat)]
        wide, slanted = free_lines(sections, detections, laid)
        # several sections may hold what stands off all of them
        looked = None if spacing is None else inspections.at(spacing)
        if wide and looked is not None and proposals:
            fits = [as_round(spot, _places(looked), around, false_alarms_per_metre) for spot in wide]
            spots = [each[0] for each in fits if each is not None]
            felt = [each[1] for each in fits if each is not None]
            if felt:  # what a spot leaves on the rows at its foot is no detail of theirs
                sections = [each for each in sections if not any(_left_by(best, each.crossing) for best in felt)]
                rest, upon = ([c for c in own if not any(_left_by(best, c) for best in felt)] for own in (rest, upon))
                wide, slanted = free_lines(sections, detections, laid)
        stepped = [] if looked is None else [c for c in crossings if c.is_step and between_levels(c, looked)]
        held = [crossing for section in slanted for crossing in section.inside]
        fine = {id(c): c for c in [*rest, *upon, *held, *stepped]}
        crossings = _off_lines(tuple(fine.values()), wide, stepped, looked)
        if wide and looked is not None:
            beside = _linked(replace(detections, crossings=crossings), laid, looked)
            lost = outweighed(wide, beside, _linked(detections, laid, looked), looked, laid.tip_radius)
            if proposals:
                places = _places(looked)
                lost = [
                    out or is_two(line, places, around, false_alarms_per_metre)
                    for line, out in zip(wide, lost, strict=True)
                ]
            if any(lost):
                wide = [feature for feature, out in zip(wide, lost, strict=True) if not out]
                crossings = _off_lines(detections.crossings, wide, stepped, looked)
        detections = replace(detections, crossings=crossings)
    features = flat if spacing is None else [*flat, *spots, *_linked(detections, laid, inspections.at(spacing))]
    if features and spacing is not None and proposals:
        places = _places(inspections.at(spacing))
        alone = [feature for feature in wide if len(feature.axis) == 1 and feature.evidence.crossings == 1]
        beyond = set(map(id, cut_off(crossings, inspections.at(spacing).over_terraces)))
        told = [c for c in crossings if id(c) not in beyond]
        features, left = accounted(
            features, told, places, around, false_alarms_per_metre, proposals, alone, measured=wide
        )
        wide = [feature for feature in wide if feature not in alone or feature in left]
    if faint:
        features = with_faint_lines(features, detections, laid, base, false_alarms_per_metre, inspections)
    return _strongest_first([*wide, *uncrossed(round_it, features, laid.tip_radius), *features])


def _left_by(best: Configuration, crossing: Crossing) -> bool:
    """True if a configuration explains what a sweep detected."""
    return explains(best, crossing.point, crossing.height)


def _off_lines(
    crossings: Sequence[Crossing], lines: Sequence[Feature], stepped: Sequence[Crossing], inspection: Inspection | None
) -> tuple[Crossing, ...]:
    """Crossings that are no part of wide lines; steps between two levels go on under whatever is on them."""
    own = set(map(id, stepped))
    return tuple(c for c in crossings if id(c) in own or not any(lies_on(c, line, inspection) for line in lines))


def inspected_for(
    detections: Detections, trace: Trace, base: Base, *, spacing: float | None = None, faint: bool = True
) -> Inspections:
    """The heights that features are assembled from: the trace is passed once, whatever they are looked at for.

    Args:
        detections, trace, base, spacing, faint: as for `assemble`.
    """
    laid, needed = LaidTrace.of(trace, base), list[float]()
    if detections.crossings and not _is_profile(laid):
        needed.append(place_spacing(detections.crossings, trace.tip_radius) if spacing is None else spacing)
    if faint and not why_none_sought(detections, laid, base):
        needed.append(faint_spacing(detections, trace.tip_radius))
    return Inspections.of(laid, base, detections.noise, needed)


def half_felt(detections: Detections, laid: LaidTrace, inspections: Inspections) -> Sequence[Crossing]:
    """The crossings that `assemble` makes no feature of, for their sweeps began or ended before they had passed them.

    Args:
        detections, laid, inspections: as `assemble` got them.
    """
    if _is_profile(laid) or not detections.crossings:
        return ()
    return cut_off(
        detections.crossings, inspections.at(place_spacing(detections.crossings, laid.tip_radius)).over_terraces
    )


def _places(inspection: Inspection) -> Places:
    """The heights that configurations are weighed on."""
    return Places(
        inspection.points, inspection.normals, inspection.over_terraces.height, inspection.samples, inspection.sweep,
        inspection.spacing, inspection.height if len(inspection.lowered) else np.zeros(0), inspection.jumped,
    )  # fmt: skip


def _is_profile(laid: LaidTrace) -> bool:
    """True of a single sweep: nothing beside it tells how long a detail is."""
    return len({sweep.number for sweep in laid.laid_sweeps}) == 1


def place_spacing(crossings: Sequence[Crossing], tip_radius: float) -> float:
    """Distance between inspected places of a sweep, m: five to a half-width of a sharp crest of the typical height."""
    return _scale(crossings, tip_radius) / PLACES_OF_HALF


def _linked(detections: Detections, trace: LaidTrace, inspection: Inspection) -> list[Feature]:
    """Features of the crossings that single sweeps detected."""
    if not detections.crossings:
        return []
    tip, scale, base = trace.tip_radius, _scale(detections.crossings, trace.tip_radius), trace.base
    around = Around(inspection, base, detections, tip)
    edges, crossings = edge_features(detections.crossings, around)
    crests, steps = _crests_and_steps(crossings, around, scale)
    fine = replace(around, inspection=inspection.over_terraces)
    certain, doubtful = _grouped(crests, fine.inspection, scale)
    details = [feature for group in certain for feature in details_of(group, fine)]
    stepped = step_features(steps, _without_shadows(details, tip), around, scale)
    for group in doubtful:
        details += details_of([c for c in group if not on_a_step(c, steps, stepped)], fine)
    details = along_rested(details, crests, fine)
    return [*_without_shadows(details, tip), *stepped, *edges]


def _crests_and_steps(
    crossings: Sequence[Crossing], around: Around, scale: float
) -> tuple[list[Crossing], list[Crossing]]:
    """Crests and hollows, with places along those that a sweep ran along, and the steps that are not such runs."""
    crests = [c for c in crossings if not c.is_step]
    fine = around.inspection.over_terraces
    wrong = [c for c in crests if is_plateau_end(c, fine) or is_unseen(c, fine)]
    crossings = [c for c in crossings if c not in wrong]
    crests = [c for c in crests if c not in wrong]
    for slanted in [along(c, scale, around.base, around.tip_radius) for c in crests]:
        crests += told_crests(slanted, fine, around.tip_radius)
    runs, steps = split_runs([c for c in crossings if c not in crests and comes_down(c, fine)])
    edges = [c for run in runs for c in (run.first, run.last)] + steps
    pitch = around.inspection.pitch
    banded = across_sweeps([c for run in runs for c in (run.first, run.last)], around)
    for run in runs:
        if id(run.first) in banded or run.is_band(edges, pitch, around.tip_radius):
            steps += [run.first, run.last]
        else:
            crests += _on_crest(run.points(max(min(pitch, run.length), scale), around.base, around.tip_radius), around)
    return crests, steps


def _on_crest(places: Sequence[Crossing], around: Around) -> list[Crossing]:
    """Places on a run, or the crests beside them where other sweeps tell these."""
    told = told_crests(places, around.inspection.over_terraces, around.tip_radius)
    return told if len(told) >= 0.5 * len(places) else list(places)


def _grouped(
    crests: list[Crossing], inspection: Inspection, scale: float
) -> tuple[list[list[Crossing]], list[list[Crossing]]]:
    """Groups of linked crests of one sign: those that a sweep came down from on both sides, and the others; none of
    what no sweep passed."""
    certain: list[list[Crossing]] = []
    doubtful: list[list[Crossing]] = []
    for kind in ("convex", "concave"):
        alike = [c for c in crests if c.kind == kind]
        for members in groups(alike, inspection, scale) if alike else []:
            if all(is_cut(alike[i], inspection) for i in members):
                continue
            for group in _without_strays([alike[i] for i in members], scale):
                top = max(abs(c.height) for c in group)
                high = [c for c in group if abs(c.height) > 0.5 * top]
                (doubtful if all(is_open(c, inspection) for c in high) else certain).append(group)
    return certain, doubtful


def _without_strays(group: list[Crossing], scale: float) -> list[list[Crossing]]:
    """The group, and each isolated low crossing off its crest as a group of its own: an outlier, not a branch."""
    top = float(np.quantile([abs(c.height) for c in group], 0.8))
    low = [c for c in group if abs(c.height) + 2 * c.height_sd < STRAY * top]
    crest = [c.point for c in group if not any(c is other for other in low)]
    if len(crest) < LINE:
        return [group]
    # what lies on the flanks of the crest is no neighbour of what lies off it
    off = [c for c in low if _nearest(c.point, crest) > STRAY_DISTANCE * scale]
    strays = []
    for c in off:
        alike = [other.point for other in off if other.sweep != c.sweep]
        if _nearest(c.point, alike) > MATES * scale:
            strays.append(c)
    rest = [c for c in group if not any(c is stray for stray in strays)]
    return [*([rest] if rest else []), *([stray] for stray in strays)]


def _nearest(point: FloatArray, others: list[FloatArray]) -> float:
    """Distance of a point (3,) from the nearest of others, m."""
    return float(np.linalg.norm(np.array(others) - point, axis=1).min()) if others else float("inf")


def _of_profile(detections: Detections, laid: LaidTrace) -> tuple[Feature, ...]:
    """Features of a single sweep: each crossing one, but for those that are parts of a free section."""
    wide, upon, rest = list[Feature](), list[Crossing](), list(detections.crossings)
    if laid.base.kind != "mesh":  # a given base that is off is no detail, however wide
        sections, upon, rest = free_sections(detections, laid)
        wide = [free_spot(section, detections.algorithm) for section in sections]
    fine, standing = (
        [point_feature([c], _name(c), detections, laid.tip_radius) for c in crossings] for crossings in (rest, upon)
    )
    fine = [_as_wide_as_base_says(each, laid.base) for each in fine]
    measured = [replace(each, details=replace(each.details, free_section=True)) for each in standing]
    return _strongest_first([*wide, *fine, *measured])


def _as_wide_as_base_says(feature: Feature, base: Base) -> Feature:
    """A step with the run of the base's climb that it is on, if that is slanted, in its middle."""
    for place, run in base.climbs if kind_of(feature).sided else ():
        apart = place - feature.axis[0]
        aside = apart - (apart @ feature.normals[0]) * feature.normals[0]
        if np.linalg.norm(aside) < run:
            return replace(feature, axis=feature.axis + aside, details=replace(feature.details, run=run))
    return feature


def _name(crossing: Crossing) -> str:
    """What a crossing of a single profile is called."""
    return kind_made_of(made_of(crossing), line=False).name


def _strongest_first(features: Sequence[Feature]) -> tuple[Feature, ...]:
    return tuple(sorted(features, key=lambda f: -f.evidence.snr))


def _scale(crossings: Sequence[Crossing], tip_radius: float) -> float:
    """Half-width of a sharp crest of the typical height, m: the median, of crossings that are details of their own.

    Where nothing is noise, what a crest's own shape is wrong by is detected beside it, too, some nanometres high.
    """
    heights = np.array([abs(c.height) for c in crossings])
    points = np.array([c.point for c in crossings])
    own = np.ones(len(crossings), dtype=bool)
    for k in np.flatnonzero(heights < SHAPE_ERROR * heights.max()):
        reach = NEIGHBOURHOOD_REACH * np.sqrt(2.0 * tip_radius * heights)
        beside = np.linalg.norm(points - points[k], axis=1) < reach
        own[k] = not (beside & (SHAPE_ERROR * heights > heights[k])).any()
    return float(np.sqrt(2 * tip_radius * np.median(heights[own])))


def _without_shadows(features: list[Feature], tip_radius: float) -> list[Feature]:
    """Features less what is only the flank of a higher one of either sign."""
    kept: list[Feature] = []
    for feature in sorted(features, key=lambda f: -abs(f.height.median)):
        shadow = False
        # where a line was crossed; its ends lie as far beyond as the sweeps allow
        crossed = feature.axis[1:-1] if len(feature.axis) > 3 else feature.axis
        for other in kept:
            reach = 1.3 * np.sqrt(2 * tip_radius * abs(other.height.median))
            small = abs(feature.height.median) < 0.5 * abs(other.height.median)
            if small and distances(crossed, other.axis).max() < reach:
                shadow = True
        if not shadow:
            kept.append(feature)
    return kept
