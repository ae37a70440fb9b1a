"""Hollows: what pits and grooves have in common, a wall that the ball rests on, and a bottom."""

from __future__ import annotations

import numpy as np

from mapping import Feature, FloatArray, Interval
from mapping.geometry.mesh import distances
from mapping.geometry.proxy import Part, Trench
from mapping.geometry.templates import rim_height
from mapping.inference.families import Sizes, SmoothGrooveShape, SmoothPitShape, smooth_section
from mapping.inference.kinds.crests import along_and_aside, rounding_said
from mapping.inference.kinds.kind import Kind, Section, place_sd, preliminary
from mapping.inference.likelihood import Shape

# A ball that sinks to within this share of the depth rests on the bottom: ten times what its trace errs by
REACHED = 1e-5
# Places along a line that stand for all of them, where how far the ball sinks depends on how the base bends there: 8,
# 16 and 128 say 0.4005, 0.4020 and 0.4034 mm of the groove of double_ring
FEW_BENDS = 16
NO_EDGE = "its walls run out without an edge: width at half of the depth"


class Hollow(Kind):
    """Rims: the last two parameters are the log width of the mouth and the log depth; of smooth ones see `section`."""

    def sizes(self, feature: Feature, tip_radius: float) -> Sizes:
        """At least as wide as the ball must find it to sink in so far."""
        height, sd, width = preliminary(feature, tip_radius)
        seen = np.sqrt(height * max(2.0 * tip_radius - height, 0.0))
        half = max(0.5 * width, float(seen))
        return Sizes(height, sd, half, half, place_sd(feature, half))

    def trace(self, feature: Feature, feet: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
        """(N,) heights of the ball that rests on the nearer rim or on the bottom, m; see `Kind.trace`."""
        height = feature.height.median
        if height >= 0.0:
            return np.zeros(len(feet))
        if feature.details.taper is not None:
            return _smooth(feature, distances(feet, feature.axis), tip_radius)
        return rim_height(_inside(feet, feature), tip_radius, -height)

    def part(self, feature: Feature, exaggeration: float = 1.0) -> Part | None:
        """The trench; None of one that is not hollow. Where the bottom was not felt, it is as deep as the ball sank."""
        depth, width = -exaggeration * feature.height.median, exaggeration * feature.width.median
        return Trench(feature.axis, feature.normals, width, depth) if depth > 0.0 and width > 0.0 else None

    def section(self, feature: Feature, shape: Shape, draws: FloatArray) -> Section:
        """Depth and width; where the ball hangs between the rims, the dip bounds the depth from below (censored)."""
        if isinstance(shape, SmoothGrooveShape | SmoothPitShape):
            return _smooth_section(shape, draws)
        width, depth = np.exp(draws[:, -2]), np.exp(draws[:, -1])
        tip = shape.tip_radius  # type: ignore[attr-defined]
        height = _depth(depth, np.minimum(-rim_height(0.5 * width, tip), depth))
        return Section(height, Interval.from_draws(width), rounding_said(shape, draws), _remark(height))


def _inside(feet: FloatArray, feature: Feature) -> FloatArray:
    """(N,) distances from the rim of a mouth, positive within it, m."""
    half, rounding = 0.5 * max(feature.width.median, 1e-12), feature.details.end_rounding
    if rounding is None or len(feature.axis) < 2 or feature.closed:
        return np.asarray(half - distances(feet, feature.axis))
    along, aside = along_and_aside(feet, feature.axis)
    return within_ends(np.minimum(along, feature.length.median - along), half - aside, rounding * half)


def within_ends(along: FloatArray, across: FloatArray, radius: float) -> FloatArray:
    """(N,) distances from a rim whose corners are arcs of a radius, of places so far from its end and from its side."""
    corner = radius - np.hypot(np.maximum(radius - along, 0.0), np.maximum(radius - across, 0.0))
    return np.where((along < radius) & (across < radius), corner, np.minimum(along, across))


def _smooth_section(shape: SmoothGrooveShape | SmoothPitShape, draws: FloatArray) -> Section:
    """Of a hollow without an edge: how wide it is at half of the depth that is stated, where its walls were touched."""
    bottom, half, taper = smooth_section(draws)
    depth = -bottom
    height = _depth(depth, _dips(shape, draws))
    share = np.clip(-0.5 * height.median / depth, 1e-3, 1.0 - 1e-3)
    # u of half the depth times the root of (share^-k - 1) / (2^k - 1), which is log2(1 / share) at k = 0
    level = -np.log(share)
    known = np.abs(taper) > 1e-6
    k = np.where(known, taper, 1.0)
    square = np.where(known, np.expm1(k * level) / np.expm1(k * np.log(2.0)), level / np.log(2.0))
    medians = [float(np.median(each)) for each in (taper, depth, half)]
    details = dict(zip(("taper", "bottom", "scale"), medians, strict=True))
    note = "; ".join(each for each in (NO_EDGE, _remark(height)) if each)
    return Section(height, Interval.from_draws(2.0 * half * np.sqrt(square)), details, note)


def _depth(depths: FloatArray, dips: FloatArray) -> Interval:
    """Of draws of the depth, and of how far the ball then sinks (S,), m: the latter, a bound, where it may hang."""
    censored = bool(np.mean(depths > (1.0 + REACHED) * dips) > 0.05)
    low, median, high = np.quantile(-dips if censored else -depths, [0.05, 0.5, 0.95])
    return Interval(float(median), float(low), float(high), censored)


def _remark(height: Interval) -> str:
    return "the ball does not reach the bottom: at least this deep" if height.censored else ""


def _dips(shape: SmoothGrooveShape | SmoothPitShape, draws: FloatArray) -> FloatArray:
    """(S,) how far the ball sinks into the middle of smooth hollows, of a line in the mean along it, m."""
    from mapping.geometry.templates import smooth_point_heights

    if isinstance(shape, SmoothPitShape):
        bends = shape.spot.bends.mean(keepdims=True)
    else:
        places, bends = shape.chart.s, shape.chart.bend
        if not shape.chart.closed:
            low, high = np.median(draws[:, -5:-3], axis=0)
            bends = np.interp(np.linspace(low, high, FEW_BENDS), places, bends)
    middle, dips = np.zeros((1, 1)), np.zeros(len(draws))
    nowhere, out = np.zeros((len(draws), 2)), np.empty((len(draws), 1))
    some = bends[:: max(1, len(bends) // FEW_BENDS)]
    for bend in some:
        smooth_point_heights(middle, middle, np.full(2, bend), nowhere, *smooth_section(draws), shape.tip_radius, out)
        dips -= out[:, 0] / len(some)
    return dips


def _smooth(feature: Feature, away: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) heights at distances from the axis that a hollow with the feature's taper leaves, m."""
    from mapping.geometry.templates import smooth_point_heights

    known = (-(feature.details.bottom or 0.0), feature.details.scale, feature.details.taper)
    section = [np.array([each], dtype=np.float64) for each in known]
    nowhere, out = np.zeros((len(away), 1)), np.empty((1, len(away)))
    smooth_point_heights(away[:, None], nowhere, np.zeros(2), np.zeros((1, 2)), *section, tip_radius, out)
    return np.asarray(out[0])
