"""Details: a group of linked crossings is one spot, one line, lines that meet, or such ones of each of its summits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping import Feature, IntArray
from mapping.assembly.lines import Around, line_features, rested_lines
from mapping.assembly.linking import Inspection, summits
from mapping.assembly.points import LINE_OVER_SPOT_GAIN, OUTLINE_REACH, outline, point_feature
from mapping.detection import Crossing
from mapping.geometry.mesh import distances
from mapping.geometry.templates import CREST_OUTLIER_SDS, SHAPE_ERROR, crest_trace, robust_cost
from mapping.inference.kinds import kind_made_of, kind_of, sizes_of

# A group of crossings that spreads over more than this many half-widths cannot be one round bump: sweeps further
# than one half-width from its crest miss it. Over 18 simulated plates of braille dots and 8 of lines (below) 2.0, 2.3
# and 3.0 say the same.
WIDEST_SPOT = 2.6
# Twice the log-likelihood by which one detail more must explain the heights better: it has four parameters, and both
# that make a line of a spot are asked LINE_OVER_SPOT_GAIN. Of 144 dots on 18 simulated plates (2.5 mm apart; balls of
# 1.5 and 2.5 mm; rows 0.25 to 0.5 mm apart, turned by 0 to 29 degrees) 139 are bumps within 0.1 mm of their place
# before anything is weighed; a quarter and a half of this cost say 139, too, with a few more pieces, twice 138 and four
# times 137
DETAIL_COST = 2.0 * LINE_OVER_SPOT_GAIN
# Lower than this share of the highest a top is the flank of what lies beside the group: crossings link down to half of
# the lower one (`Inspection.denies`). On the same plates 0.3 tells 138 dots and six pieces more, 0.7 tells 139 and five
# less, which would join a dot to one that is half as high again
LOW_TOP = 0.5


def details_of(members: list[Crossing], around: Around) -> list[Feature]:
    """One bump, one ridge, or the ridges that meet; or those of each summit, where these explain the heights better.

    Args:
        members: crossings of one group; of none nothing is made.
        around: the heights of all places, and what they stand on.

    Reference: theory section 5.2.
    """
    if not members:
        return []
    whole, parted = _undivided(members, around), _of_summits(members, around)
    return parted if parted and _explain_better(parted, whole, members, around) else whole


def along_rested(details: Sequence[Feature], crossings: Sequence[Crossing], around: Around) -> list[Feature]:
    """The details, those that are felt together as the lines that balls may have rested on where these leave no more
    than noise, and the details do.

    Strokes that bend, or run side by side, nearer to each other than a ball is wide are linked as they are not by
    crossings that single sweeps show.

    Args:
        details: that groups of crossings tell.
        crossings: of the groups.
        around: the heights of all places, and what they stand on.
    """
    kind, told = kind_made_of("convex", line=True), list[Feature]()
    crests = [c for c in crossings if c.height > 0.0 and not c.is_step]
    for own, members in _felt_together(details, crests, around.tip_radius):
        best = own
        stands = any(kind_of(each).sign > 0 for each in own)
        if stands and _may_be_longer(members, around.tip_radius) and _misfit(own, members, around):
            lines = _along_rested(members, kind.name, around)
            hollows = [each for each in own if kind_of(each).sign < 0]
            for other in (lines, [*lines, *hollows]):
                if not _misfit(other, members, around):
                    best = other
                    break
        told += best
    return told


def _may_be_longer(members: Sequence[Crossing], tip_radius: float) -> bool:
    """True of crests that spread farther than one spot reaches."""
    points, widest = [c.point for c in members], max((abs(c.height) for c in members), default=0.0)
    return len(members) > 1 and bool(
        np.linalg.norm(np.ptp(points, axis=0)) > WIDEST_SPOT * np.sqrt(2.0 * tip_radius * widest)
    )


def _along_rested(members: list[Crossing], kind: str, around: Around) -> list[Feature]:
    """The lines that balls may have rested on, each as its straight strokes where these explain the heights better."""
    pairs = rested_lines(members, kind, around)
    told = [bent for bent, _ in pairs]
    for k, (_, straight) in enumerate(pairs):
        other = [*told[:k], straight, *told[k + 1 :]]
        whole, parted = ([feature for each in some for feature in each] for some in (told, other))
        if straight and _gain(parted, whole, members, around) > DETAIL_COST * (len(parted) - len(whole)):
            told = other
    return [feature for each in told for feature in each]


def _felt_together(
    details: Sequence[Feature], crests: Sequence[Crossing], tip_radius: float
) -> list[tuple[list[Feature], list[Crossing]]]:
    """Details whose disturbances touch directly or by crests between them, and these crests."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if not crests:
        return [([each], []) for each in details]
    points, reach = (
        np.array([c.point for c in crests]),
        np.sqrt(2.0 * tip_radius * np.array([c.height for c in crests])),
    )
    one, other = cKDTree(points).query_pairs(2.0 * float(reach.max()), output_type="ndarray").T
    touch = np.linalg.norm(points[one] - points[other], axis=1) < reach[one] + reach[other]
    links = [np.stack([one, other])[:, touch]]
    for k, each in enumerate(details):
        felt = np.flatnonzero(distances(points, each.axis) < sizes_of(each, tip_radius).half_width + reach)
        links.append(np.stack([np.full(len(felt), len(crests) + k), felt]))
    pairs, size = np.concatenate(links, axis=1), len(crests) + len(details)
    count, label = connected_components(coo_array((np.ones(pairs.shape[1]), tuple(pairs)), shape=(size, size)))
    return [
        (
            [each for each, at in zip(details, label[len(crests) :], strict=True) if at == number],
            [crest for crest, at in zip(crests, label, strict=False) if at == number],
        )
        for number in range(count)
    ]


