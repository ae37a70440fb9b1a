"""Merging: what a later log found is joined with what a model knows already."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import BoolArray, Feature, FloatArray, Interval, Support
from mapping.geometry.mesh import arclengths, nearest_on, resample
from mapping.model.object_model import ObjectModel

# Two axes further apart than this many standard deviations of their distance belong to two features.
SAME = 4.0
# Share of the shorter axis that must lie along the longer one.
LEAST_AXIS_OVERLAP = 0.3
# 1.6449 standard deviations lie between the median and the 95 % quantile of a Gaussian.
NORMAL_QUANTILE_95 = 1.6448536
AXIS_GAP_POINTS = 33


@dataclass(frozen=True)
class Association:
    """Which known feature a new one belongs to.

    Args:
        new: number of the new feature.
        known: number of the known one, or None: it is new to the model.
        distance: of the two axes, in standard deviations; inf where there is none of its family.
    """

    new: int
    known: int | None
    distance: float


def associate(known: Sequence[Feature], new: Sequence[Feature], pose_sd: float = 0.0) -> tuple[Association, ...]:
    """Pair new features with known ones of the same kind, the closest pairs first, each at most once.

    Two are the same if their axes are as close as their posteriors allow, or so close that the bodies would share
    half of the narrower one: two bodies cannot, so one of the posteriors is then too sure of its place.

    Args:
        known: features of the model.
        new: features of the later log, in the same frame.
        pose_sd: standard deviation of the pose between the two logs, m.
    """
    pairs = sorted(
        (axis_distance(a, b, pose_sd), i, j) for i, a in enumerate(new) for j, b in enumerate(known) if a.kind == b.kind
    )
    taken: dict[int, Association] = {}
    used: set[int] = set()
    for distance, i, j in pairs:
        near = distance <= SAME or _share_a_body(new[i], known[j])
        if near and np.isfinite(distance) and i not in taken and j not in used:
            taken[i] = Association(i, j, distance)
            used.add(j)
    nearest = {i: min((d for d, k, _ in pairs if k == i), default=float("inf")) for i in range(len(new))}
    return tuple(taken.get(i, Association(i, None, nearest[i])) for i in range(len(new)))


def axis_distance(a: Feature, b: Feature, pose_sd: float = 0.0) -> float:
    """Distance of two axes in standard deviations: rms over the stretch that they share; inf if they share none."""
    sd = float(np.sqrt(a.position_sd**2 + b.position_sd**2 + pose_sd**2))
    return axis_gap(a, b) / max(sd, np.finfo(float).tiny)


def axis_gap(a: Feature, b: Feature) -> float:
    """Distance of two axes, m: rms over the stretch that they share; inf if they share none."""
    short, long = sorted((a.axis, b.axis), key=lambda axis: float(arclengths(axis)[-1]))
    points = resample(short, AXIS_GAP_POINTS) if len(short) > 1 else short
    gaps, inside = _gaps(points, long)
    if len(long) > 1 and len(short) > 1 and inside.mean() < LEAST_AXIS_OVERLAP:
        return float("inf")
    counted = gaps[inside] if inside.any() else gaps
    return float(np.sqrt(np.mean(counted**2)))


def _share_a_body(a: Feature, b: Feature) -> bool:
    return axis_gap(a, b) < 0.5 * min(a.width.median, b.width.median)


def _gaps(points: FloatArray, axis: FloatArray) -> tuple[FloatArray, BoolArray]:
    """(N,) distances of points from a polyline, and whether they lie beside it, not beyond its ends."""
    if len(axis) == 1:
        return np.linalg.norm(points - axis[0], axis=1), np.ones(len(points), dtype=bool)
    legs = np.diff(axis, axis=0)
    square = np.maximum(np.einsum("ij,ij->i", legs, legs), np.finfo(float).tiny)
    share = np.einsum("nki,ki->nk", points[:, None] - axis[:-1], legs) / square
    foot = axis[:-1] + np.clip(share, 0.0, 1.0)[..., None] * legs
    gap = np.linalg.norm(points[:, None] - foot, axis=2)
    leg = gap.argmin(axis=1)
    row = np.arange(len(points))
    before = (leg == 0) & (share[row, leg] < 0.0)
    beyond = (leg == len(legs) - 1) & (share[row, leg] > 1.0)
    closed = bool(np.array_equal(axis[0], axis[-1]))
    return gap[row, leg], np.ones(len(points), dtype=bool) if closed else ~(before | beyond)


def merge_features(known: Feature, new: Feature, source: str) -> Feature:
    """One feature from two independent measurements: precisions add, and the history says what each log said.

    Draws, extent and the course of the axis are those of the measurement that knows its place (or, if one saw an end
    that the other did not, its length) better; the axis moves sideways towards the other by the other's weight.
    """
    better, other = sorted((known, new), key=lambda each: (each.length.censored, each.position_sd))
    precision = 1.0 / np.maximum([better.position_sd, other.position_sd], np.finfo(float).tiny) ** 2
    axis = joined_axis(better.axis, other.axis, float(precision[1] / precision.sum()))
    evidence = Support(
        float(np.hypot(known.evidence.snr, new.evidence.snr)),
        known.evidence.crossings + new.evidence.crossings,
        tuple(sorted({*known.evidence.algorithms, *new.evidence.algorithms})),
        better.evidence.log_odds,
    )
    # Measurements further apart than their sds allow: the sd of their mean is scaled to match (Particle Data Group).
    apart = axis_distance(known, new)
    scale = apart if SAME < apart < np.inf else 1.0
    doubt = (f"two logs place it {apart:.0f} standard deviations apart: its place is less sure",) if scale > 1.0 else ()
    record = {
        "source": source,
        "height": new.height.median,
        "length": new.length.median,
        "position_sd": new.position_sd,
    }
    return replace(
        better,
        id=known.id,
        axis=axis,
        height=merge_intervals(known.height, new.height),
        width=merge_intervals(known.width, new.width),
        length=merge_intervals(known.length, new.length),
        evidence=evidence,
        curvature_feature=known.curvature_feature or new.curvature_feature,
        position_sd=scale * float(1.0 / np.sqrt(precision.sum())),
        notes=tuple(dict.fromkeys((*better.notes, *(other.notes if better.length.censored else ()), *doubt))),
        extra={**other.extra, **better.extra, "history": [*known.extra.get("history", []), record]},
        details=better.details.or_of(other.details),
    )


def joined_axis(axis: FloatArray, other: FloatArray, share: float) -> FloatArray:
    """An axis (K, 3) moved sideways by a share of its distance from another; where they run apart, as next to it."""
    inside = _gaps(axis, other)[1] if len(other) > 1 else np.ones(len(axis), dtype=bool)
    if not inside.any():
        return axis
    offset = (nearest_on(axis, other)[0] if len(other) > 1 else other) - axis
    here, known = np.arange(len(axis)), np.flatnonzero(inside)
    smooth = np.column_stack([np.interp(here, known, offset[known, i]) for i in range(3)])
    moved = axis + share * smooth
    if len(axis) > 2 and np.array_equal(axis[0], axis[-1]):
        moved[-1] = moved[0]
    return np.asarray(moved)


def merge_intervals(a: Interval, b: Interval) -> Interval:
    """The interval of two independent measurements; of two lower bounds the higher; a bound yields to a value.

    Two that bound from both sides leave what is within both, or the narrower of them where nothing is.
    """
    if a.bounded and b.bounded and max(a.low, b.low) < min(a.high, b.high):
        low, high = max(a.low, b.low), min(a.high, b.high)
        return replace(a, median=float(np.clip(a.median, low, high)), low=low, high=high)
    if a.bounded and b.bounded:
        return min(a, b, key=lambda each: each.high - each.low)
    if a.censored and b.censored:
        return a if a.low >= b.low else b
    if a.censored or b.censored:
        return b if a.censored else a
    sds = np.array([(each.high - each.low) / (2.0 * NORMAL_QUANTILE_95) for each in (a, b)])
    if sds.min() <= 0.0:
        return a if sds[0] <= sds[1] else b
    weight = 1.0 / sds**2
    return Interval.normal(
        float((weight @ [a.median, b.median]) / weight.sum()),
        float(1.0 / np.sqrt(weight.sum())),
    )


def merge_model(model: ObjectModel, new: Sequence[Feature], source: str, pose_sd: float = 0.0) -> ObjectModel:
    """The model with later features joined in: known ones are updated, others added, none is removed.

    Args:
        model: what is known.
        new: features found in a later log on the model's base, in its frame.
        source: name of that log, for the history.
        pose_sd: standard deviation of the pose between the logs, m.
    """
    features = list(model.features)
    added: list[Feature] = []
    for pair in associate(model.features, new, pose_sd):
        fresh = new[pair.new]
        if pair.known is None:
            added.append(replace(fresh, extra={**fresh.extra, "history": [{"source": source, "first seen": True}]}))
        else:
            features[pair.known] = merge_features(features[pair.known], fresh, source)
    history = [*model.provenance.get("merged", []), source]
    about = {"left_out": model.left_out, "timings": model.timings, "reach": model.reach, "sigma": model.sigma}
    about |= {"inspected": model.inspected, "below": model.below, "above": model.above}
    provenance = {**model.provenance, "merged": history}
    return ObjectModel.attach(model.base, [*features, *added], provenance=provenance, dropped=model.dropped, **about)
