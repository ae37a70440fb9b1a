"""Round lines: what one sweep felt round the body, as no spot is felt: a line that it ran along.

A spot is felt on the side of the body that it stands on. A sweep that winds round the body and stays off the base for
longer ran along a line, as along a ring that one turn of a helix passes. Where no sweep crosses it, nothing tells how
wide it is, and it is at least as high as it was felt; where others do, they tell the line, and it is no other one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping import Details, Feature, IntArray, Interval, Support
from mapping.assembly.free.outline import WIDER_THAN_CREST
from mapping.assembly.linking import Inspection
from mapping.detection import Crossing, Detections
from mapping.geometry.mesh import nearest_on, resample
from mapping.inference.kinds import kind_made_of, kind_of, sizes_of

# Points of the axis are so far apart round the body, rad: chords lie 0.1^2 / 8, a thousandth of its radius, under it
AXIS_STEP = 0.1
# Standard deviations that a place stands clear of its noise by: one of 740 does by chance (one side of a Gaussian)
CLEAR_SDS = 3.0
# Points of a line that are asked for other lines: whether most of it lies on these is told to a 64th of its length
POINTS_ASKED = 65
ALONE = (
    "one sweep ran along it round the body, and none crosses it: nothing tells how far beside that sweep it lies, and "
    "how wide it is"
)


def round_lines(
    detections: Detections, inspection: Inspection, tip_radius: float
) -> tuple[list[Feature], tuple[Crossing, ...]]:
    """The lines that single sweeps ran along round the body, and the crossings that are no part of them.

    Args:
        detections: crests and hollows of all sweeps.
        inspection: heights of all places.
        tip_radius: m.
    """
    found, parts = list[Feature](), set[int]()
    for crossing in sorted(detections.crossings, key=lambda each: -each.snr):
        crest = WIDER_THAN_CREST * float(np.sqrt(2.0 * tip_radius * abs(crossing.height)))
        if crossing.is_step or id(crossing) in parts or crossing.half_width < crest:
            continue
        run = _run(crossing, inspection)
        if not (inspection.normals[run] @ crossing.normal < 0.0).any():
            continue
        line = _line(crossing, run, inspection, detections, tip_radius)
        found.append(line)
        # as wide and of its sign, it is the same line again; lower, it is how flanks that no filter is as long as
        # differ from a crest's
        height = line.height.median
        beside = [c for c in detections.crossings if c.sweep == crossing.sweep and not c.is_step]
        on_it = np.isin(inspection.nearest(np.array([c.point for c in beside])), run)
        parts |= {id(crossing)} | {
            id(c)
            for c, on in zip(beside, on_it, strict=True)
            if on and (abs(c.height) < 0.5 * abs(height) or (c.height * height > 0.0 and c.half_width > crest))
        }
    return found, tuple(c for c in detections.crossings if id(c) not in parts)


def uncrossed(round_it: Sequence[Feature], features: Sequence[Feature], tip_radius: float) -> list[Feature]:
    """Those of the lines that single sweeps ran along that are none of the lines which crossings tell.

    A sweep that runs along a line feels it while it is within what that disturbs: where most of what it felt lies as
    near to lines of its sign, it felt these.

    Args:
        round_it: of `round_lines`.
        features: that crossings tell.
        tip_radius: m.
    """
    return [line for line in round_it if not _is_told(line, features, tip_radius)]


def _is_told(line: Feature, features: Sequence[Feature], tip_radius: float) -> bool:
    """True if most of a line lies on others of its sign that crossings tell."""
    points = resample(line.axis, POINTS_ASKED)
    on = np.zeros(len(points), dtype=bool)
    for other in features:
        if kind_of(other).line and kind_of(other).sign == kind_of(line).sign:
            away = np.linalg.norm(points - nearest_on(points, other.axis)[0], axis=1)
            on |= away < sizes_of(other, tip_radius).half_width
    return bool(on.mean() > 0.5)


def _run(crossing: Crossing, inspection: Inspection) -> IntArray:
    """Places of its sweep about a crest or hollow, and within it, that stand off as it does, clear of their noise."""
    own = inspection.of_sweep(crossing.sweep)
    if not len(own):
        return own
    way = inspection.points[own]
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    middle = passed[int(np.linalg.norm(way - crossing.point, axis=1).argmin())]
    own = own[np.abs(passed - middle) < crossing.half_width]
    felt = np.sign(crossing.height) * inspection.height[own]
    low, top = np.flatnonzero(felt < CLEAR_SDS * inspection.sd[own]), int(felt.argmax())
    begin, end = low[low < top], low[low > top]
    run: IntArray = own[int(begin[-1]) + 1 if len(begin) else 0 : int(end[0]) if len(end) else len(own)]
    return run


def _line(
    crossing: Crossing, run: IntArray, inspection: Inspection, detections: Detections, tip_radius: float
) -> Feature:
    """The ridge or groove along those of a run of places that are half as high as the highest."""
    felt = np.abs(inspection.height[run])
    run = run[felt > 0.5 * felt.max()]
    chosen = [run[0]]
    for place in run[1:]:
        if place == run[-1] or inspection.normals[place] @ inspection.normals[chosen[-1]] < np.cos(AXIS_STEP):
            chosen.append(place)
    axis = inspection.points[chosen]
    # the highest of many places is so by noise: in the middle third the sweep was nearest to the crest
    middle = run[len(run) // 3 : max(2 * len(run) // 3, 1)]
    height = float(np.median(inspection.height[middle]))
    likely = Interval.normal(height, float(inspection.sd[middle].mean() / np.sqrt(len(middle))))
    reach = float(np.sqrt(2.0 * tip_radius * abs(height)))
    length = float(np.linalg.norm(np.diff(axis, axis=0), axis=1).sum())
    kind = kind_made_of("convex" if height > 0.0 else "concave", line=True).name
    return Feature(
        kind=kind,
        axis=axis,
        normals=inspection.normals[chosen],
        height=replace(likely, censored=True),
        width=Interval(reach, 0.0, 2.0 * reach, censored=True, bounded=True),
        length=Interval(length, length, length, censored=True),
        evidence=Support(crossing.snr, 1, (detections.algorithm,)),
        curvature_feature=False,
        position_sd=float(reach / np.sqrt(3.0)),
        notes=(ALONE,),
        details=Details(free_section=True, misfit=ALONE),
    )