def made_of(crossing: Crossing) -> str:
    """What a kind is made of (`Kind.made_of`) that such a crossing belongs to."""
    return "step" if crossing.is_step else "convex" if crossing.height > 0 else "concave"


def _undivided(members: list[Crossing], around: Around) -> list[Feature]:
    """One bump, one ridge, or the ridges that meet."""
    highest = _highest(members)
    spot_name, line_name = (kind_made_of(made_of(highest), line=line).name for line in (False, True))
    half_width = float(np.sqrt(2 * around.tip_radius * abs(highest.height)))
    half_width = max(half_width, min(c.half_width for c in members if abs(c.height) > 0.7 * abs(highest.height)))
    points = np.array([c.point for c in members])
    if np.linalg.norm(points - highest.point, axis=1).max() <= WIDEST_SPOT * half_width:
        spot = outline(members, around.inspection, half_width)
        if spot.length == 0.0:
            return [point_feature(members, spot_name, around.detections, around.tip_radius, spot)]
    lines = line_features(members, line_name, around)
    return lines or [point_feature(members, spot_name, around.detections, around.tip_radius)]


def _of_summits(members: list[Crossing], around: Around) -> list[Feature]:
    """The details of each summit of a group; nothing if it has only one."""
    points, inspection = np.array([c.point for c in members]), around.inspection
    near = _near(members, around)
    basins = summits(near, float(np.sign(_highest(members).height)), inspection)
    tops = np.abs(inspection.height[[basin[0] for basin in basins]])
    basins = [basin for basin, top in zip(basins, tops, strict=True) if top > LOW_TOP * tops[0]]
    if len(basins) < 2:
        return []
    places = np.concatenate(basins)
    home = np.repeat(np.arange(len(basins)), [len(basin) for basin in basins])
    nearest = inspection.of_places(places).nearest(points)
    # a sweep over two that are felt together may see one, between them and higher than what was felt there
    off = np.abs([c.height for c in members] - inspection.height[places[nearest]])
    true = off < CREST_OUTLIER_SDS * SHAPE_ERROR * np.abs([c.height for c in members])
    details = list[Feature]()
    for k, basin in enumerate(basins):
        own = [c for c, at, told in zip(members, home[nearest], true, strict=True) if told and at == k]
        own = _with_top(own, members, int(basin[0]), inspection)
        details += _undivided(own, replace(around, inspection=inspection.of_places(np.sort(basin))))
    return details


def _with_top(own: list[Crossing], members: list[Crossing], top: int, inspection: Inspection) -> list[Crossing]:
    """The crossings of a basin, the one nearest to its top (index of a place) moved there; else the nearest of all."""
    point = inspection.points[top]
    nearest = min(own or members, key=lambda c: float(np.linalg.norm(c.point - point)))
    moved = replace(nearest, point=point, height=float(inspection.height[top]))
    return [moved, *(c for c in own if c is not nearest)]


def _explain_better(
    parted: Sequence[Feature], whole: Sequence[Feature], members: list[Crossing], around: Around
) -> bool:
    """True if the details of summits explain the heights about a group better by more than what they cost.

    One that leaves no more than noise needs no others: of a line that a few sweeps crossed the course is as yet the
    crossings' own, and what it is off by is gained by any parting of it (a wire of nine crossings, one of them 0.4 mm
    aside, left 0.6 of a square a place and was three ridges, which left 0.4).
    """
    costs = DETAIL_COST * (len(parted) - len(whole))
    return _misfit(whole, members, around) and _gain(parted, whole, members, around) > costs


def _misfit(details: Sequence[Feature], members: list[Crossing], around: Around) -> bool:
    """True if details leave more than noise at the places about a group."""
    near = _near(members, around)
    return _left_over(details, near, members, around) > len(near)


def _gain(parted: Sequence[Feature], whole: Sequence[Feature], members: list[Crossing], around: Around) -> float:
    """By how much more some details explain the heights about a group than others do, in squares of the noise.

    What is left over by the better of the two as well, as where other details are felt, speaks for neither: the gain is
    divided by it (a quasi-likelihood; Wedderburn, Biometrika 61, 1974).
    """
    near = _near(members, around)
    before, after = (_left_over(details, near, members, around) for details in (whole, parted))
    return (before - after) / max(1.0, min(before, after) / len(near))


def _left_over(details: Sequence[Feature], near: IntArray, members: list[Crossing], around: Around) -> float:
    """Squares of what details leave over at places (indices), in standard deviations."""
    inspection = around.inspection
    felt = np.zeros(len(near))
    for feature in details:
        half = sizes_of(feature, around.tip_radius).half_width
        own = crest_trace(distances(inspection.points[near], feature.axis), feature.height.median, half)
        felt = np.where(np.abs(own) > np.abs(felt), own, felt)
    over = robust_cost(inspection.height[near] - felt, inspection.sd[near], abs(_highest(members).height))
    return float(over.sum())


def _near(members: Sequence[Crossing], around: Around) -> IntArray:
    """Places (indices) as near to a group as its highest crossing disturbs them."""
    reach = OUTLINE_REACH * float(np.sqrt(2.0 * around.tip_radius * abs(_highest(members).height)))
    return around.inspection.near(np.array([c.point for c in members]), reach)


def _highest(members: Sequence[Crossing]) -> Crossing:
    return max(members, key=lambda c: abs(c.height))
