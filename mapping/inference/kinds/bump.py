"""Bump: a round detail that stands on the base, a cap, or where its flank runs out a bell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapping import Feature, FloatArray, Interval
from mapping.geometry.proxy import Bell, Part
from mapping.geometry.templates import chain_height, width_of_cap
from mapping.inference.families import (
    BellShape,
    BumpShape,
    PosteriorProblem,
    Sizes,
    Spot,
    bell_beside,
    bell_section,
    width_at_half_height,
)
from mapping.inference.kinds.crests import Crest
from mapping.inference.kinds.kind import Section
from mapping.inference.kinds.points import PointKind, Seen
from mapping.inference.kinds.posterior_density import height_prior, place_prior, radius_prior
from mapping.inference.likelihood import Shape, Window

# Tapers that a bell's optimum is searched from: with an edge, nearly a Gaussian, and with a long skirt
BEGUN_TAPERS = (-0.4, 0.1, 1.0)
RUNS_OUT = "its flank runs out into the base: width at half height"


class Bump(Crest, PointKind):
    """Sphere caps and bells, which compete."""

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

    def rivals(self, problem: PosteriorProblem, optimum: FloatArray) -> Sequence[PosteriorProblem]:
        """Bumps whose flank runs out, where the cap lies."""
        cap: Any = problem.target.shape
        bell = bell_beside(cap, problem.sizes)
        begun = [
            [*optimum[:-1], bell.start[-2] + wider, taper] for wider in (-1.5, -0.5, 0.5) for taper in BEGUN_TAPERS
        ]
        return (replace(problem, target=replace(problem.target, shape=bell), beginnings=np.array(begun)),)

    def draws_of_height(self, shape: Shape, draws: FloatArray) -> FloatArray:
        return draws[:, -3] if isinstance(shape, BellShape) else draws[:, -2]

    def widths_felt(self, shape: Shape, draws: FloatArray) -> tuple[FloatArray, FloatArray]:
        """At half height, where caps and bells are alike: each family's own."""
        if isinstance(shape, BellShape):
            width = 2.0 * np.exp(draws[:, -2])
        else:
            width = width_of_cap(0.5 * draws[:, -2], np.exp(draws[:, -1]))
        return width, width

    def section(self, feature: Feature, shape: Shape, draws: FloatArray) -> Section:
        """Of a cap, or of a bell: its width at half height, scale and exponent."""
        if not isinstance(shape, BellShape):
            return super().section(feature, shape, draws)
        width = Interval.from_draws(2.0 * np.exp(draws[:, -2]))
        scale, exponent = bell_section(float(np.exp(np.median(draws[:, -2]))), float(np.median(draws[:, -1])))
        bell = {"scale": float(scale), "exponent": float(exponent)}
        return Section(Interval.from_draws(draws[:, -3]), width, bell, RUNS_OUT)

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
    from mapping.geometry.templates import smooth_point_heights

    details, away = feature.details, np.linalg.norm(feet - feature.axis[0], axis=1)[:, None]
    scale, exponent = float(details.scale or 0.0), float(details.exponent or 0.0)
    known = feature.height.median, 0.5 * float(width_at_half_height(scale, exponent)), 1.0 / exponent
    section, out = [np.array([each]) for each in known], np.empty((1, len(feet)))
    smooth_point_heights(away, np.zeros_like(away), np.zeros(2), np.zeros((1, 2)), *section, tip_radius, out)
    return np.asarray(out[0])


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
