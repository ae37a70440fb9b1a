"""Faint feature: ridges and grooves that only many sweeps together show, as features."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapping import Feature, Interval, Support, Trace
from mapping.assembly.faint_lines import FEWEST_AGREEING_SWEEPS, SECTIONS, FaintLine, faint_lines
from mapping.assembly.linking import Inspection, Inspections, line_end
from mapping.assembly.points import body_width
from mapping.base import Base
from mapping.detection import Detections
from mapping.geometry.mesh import arclengths, distances
from mapping.inference.configuration import in_words
from mapping.inference.kinds import kind_made_of

# Places to a half-width of the narrowest section looked for.
PLACES_PER_HALF_WIDTH = 2.5
# A feature of no more crossings, and no clearer than so many thresholds, may be a part of a faint line; so may a spot,
# or a line of some crossings, that is lower than a single sweep detects with certainty.
FEW_CROSSINGS, CLEAR_THRESHOLDS, SOME = 2, 2.0, 6
# Standard deviations above which a single place stands out.
PLAIN_PLACE_SDS = 5.0
# Samples to a place, below which there is no noise to be averaged away; and places that are looked through in seconds.
LEAST_SAMPLES, MOST_PLACES = 4.0, 150_000


def with_faint_lines(
    features: Sequence[Feature],
    detections: Detections,
    trace: Trace,
    base: Base,
    false_alarms_per_metre: float,
    inspections: Inspections | None = None,
) -> list[Feature]:
    """The features, and the lines that no single sweep showed; what is a weak part of such a line becomes the line.

    Nothing is sought where `why_none_sought` says so.
    """
    features = list(features)
    if why_none_sought(detections, trace, base):
        return features
    half_width = _least_half_width(detections, trace.tip_radius)
    spacing = faint_spacing(detections, trace.tip_radius)
    inspection = (inspections or Inspections.of(trace, base, detections.noise, [spacing])).at(spacing)
    weak = [f for f in features if _is_weak(f, detections, trace.tip_radius)]
    # what one place alone shows is not faint
    masked = np.abs(inspection.height) > PLAIN_PLACE_SDS * inspection.sd
    for feature in features:
        if feature not in weak:
            reach = _reach(feature, trace.tip_radius)
            near = inspection.near(feature.axis, reach)
            masked[near] |= distances(inspection.points[near], feature.axis) < reach
    alarms = false_alarms_per_metre * detections.inspected_length
    inflation = _inflation(inspection, detections, len(trace), half_width)
    lines = faint_lines(inspection, inspection.normals, masked, half_width, inflation, alarms, detections.doubt)
    for line in lines:
        ridge = _feature(line, inspection, base, detections, trace.tip_radius)
        features = [f for f in features if f not in weak or distances(f.axis, ridge.axis).max() > 2 * line.half_width]
        features.append(ridge)
    return features


def why_none_sought(detections: Detections, trace: Trace, base: Base) -> str:
    """Why no lines fainter than single sweeps show can be sought, "" if they can."""
    if base.kind != "mesh":
        return "over a base that was fitted its own errors run along lines too"
    if len(np.unique(trace.sweep)) < FEWEST_AGREEING_SWEEPS:
        return f"there are fewer than {FEWEST_AGREEING_SWEEPS} sweeps"
    if not np.isfinite(detections.detection_limit):
        return "the sweeps are too short"
    places = detections.inspected_length / faint_spacing(detections, trace.tip_radius)
    if places > len(trace) / LEAST_SAMPLES:
        return "there is hardly any noise to average away"
    return "there is more path than can be looked through in seconds" if places > MOST_PLACES else ""


def faint_spacing(detections: Detections, tip_radius: float) -> float:
    """Distance between the places of a sweep whose heights are looked at for faint lines, m."""
    return min(SECTIONS) * _least_half_width(detections, tip_radius) / PLACES_PER_HALF_WIDTH


def _least_half_width(detections: Detections, tip_radius: float) -> float:
    """Half-width of the smallest crest that a single sweep detects, m."""
    return float(np.sqrt(2 * tip_radius * detections.detection_limit))


def _reach(feature: Feature, tip_radius: float) -> float:
    """How far from its axis a feature explains what was felt, m."""
    return float(1.3 * np.sqrt(2 * tip_radius * abs(feature.height.median)) + 0.5 * feature.width.high)


def _is_weak(feature: Feature, detections: Detections, tip_radius: float) -> bool:
    # the sweeps that passed over it, which an account of a neighbourhood counts, need not have shown it one by one
    shown = np.array([c.point for c in detections.crossings]).reshape(-1, 3)
    shown_by = int((distances(shown, feature.axis) < _reach(feature, tip_radius)).sum())
    crossings = min(feature.evidence.crossings, shown_by)
    few = crossings <= FEW_CROSSINGS and feature.evidence.snr < CLEAR_THRESHOLDS * detections.threshold
    # sweeps that leave a groove by its end feel a dip there, each for itself
    alone = len(feature.axis) == 1 or crossings <= SOME
    # a piece of a line, which by itself may be nothing
    doubtful = any(words == in_words(()) for words, _ in feature.details.account or ())
    return few or doubtful or (alone and abs(feature.height.median) < detections.detection_limit)


def _inflation(inspection: Inspection, detections: Detections, samples: int, half_width: float) -> float:
    """Standard deviation of a mean over one crossing, against that of independent places."""
    count = max(1, int(np.ceil(2 * half_width / inspection.spacing)))
    per_place = samples / max(len(inspection.points), 1)
    covariance = detections.noise.block_covariances(count, inspection.spacing, per_place)
    share = 1 - np.arange(1, count) / count
    return float(np.sqrt(1 + 2 * share @ covariance[1:] / covariance[0]))


def _feature(line: FaintLine, inspection: Inspection, base: Base, detections: Detections, tip_radius: float) -> Feature:
    axis, ends = line.axis, []
    for _ in range(2):
        end = line_end(axis, line.height, line.half_width, inspection, 8 * line.half_width)
        axis = np.stack([end.point, axis[0]])
        ends.append(end)
    length = float(arclengths(axis)[-1])
    shorter, longer = (float(np.hypot(*values)) for values in zip(*((e.low, e.high) for e in ends), strict=True))
    feet = base.foot(axis + tip_radius * line.normal, tip_radius)
    seen = all(end.seen for end in ends)
    return Feature(
        kind=kind_made_of("convex" if line.height > 0 else "concave", line=True).name,
        axis=feet.points,
        normals=feet.normals,
        height=Interval.normal(line.height, line.height_sd),
        width=body_width(line.height, line.half_width, tip_radius),
        length=Interval(length, max(length - shorter, 0.0), length + longer, not seen),
        evidence=Support(line.snr, line.sweeps, (detections.algorithm,)),
        curvature_feature=bool(abs(2 * line.height / line.half_width**2) > 1 / (2 * tip_radius)),
        position_sd=0.3 * line.half_width,
        notes=("seen by no single sweep, but by all that crossed it together",),
        faint=True,
    )
