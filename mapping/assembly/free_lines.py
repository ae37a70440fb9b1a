"""Free lines: what several sweeps cross that is so wide that each of them shows its section.

The sections of the sweeps (`free_sections`) are linked as crossings of fine details are. Together they are a line, or a
spot if they lie no further apart than one of them is felt. Its sizes are means over its sections, laid square to the
line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping import Details, Feature, FloatArray, Support, length_text
from mapping.assembly.free import CORE, WIDER_THAN_CREST, FreeSection, free_spot, mean_sizes
from mapping.assembly.lines import FULL_HEIGHT, ONE_POINT, mean_point, merged
from mapping.assembly.linking import Branch, Inspection, Inspections, LineEnd, branches, ended_length, groups
from mapping.base import LaidTrace
from mapping.detection import Crossing, Detections
from mapping.geometry.mesh import distances
from mapping.geometry.templates import SHAPE_ERROR
from mapping.inference import REMARKED_CHANCE
from mapping.inference.kinds import kind_made_of

# Places to the core of a section, which has to be felt for a sweep to deny it; 6 are alike
PLACES_PER_CORE = 3.0
# How far beyond its last section a line is looked for, in pitches of the sweeps: the next sweep lies nearer unless the
# line runs at a slant of more than 70 degrees to them
END_PITCHES = 3.0
# Legs of an axis that tell its direction at an end: over 24 rasters (seeds 100 to 105) 2 and 8 are alike
LAST_LEGS = 4
# Sections by which it is asked whether a line is the same all along: of two the scatter has one degree of freedom, and
# tells no change along the line from one section that is off
FEWEST_VARYING = 3
# Half of a 90 % interval of what is equally probable over a stretch of one
UNIFORM_HALF_90 = 0.45


def free_lines(
    sections: Sequence[FreeSection], detections: Detections, trace: LaidTrace
) -> tuple[list[Feature], list[FreeSection]]:
    """The ridges, grooves, bumps and pits that the sections of several sweeps are of, and the sections that are of
    none: wide because their sweeps run at a slant to a line, or over several of them at once.

    Reference: theory section 5.4.
    """
    found, slanted = list[Feature](), list[FreeSection]()
    for sign in (1.0, -1.0):
        alike = [section for section in sections if section.sign == sign]
        if alike:
            core = CORE * float(np.median([section.sizes.width for section in alike]))
            spacing = core / PLACES_PER_CORE
            inspection = Inspections.of(trace, trace.base, detections.noise, [spacing]).at(spacing)
            linked = groups([section.crossing for section in alike], inspection, core)
            own = list[Feature]()
            # what ends a line is found with it, and what is felt at the foot of a spot with that
            for members in sorted(linked, key=lambda own: (len(own), _height_of(own, alike)), reverse=True):
                group = [alike[k] for k in members]
                if not any(_is_of(section, line) for line in own for section in group):
                    lines, not_wide = _of_group(group, inspection, detections, trace)
                    own, slanted = [*own, *lines], [*slanted, *not_wide]
            found += own
    return found, slanted


def _height_of(members: Sequence[int], sections: Sequence[FreeSection]) -> float:
    return max(sections[k].sizes.height for k in members)


def _is_of(section: FreeSection, feature: Feature) -> bool:
    """True of a section that is another piece of a line, as at its end, or whose middle lies on a spot."""
    if len(feature.axis) > 1:
        return lies_on(section.crossing, feature)
    away = float(np.linalg.norm(section.crossing.point - feature.axis[0]))
    return away < 0.5 * feature.width.high


def lies_on(crossing: Crossing, feature: Feature, inspection: Inspection | None = None) -> bool:
    """True of a crossing of the feature's sign within its width, or where its end may be: a part of it.

    With an inspection the line goes on beyond an end that no sweep saw, as far as no place on its way was found lower.
    """
    alike = crossing.is_step or crossing.height * feature.height.median > 0.0
    reach = 0.5 * feature.width.high + crossing.half_width + feature.length.high - feature.length.median
    if not alike:
        return False
    if distances(crossing.point[None], feature.axis)[0] < reach:
        return True
    if inspection is None or not feature.length.censored or len(feature.axis) < 2:
        return False
    beyond = _gone_on(feature, crossing.point)
    near = distances(crossing.point[None], beyond)[0] < reach
    return bool(near and not inspection.denies(beyond, feature.height.median, CORE * feature.width.median))


def _gone_on(feature: Feature, point: FloatArray) -> FloatArray:
    """(M, 3) places from the nearer end of a line straight on to where it passes a point (3,)."""
    first = np.linalg.norm(point - feature.axis[0]) < np.linalg.norm(point - feature.axis[-1])
    axis = feature.axis[::-1] if first else feature.axis
    back = axis[max(len(axis) - LAST_LEGS - 1, 0)]
    way = (axis[-1] - back) / max(float(np.linalg.norm(axis[-1] - back)), np.finfo(float).tiny)
    far = max(float((point - axis[-1]) @ way), 0.0)
    count = int(np.ceil(far / (CORE * feature.width.median))) + 1
    return np.asarray(axis[-1] + np.linspace(0.0, far, count)[:, None] * way)


def _of_group(
    group: list[FreeSection], inspection: Inspection, detections: Detections, trace: LaidTrace
) -> tuple[list[Feature], list[FreeSection]]:
    """The spot, or the lines, that linked sections are of; and those of them that are of no line, or not wide across
    it."""
    highest = max(group, key=lambda section: abs(section.crossing.height))
    points = np.array([section.crossing.point for section in group])
    # a round spot is felt as far across the sweeps as along them, wider than it is by what the ball adds to either side
    if np.linalg.norm(np.ptp(points, axis=0)) <= highest.extent and not _goes_on(points, group, inspection):
        alone = len({section.crossing.sweep for section in group}) == 1
        long = alone and highest.sizes.width > 2.0 * inspection.pitch
        if long or _is_long(highest, group, inspection):
            return [], group
        if not _is_wide(_through(points, CORE * highest.sizes.width), group):
            return [], group
        spot = free_spot(_between_sweeps(highest, group), detections.algorithm)
        # a flat top is as high on all its sweeps: the highest may be any of them, the middle lies amid all
        middle = np.average(points, axis=0, weights=[abs(section.crossing.height) for section in group])
        foot = trace.base.foot((middle + trace.tip_radius * spot.normals[0])[None], trace.tip_radius)
        evidence = _evidence(group, detections.algorithm)
        return [replace(spot, axis=foot.points, normals=foot.normals, evidence=evidence)], []
    half_width = 0.5 * float(np.median([section.sizes.width for section in group]))
    # a row that was swept to and fro crosses twice in one place
    places = np.array([mean_point(each) for each in merged([s.crossing for s in group], ONE_POINT * half_width)])
    lines = [line for line in branches(places, half_width) if len(line.axis) > 1]
    if not lines:  # of lines nearer to one another than their sections are wide no middle need lie on one
        return [], group
    apart = np.array([distances(points, line.axis) for line in lines])
    found, slanted = list[Feature](), list[FreeSection]()
    for number, line in enumerate(lines):
        own = [group[k] for k in np.flatnonzero(apart.argmin(axis=0) == number)]
        if own and _is_wide(line.axis, own):
            found.append(_line(line, own, inspection, detections, trace))
        else:
            slanted += own
    return found, slanted


def _is_long(highest: FreeSection, group: Sequence[FreeSection], inspection: Inspection) -> bool:
    """True of sections that are of no spot but of what runs along their sweeps: what is as wide across its sweeps as
    along them is felt half as high by all that pass within that, but for one to either side."""
    whole = [each.crossing for each in group if each.sizes.height > 0.5 * highest.sizes.height]
    high = {crossing.sweep for crossing in whole}
    # the highest of a flat top may be any of its sweeps, and lie at its rim
    middle = np.mean([crossing.point for crossing in whole], axis=0)
    places = inspection.near(middle[None], 0.5 * highest.half_extent)
    return len(high.union(inspection.sweep[places].tolist())) > len(high) + 2


def _goes_on(points: FloatArray, group: Sequence[FreeSection], inspection: Inspection) -> bool:
    """True of sections (N,) at points (N, 3) of which no sweep saw an end on either side, and whose widths are those of
    a line rather than the chords of a round spot.

    Chords of a circle of width W about a place s0 along the line through all have w^2 = W^2 - 4 (s - s0)^2: with 4 s^2
    added that is linear in s, of two parameters as unknown as the one width of a line. Two sections tell neither.
    """
    if len({section.crossing.sweep for section in group}) < FEWEST_VARYING:
        return False
    middle = points.mean(axis=0)
    s = (points - middle) @ np.linalg.svd(points - middle, full_matrices=False)[2][0]
    width = np.array([section.sizes.width for section in group])
    doubt = np.hypot([section.sizes.width_sd for section in group],
                     [section.piece.spacing / np.sqrt(6.0) for section in group])  # fmt: skip
    weight = 1.0 / doubt
    off_line = weight * (width - np.average(width, weights=weight**2))
    design, chords = np.column_stack([np.ones(len(s)), s]), width**2 + 4.0 * s**2
    weight = weight / (2.0 * width)
    off_spot = weight * (chords - design @ np.linalg.lstsq(design * weight[:, None], chords * weight, rcond=None)[0])
    if float(off_line @ off_line) >= float(off_spot @ off_spot):
        return False
    ends, height = points[[s.argmin(), s.argmax()]], float(np.median([section.crossing.height for section in group]))
    return not any(_end(axis, height, float(np.median(width)), inspection).seen for axis in (ends, ends[::-1]))


def _through(points: FloatArray, core: float) -> FloatArray:
    """(2, 3) or (1, 3): the straight line through places (N, 3), or the one place that they are if they lie within the
    core (m) of a section: the same row again. Middles of a spot lie across its sweeps."""
    middle = points.mean(axis=0)
    if np.linalg.norm(np.ptp(points, axis=0)) < core:
        return np.asarray(middle[None])
    way = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    return np.stack([middle - way, middle + way])


def _is_wide(axis: FloatArray, group: Sequence[FreeSection]) -> bool:
    """True of sections that are wide across a line (K, 3), too; on a place (1, 3) alone nothing tells a slant."""
    square = [_squareness(axis, section) if len(axis) > 1 else 1.0 for section in group]
    return bool(
        np.median([by * section.times_crest for by, section in zip(square, group, strict=True)]) > WIDER_THAN_CREST
    )


def _between_sweeps(highest: FreeSection, group: list[FreeSection]) -> FreeSection:
    """The highest section of a spot, which may be higher still between two sweeps: a cone's tip, half a pitch aside, is
    by half of what the sweep beside it is lower."""
    others = [section.sizes.height for section in group if section is not highest]
    more = 0.5 * max(highest.sizes.height - max(others), 0.0) if others else 0.0
    return replace(highest, sizes=replace(highest.sizes, below=highest.sizes.below + more))


def _line(
    line: Branch, group: list[FreeSection], inspection: Inspection, detections: Detections, trace: LaidTrace
) -> Feature:
    """A line of the mean section of its sweeps."""
    whole = _whole(group, line)
    square = np.array([_squareness(line.axis, section) for section in whole])
    sizes = mean_sizes(whole, square, trace.tip_radius, detections.noise)
    sign, crossings = group[0].sign, [section.crossing for section in whole]
    notes = sizes.notes
    axis, ends = _ended(line, sign * sizes.height, sizes.width, inspection)
    feet = trace.base.foot(axis, trace.tip_radius)
    length = ended_length(axis, ends)
    if length.censored:
        notes = (*notes, "runs on where nothing was inspected: its length is at least this")
    return Feature(
        kind=kind_made_of(crossings[0].kind, line=True).name,
        axis=np.vstack([feet.points[:-1], feet.points[:1]]) if line.closed else feet.points,
        normals=feet.normals,
        height=sizes.height_interval(sign, _sd_of_mean([c.height for c in crossings])),
        width=sizes.width_interval(_sd_of_mean(square * [section.sizes.width for section in whole])),
        length=length,
        evidence=_evidence(group, detections.algorithm),
        curvature_feature=False,
        position_sd=float(np.median([c.position_sd for c in crossings])),
        notes=notes,
        junction=line.junction,
        details=Details(top=sizes.top, free_section=True, misfit=_varying(whole, line.axis, square)),
    )


def _varying(group: Sequence[FreeSection], axis: FloatArray, square: FloatArray) -> str | None:
    """What is to be said of a line whose width, or height, is not the same all along it; None if it may be.

    Sections of one line differ by their noise, by where their samples lie and by SHAPE_ERROR. Where lines meet, or
    something wide narrows, they differ by more. Those near an end are cut by it: the middle half is asked.
    """
    from scipy.special import gammaincc

    at = np.array([np.linalg.norm(axis - section.crossing.point, axis=1).argmin() for section in group])
    order = np.argsort(at, kind="stable")
    middle = order[len(order) // 4 : len(order) - len(order) // 4]
    if len(middle) < FEWEST_VARYING:
        return None
    sizes = [group[k].sizes.across(float(square[k])) for k in middle]
    widths, heights = (np.array([getattr(each, name) for each in sizes]) for name in ("width", "height"))
    between = np.array([group[k].piece.spacing for k in middle]) / np.sqrt(6.0)  # of two sides that are walls
    doubts = np.hypot([each.width_sd for each in sizes], between), np.array([each.height_sd for each in sizes])
    for name, values, doubt in zip(("width", "height"), (widths, heights), doubts, strict=True):
        weight = 1.0 / (doubt**2 + (SHAPE_ERROR * values) ** 2)
        excess = float((weight * (values - np.average(values, weights=weight)) ** 2).sum())
        if gammaincc(0.5 * (len(values) - 1), 0.5 * excess) < REMARKED_CHANCE:
            least, most = (length_text(value, 2) for value in (values.min(), values.max()))
            return f"its {name} varies along it: single sweeps show {least} to {most}"
    return None


def _whole(group: list[FreeSection], line: Branch) -> list[FreeSection]:
    """The sections less those at the ends of a line that are lower: these sweeps passed where it is no longer whole."""
    along = [int(np.linalg.norm(line.axis - section.crossing.point, axis=1).argmin()) for section in group]
    order = [group[k] for k in np.argsort(along, kind="stable")]
    usual = float(np.median([section.sizes.height for section in order]))
    while len(order) > 2 and not line.closed:
        ends = [
            each
            for each in (order[0], order[-1])
            if each.sizes.height + 2.0 * each.sizes.height_sd < FULL_HEIGHT * usual
        ]
        if not ends:
            break
        order.remove(min(ends, key=lambda section: section.sizes.height))
    return order


def _evidence(group: Sequence[FreeSection], algorithm: int) -> Support:
    """All sweeps together: each tells of it by itself."""
    snr = float(np.sqrt(sum(section.crossing.snr**2 for section in group)))
    return Support(snr, len(group), (algorithm,), sum(section.log_odds for section in group))


def _sd_of_mean(values: Sequence[float] | FloatArray) -> float:
    """Standard deviation of a mean by how far the values (N,) scatter, of sections that may vary along a line."""
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 2 else 0.0


def _squareness(axis: FloatArray, section: FreeSection) -> float:
    """Sine of the angle between a line's axis (K, 3) and the sweep that shows a section of it."""
    nearest = int(np.linalg.norm(axis - section.crossing.point, axis=1).argmin())
    leg = axis[min(nearest + 1, len(axis) - 1)] - axis[max(nearest - 1, 0)]
    return float(np.linalg.norm(np.cross(leg, section.crossing.tangent)) / np.linalg.norm(leg))


