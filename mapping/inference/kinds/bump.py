"""Bump: a round detail that stands on the base, a cap, or with a skirt a bell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mapping import Feature, FloatArray, Interval
from mapping.geometry.proxy import Bell, Part
from mapping.geometry.templates import chain_height
from mapping.inference.families import (
    BellShape,
    BumpShape,
    PosteriorProblem,
    Sizes,
    Spot,
    Surroundings,
    bell_shape,
    width_at_half_height,
)
from mapping.inference.kinds.crests import Crest
from mapping.inference.kinds.kind import Section
from mapping.inference.kinds.points import PointKind, Seen, seen_about
from mapping.inference.kinds.posing import height_prior, place_prior, pose, radius_prior
from mapping.inference.likelihood import Shape, Window


class Bump(Crest, PointKind):
    """Sphere caps, and bells where no cap fits."""

    def trace(self, feature: Feature, feet: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
        """(N,) heights of a cap, or of the bell that the feature's details describe, m; see `Kind.trace`."""
        if feature.details.exponent is None:
            return super().trace(feature, feet, normals, tip_radius)
        return _bell(feature, feet, tip_radius)

    def part(self, feature: Feature, exaggeration: float = 1.0) -> Part | None:
        """The cap, or the bell that the feature's details describe."""
        scale, exponent, height = feature.details.scale, feature.details.exponent, feature.height.median
        if scale is None or exponent is None or not height > 0.0:
            return super().part(feature, exaggeration)
        return Bell(feature.axis[0], feature.normals[0], exaggeration * height, exaggeration * scale, exponent)

    def shape(self, seen: Seen) -> BumpShape:
        return bump_shape(seen.window, seen.spot, seen.sizes, seen.tip_radius, seen.free)

    def other_starts(self, sizes: Sizes) -> tuple[float, ...]:
        return float(np.log(4.0 * sizes.radius)), float(np.log(0.5 * sizes.height))

    def alternatives(self, problem: PosteriorProblem, around: Surroundings) -> Sequence[PosteriorProblem]:
        """A bump with a skirt."""
        seen = seen_about(problem.feature, around, problem.window)
        priors = place_prior(seen.sizes), height_prior(seen.sizes)
        bell = bell_shape(seen.window, seen.spot, seen.sizes, seen.tip_radius, seen.free, *priors)
        return (pose(problem.feature, seen.sizes, bell, seen.window, around, _bell_beginnings(bell.start)),)

    def section(self, feature: Feature, shape: Shape, draws: FloatArray) -> Section:
        """Of a cap, or of a bell: its width at half height, scale and exponent."""
        if not isinstance(shape, BellShape):
            return super().section(feature, shape, draws)
        scale, exponent = np.exp(draws[:, -2]), np.exp(draws[:, -1])
        full = Interval.from_draws(width_at_half_height(scale, exponent))
        bell = {"scale": float(np.median(scale)), "exponent": float(np.median(exponent))}
        note = "its flank runs out in a skirt: width at half height"
        return Section(Interval.from_draws(draws[:, -3]), full, bell, note)

    def heights(self, shape: Any, truth: FloatArray, feet: FloatArray, normals: FloatArray) -> FloatArray:
        place = np.zeros(2)
        place[: shape.free] = truth[: shape.free]
        center = shape.spot.point + place @ shape.spot.axes
        radius = float(np.exp(truth[-1]))
        return chain_height(feet, normals, center + (truth[-2] - radius) * shape.spot.normal, radius, shape.tip_radius)


def bump_shape(window: Window, spot: Spot, sizes: Sizes, tip: float, free: int) -> BumpShape:
    """Bumps about a spot: position within 1.5 half widths, any height up to several times the detected one."""
    place = place_prior(sizes)
    priors = (*(place,) * free, height_prior(sizes), radius_prior(sizes, tip))
    start = np.array([0.0] * free + [sizes.height, np.log(sizes.radius)])
    step = np.array([0.02 * sizes.half_width] * free + [0.02 * sizes.height, 0.1])
    return BumpShape(window, spot, tip, free, priors, start, step)


def _bell(feature: Feature, feet: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) heights that a bump of revolution with the feature's scale and exponent leaves, m."""
    from mapping.geometry.templates import bell_heights

    away = np.linalg.norm(feet - feature.axis[0], axis=1)[:, None]
    height, scale = np.array([feature.height.median]), np.array([feature.details.scale], dtype=np.float64)
    exponent, out = np.array([feature.details.exponent], dtype=np.float64), np.empty((1, len(feet)))
    bell_heights(away, np.zeros_like(away), np.zeros((1, 2)), height, scale, exponent, tip_radius, out)
    return np.asarray(out[0])


def _bell_beginnings(start: FloatArray) -> FloatArray:
    """Starts from slender to wide, with a long skirt and with none."""
    starts = []
    for scale in (-1.5, -0.5, 0.5):
        for exponent in (0.0, 2.0):
            other = start.copy()
            other[-2:] = start[-2] + scale, exponent
            starts.append(other)
    return np.array(starts)


BUMP = Bump(
    name="bump",
    plural="bumps",
    sign=1,
    line=False,
    made_of="convex",
    words={"height": "high"},
    colour=(0.85, 0.37, 0.01, 1.0),
    typical=(0.65e-3, 0.65e-3),  # a ball as thick as the paper's wire
)
