"""Bump: a round detail that stands on the base: a cap, a disc or a cone, or where its flank runs out a bell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapping import Feature, FloatArray
from mapping.geometry.proxy import Bell, Part
from mapping.geometry.templates import chain_height, width_of_cap
from mapping.inference.families import (
    BellShape,
    BumpShape,
    FrustumShape,
    PosteriorProblem,
    Sizes,
    Spot,
    bell_beside,
    flat_topped_widths,
    frustum_beside,
    rounded_frustum_beside,
)
from mapping.inference.kinds.crests import (
    BEGUN_TAPERS,
    FLAT_STARTS,
    ROOF_STARTS,
    SHOULDER_STARTS,
    Crest,
    bell_said,
    flat_topped_reach,
    flat_topped_said,
    is_flat_topped,
)
from mapping.inference.kinds.kind import Section, place_sd
from mapping.inference.kinds.points import PointKind, Seen
from mapping.inference.kinds.posterior_density import height_prior, place_prior, radius_prior
from mapping.inference.likelihood import Shape, Window


class Bump(Crest, PointKind):
    """Sphere caps, flat-topped ones and bells, which compete."""

    def part(self, feature: Feature, exaggeration: float = 1.0) -> Part | None:
        """The cap, or the bell that the feature's details describe."""
        scale, exponent, height = feature.details.scale, feature.details.exponent, feature.height.median
        if scale is None or exponent is None or not height > 0.0:
            return super().part(feature, exaggeration)
        return Bell(feature.axis[0], feature.normals[0], exaggeration * height, exaggeration * scale, exponent)

    def sizes(self, feature: Feature, tip_radius: float) -> Sizes:
        """Of a flat top the trace is disturbed farther out than of a cap as high and wide."""
        sizes = super().sizes(feature, tip_radius)
        if not is_flat_topped(feature):
            return sizes
        half = max(sizes.half_width, flat_topped_reach(feature, tip_radius))
        return replace(sizes, half_width=half, position_sd=place_sd(feature, half))

    def shape(self, seen: Seen) -> BumpShape:
        return bump_shape(seen.window, seen.spot, seen.sizes, seen.tip_radius, seen.free)

    def other_starts(self, sizes: Sizes) -> tuple[float, ...]:
        return float(np.log(4.0 * sizes.radius)), float(np.log(0.5 * sizes.height))

    def rivals(self, problem: PosteriorProblem, optimum: FloatArray) -> Sequence[PosteriorProblem]:
        """Bumps with a flat top, cones, and such whose flank runs out, where the cap lies."""
        cap: Any = problem.target.shape
        bell = bell_beside(cap, problem.sizes)
        begun = [
            [*optimum[:-1], bell.start[-2] + wider, taper] for wider in (-1.5, -0.5, 0.5) for taper in BEGUN_TAPERS
        ]
        posed = [replace(problem, target=replace(problem.target, shape=bell), beginnings=np.array(begun))]
        for shape, parts in (
            (frustum_beside(cap, problem.sizes, roof=False), FLAT_STARTS),
            (frustum_beside(cap, problem.sizes, roof=True), ROOF_STARTS),
            (rounded_frustum_beside(cap, problem.sizes), SHOULDER_STARTS),
        ):
            flat = np.log(problem.sizes.half_width * np.array(parts))
            beginnings = np.column_stack([np.tile(optimum[:-1], (len(parts), 1)), flat])
            posed.append(replace(problem, target=replace(problem.target, shape=shape), beginnings=beginnings))
        return posed

    def draws_of_height(self, shape: Shape, draws: FloatArray) -> FloatArray:
        if isinstance(shape, FrustumShape):
            return shape.parts(draws)[0]
        return draws[:, -3] if isinstance(shape, BellShape) else draws[:, -2]

    def widths_felt(self, shape: Shape, draws: FloatArray, *, half_way: bool = False) -> tuple[FloatArray, FloatArray]:
        """Each family's own."""
        if isinstance(shape, FrustumShape):
            return flat_topped_widths(shape, draws, half_way=half_way)
        if isinstance(shape, BellShape):
            width = 2.0 * np.exp(draws[:, -2])
        else:
            width = width_of_cap((0.5 if half_way else 1.0) * draws[:, -2], np.exp(draws[:, -1]))
        return width, width

    def section(self, feature: Feature, shape: Shape, draws: FloatArray) -> Section:
        """Of a cap, or a flat-topped bump, or of a bell: its width at half height, scale and exponent."""
        if isinstance(shape, FrustumShape):
            return flat_topped_said(shape, draws)
        if not isinstance(shape, BellShape):
            return super().section(feature, shape, draws)
        return bell_said(draws)

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