def _ended(line: Branch, height: float, width: float, inspection: Inspection) -> tuple[FloatArray, list[LineEnd]]:
    """The axis up to its ends: half-way to the next sweep that felt nothing of it."""
    if line.closed:
        return np.vstack([line.axis, line.axis[:1]]), []
    axis, ends = line.axis, []
    for free in line.free[::-1]:
        if free:
            ends.append(_end(axis, height, width, inspection))
            axis = np.vstack([axis, ends[-1].point])
        axis = axis[::-1]
    return axis, ends


def _end(axis: FloatArray, height: float, width: float, inspection: Inspection) -> LineEnd:
    """The last end of an axis (K, 3): between the last sweep that is half as high there, and the next that is not."""
    back = axis[max(len(axis) - LAST_LEGS - 1, 0)]
    way = (axis[-1] - back) / max(float(np.linalg.norm(axis[-1] - back)), np.finfo(float).tiny)
    reach = END_PITCHES * inspection.pitch if np.isfinite(inspection.pitch) else width
    places = inspection.near(np.stack([axis[-1], axis[-1] + reach * way]), CORE * width)
    offset = inspection.points[places] - axis[-1]
    along = offset @ way
    aside = np.linalg.norm(offset - np.outer(along, way), axis=1)
    felt, beside = inspection.height[places] * np.sign(height), (aside < CORE * width) & (along < reach)
    passed = []
    for number in np.unique(inspection.sweep[places[beside]]):
        own = np.flatnonzero(beside & (inspection.sweep[places] == number))
        passed.append((float(along[own[aside[own].argmin()]]), bool(felt[own].max() > 0.5 * abs(height))))
    last = 0.0
    for at, shows in sorted(passed):
        if shows:
            last = max(last, at)
        elif at > last:
            gap = at - last
            point = axis[-1] + (last + 0.5 * gap) * way
            return LineEnd(point, UNIFORM_HALF_90 * gap, UNIFORM_HALF_90 * gap, seen=True, dropped=0)
    return LineEnd(axis[-1] + last * way, 0.0, 0.0, seen=False, dropped=0)
