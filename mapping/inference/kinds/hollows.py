"""Hollows: what pits and grooves have in common, an upright wall that the ball rests on, and a flat bottom."""

from __future__ import annotations

import numpy as np

from mapping import Feature, FloatArray, Interval
from mapping.geometry.proxy import Part, Trench
from mapping.geometry.templates import rim_height
from mapping.inference.families import Sizes
from mapping.inference.kinds.crests import axis_distance
from mapping.inference.kinds.kind import Kind, Section, place_sd, preliminary
from mapping.inference.likelihood import Shape


class Hollow(Kind):
    """Rims: the last two parameters are the log width of the mouth and the log depth."""

    def sizes(self, feature: Feature, tip_radius: float) -> Sizes:
        """At least as wide as the ball must find it to sink in so far."""
        height, sd, width = preliminary(feature, tip_radius)
        seen = np.sqrt(height * max(2.0 * tip_radius - height, 0.0))
        half = max(0.5 * width, float(seen))
        return Sizes(height, sd, half, half, place_sd(feature, half))

    def trace(self, feature: Feature, feet: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
        """(N,) heights of the ball that rests on the nearer rim or on the bottom, m; see `Kind.trace`."""
        height, width = feature.height.median, max(feature.width.median, 1e-12)
        if height >= 0.0:
            return np.zeros(len(feet))
        return rim_height(0.5 * width - axis_distance(feet, feature.axis), tip_radius, -height)

    def part(self, feature: Feature, exaggeration: float = 1.0) -> Part | None:
        """The trench; None of one that is not hollow. Where the bottom was not felt, it is as deep as the ball sank."""
        depth, width = -exaggeration * feature.height.median, exaggeration * feature.width.median
        return Trench(feature.axis, feature.normals, width, depth) if depth > 0.0 and width > 0.0 else None

    def section(self, feature: Feature, shape: Shape, draws: FloatArray) -> Section:
        """Depth and width; where the ball hangs between the rims, the dip bounds the depth from below (censored)."""
        width, depth = np.exp(draws[:, -2]), np.exp(draws[:, -1])
        tip = shape.tip_radius  # type: ignore[attr-defined]
        unhindered = -rim_height(0.5 * width, tip)
        dips = np.minimum(unhindered, depth)
        censored = bool(np.mean(depth > unhindered) > 0.05)
        values = -dips if censored else -depth
        low, median, high = np.quantile(values, [0.05, 0.5, 0.95])
        note = "the ball does not reach the bottom: at least this deep" if censored else ""
        height = Interval(float(median), float(low), float(high), censored)
        return Section(height, Interval.from_draws(width), {}, note)
