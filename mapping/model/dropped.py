"""What was detected and is no feature of the model: where, how plainly it was seen, and why it was dropped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapping import BoolArray, Dropped, Feature, FloatArray, length_text
from mapping.detection import Crossing
from mapping.geometry.mesh import distances
from mapping.inference.kinds import feature_trace, kind_of, sizes_of

NEITHER = "what was felt around it makes neither line nor spot of it"
# What is said where no sweep passed the extreme
ONE_FLANK = "sweeps begin or end on it, and what it is lies beyond what was felt"
# Share of a height that is most of it
MOST = 0.5


def dropped_features(features: Sequence[Feature]) -> tuple[Dropped, ...]:
    """Features that all sweeps together hardly speak for."""
    return tuple(
        Dropped(
            feature.kind,
            feature.axis[0],
            feature.height.median,
            feature.evidence.snr,
            feature.evidence.crossings,
            feature.evidence.log_odds,
            f"all sweeps together hardly speak for it (log odds {feature.evidence.log_odds:.1f})",
        )
        for feature in features
        if feature.evidence.log_odds is not None
    )


def _gap_to_crest(centers: FloatArray, feature: Feature, tip_radius: float) -> FloatArray:
    """(N,) distances between balls at centres (N, 3) and the feature's crest, round as its cap is, m."""
    radius = feature.details.radius or 0.0
    crest = feature.axis + (feature.height.median - radius) * feature.normals
    return distances(centers, crest) - tip_radius - radius


def dropped_crossings(
    crossings: Sequence[Crossing], features: Sequence[Feature], tip_radius: float, cut: Sequence[Crossing] = ()
) -> tuple[Dropped, ...]:
    """Crossings that no feature accounts for: none lies within their disturbance, or within its own, or leaves most of
    what was felt there, as the flank of a bump that runs out does to the rows that pass beside it; nor did the ball
    stand on one, whose foot was on a wall beside it: in the corner before a ridge's end it touches all three. Of those
    that were felt together one is told, the plainest.

    Args:
        crossings: all that was detected.
        features: all that was made of them, likely or not.
        tip_radius: radius of the fingertip, m.
        cut: those whose sweeps began or ended before they had passed it.
    """
    if not crossings:
        return ()
    points, normals = (np.array([getattr(crossing, name) for crossing in crossings]) for name in ("point", "normal"))
    height = np.array([crossing.height for crossing in crossings])
    centers = points + (tip_radius + height)[:, None] * normals
    nearest, away = np.full(len(points), -1), np.full(len(points), np.inf)
    accounted = np.zeros(len(points), dtype=bool)
    own = np.array([crossing.half_width for crossing in crossings])
    begin, end = (np.array([getattr(crossing, name) for crossing in crossings]) for name in ("start", "stop"))
    steps = np.array([crossing.is_step for crossing in crossings])
    sweeps = np.array([crossing.sweep for crossing in crossings])
    for number, feature in enumerate(features):
        apart = distances(points, feature.axis)
        if feature.details.free_section:
            parts = apart <= 2.0 * own + 0.5 * feature.width.high
            # a plateau that was fitted too wide has its edges beside the section, and the section within it
            for k in np.flatnonzero(parts):
                parts |= (sweeps == sweeps[k]) & (begin < end[k]) & (end > begin[k])
            accounted |= parts
        else:
            accounted |= apart <= np.maximum(own, sizes_of(feature, tip_radius).half_width)
            if not kind_of(feature).sided:  # what a step leaves goes on to wherever its level does
                beside = np.flatnonzero(~accounted)
                left = feature_trace(feature, points[beside], normals[beside], tip_radius)
                # of a step the sign says which side it was fitted from, not which way the detail goes
                sign = np.where(steps[beside], np.sign(left), np.sign(height[beside]))
                accounted[beside] = left * sign > MOST * np.abs(height[beside])
        if feature.height.median > 0.0 and not kind_of(feature).sided:
            # a ball rests on what it is nearest to: the base is so far away as it stands over it
            accounted |= np.abs(_gap_to_crest(centers, feature, tip_radius)) < (1.0 - MOST) * height
        nearest, away = np.where(apart < away, number, nearest), np.minimum(apart, away)
    groups = _felt_together(crossings, ~accounted)
    plainest = [max(group, key=lambda k: crossings[k].snr) for group in groups]
    return tuple(
        Dropped(
            crossings[i].kind,
            crossings[i].point,
            crossings[i].height,
            float(np.sqrt(sum(crossings[k].snr ** 2 for k in group))),
            len(group),
            None,
            (ONE_FLANK if any(crossings[i] is each for each in cut) else NEITHER)
            + (
                f"; the nearest, a {features[nearest[i]].kind}, is {length_text(away[i], 2)} away"
                if nearest[i] >= 0
                else ""
            ),
        )
        for i, group in zip(plainest, groups, strict=True)
    )


def _felt_together(crossings: Sequence[Crossing], lone: BoolArray) -> list[list[int]]:
    """Numbers of lone crossings (n,) of one kind whose disturbances touch, group by group: noise makes one crossing
    clear of it where its law is heavy, but not several beside each other in different sweeps."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    left = [int(k) for k in np.flatnonzero(lone)]
    if not left:
        return []
    points, reach = (np.array([getattr(crossings[k], name) for k in left]) for name in ("point", "half_width"))
    sweep, kind = (np.array([getattr(crossings[k], name) for k in left]) for name in ("sweep", "kind"))
    one, other = cKDTree(points).query_pairs(2.0 * float(reach.max()), output_type="ndarray").T
    touch = np.linalg.norm(points[one] - points[other], axis=1) < reach[one] + reach[other]
    touch &= (kind[one] == kind[other]) & (sweep[one] != sweep[other])
    links = one[touch], other[touch]
    count, group = connected_components(coo_array((np.ones(len(links[0])), links), shape=(len(left), len(left))))
    groups: list[list[int]] = [[] for _ in range(count)]
    for k, number in zip(left, group, strict=True):
        groups[number].append(k)
    return groups
