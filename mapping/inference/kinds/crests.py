"""Crests: what bumps and ridges have in common, a section that stands on the base, round or flat, or runs out."""

from __future__ import annotations

from typing import Any

import numpy as np

from mapping import Feature, FloatArray, Interval
from mapping.geometry.mesh import distances, nearest_on
from mapping.geometry.proxy import Bar, Chain, Part
from mapping.geometry.templates import contact_half_width, radius_of_cap, width_of_cap
from mapping.inference.families import (
    BumpShape,
    RidgeShape,
    RoundedFrustumShape,
    ShoulderedShape,
    bell_section,
    rounding_of,
    shouldered_widths,
    touched_widths,
    width_at_half_height,
)
from mapping.inference.kinds.kind import Kind, Section
from mapping.inference.likelihood import Shape

# A crest disturbs the trace up to its half-width over a flat base, and hardly further over a hollow one
CREST_TRACE_REACH = 1.5
# Tapers that a bell's optimum is searched from: with an edge, nearly a Gaussian, and with a long skirt
BEGUN_TAPERS = (-0.4, 0.1, 1.0)
# Widths of a flat top and runs of a flank, in half-widths of the disturbance, from which their optimum is searched:
# upright and gentle flanks, tops that are hardly felt and such as fill the disturbance
FLAT_STARTS = ((0.3, 0.02), (1.0, 0.02), (0.1, 0.6))
# Run of an upright flank: twice the least that is asked for (a hundredth), lest a search begin at the prior's border
UPRIGHT_RUN = 0.02
# The same of sections without a top (a steep and a gentle flank), and widths of the top and radii of round edges
ROOF_STARTS = ((0.02,), (0.6,))
SHOULDER_STARTS = ((0.3, 0.05), (1.0, 0.05))
RUNS_OUT = "its flank runs out into the base: width at half height"


class Crest(Kind):
    """Capsules: the last two parameters are the height and the log radius of the section."""

    def trace(self, feature: Feature, feet: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
        """(N,) heights of a chain of capsules, or of the section that its details describe, m; see `Kind.trace`."""
        height = feature.height.median
        if height <= 0.0:
            return np.zeros(len(feet))
        if feature.details.exponent is not None:
            return _bell(feature, feet, tip_radius)
        if is_flat_topped(feature):
            return _flat_topped(feature, feet, tip_radius)
        radius = crest_radius(feature)
        # a low and wide one is a part of a large ball, which on a bent base comes out again elsewhere
        reach, axis = CREST_TRACE_REACH * contact_half_width(height, radius, tip_radius), feature.axis
        # most features lie far away, which the box about them tells
        near = ((feet > axis.min(axis=0) - reach) & (feet < axis.max(axis=0) + reach)).all(axis=1)
        near[near] = distances(feet[near], axis) < reach
        crest, over = feature.axis + (height - radius) * feature.normals, np.zeros(len(feet))
        over[near] = np.minimum(_chain(feet[near], normals[near], crest, radius, tip_radius), height)
        return over

    def part(self, feature: Feature, exaggeration: float = 1.0) -> Part | None:
        """The chain of capsules, or the bar that its details describe; None of one that does not stand out."""
        height = exaggeration * feature.height.median
        if not height > 0.0:
            return None
        if is_flat_topped(feature):
            sizes = (exaggeration * (each or 0.0) for each in _flat_parts(feature))
            return Bar(feature.axis, feature.normals, height, *sizes)
        return Chain(feature.axis, feature.normals, height, exaggeration * crest_radius(feature))

    def section(self, feature: Feature, shape: Shape, draws: FloatArray) -> Section:
        """Height and width of a round section, and its radius."""
        radii = np.exp(draws[:, -1])
        cap = Interval.from_draws(width_of_cap(draws[:, -2], radii))
        known = {"radius": float(np.median(radii)), "top": None, "run": None, "shoulder": None}
        return Section(Interval.from_draws(draws[:, -2]), cap, known)

    def has_plain_member(self, shape: Any) -> bool:
        return isinstance(shape, RidgeShape | BumpShape)

    def plain_odds(self, shape: Any, draws: FloatArray) -> float:
        """Of a wire or a ball that lies on the base: its radius is half its height.

        By the ratio of the densities of the radius there, after the data and before (Savage's ratio; Dickey, Annals of
        Mathematical Statistics 42, 1971), the former from the draws by Gaussian kernels of Silverman's width.
        """
        if not self.has_plain_member(shape):
            return 0.0
        lying = np.log(0.5 * draws[:, -2])
        off = draws[:, -1] - lying
        width = 1.06 * max(float(off.std()), 1e-9) * len(off) ** -0.2
        after = float(np.exp(-0.5 * (off / width) ** 2).mean()) / (width * np.sqrt(2.0 * np.pi))
        before = float(np.exp(shape.priors[-1].log_density(np.median(lying))))
        return float(after / before)


def bell_said(draws: FloatArray) -> Section:
    """What draws (S, P) that end in height, log half width and taper say of a bell: how wide it is at half height."""
    width = Interval.from_draws(2.0 * np.exp(draws[:, -2]))
    scale, exponent = bell_section(float(np.exp(np.median(draws[:, -2]))), float(np.median(draws[:, -1])))
    bell = {"scale": float(scale), "exponent": float(exponent), "radius": None}
    return Section(Interval.from_draws(draws[:, -3]), width, bell, RUNS_OUT)


def flat_topped_said(shape: Any, draws: FloatArray) -> Section:
    """What draws (S, P) say of a section with a flat top or straight flanks: its width is that of its foot."""
    height, top, run = shape.parts(draws)
    rounded = isinstance(shape, ShoulderedShape | RoundedFrustumShape)
    parts = {"top": float(np.median(top)), "shoulder" if rounded else "run": float(np.median(run)), "radius": None}
    foot = top + (width_of_cap(height, run) if rounded else 2.0 * run)
    return Section(Interval.from_draws(height), Interval.from_draws(foot), parts | rounding_said(shape, draws))


def rounding_said(shape: Shape, draws: FloatArray) -> dict[str, float | None]:
    """What draws (S, P) say of the ends of a line with a flat top or bottom; nothing of others."""
    if "end rounding" not in shape.names:
        return {}
    return {"end_rounding": float(np.median(rounding_of(draws[:, shape.names.index("end rounding")])))}


def is_flat_topped(feature: Feature) -> bool:
    """True of a section with straight flanks, with a flat top or none, or of a flat top with round edges."""
    _, run, shoulder = _flat_parts(feature)
    return (
        feature.details.radius is None and feature.details.top is not None and (run is not None or shoulder is not None)
    )


def _flat_parts(feature: Feature) -> tuple[float | None, float | None, float | None]:
    """Width of the top, run of each flank, and radius of the edges, m."""
    return feature.details.top, feature.details.run, feature.details.shoulder


def flat_topped_reach(feature: Feature, tip_radius: float) -> float:
    """Half of the width over which a flat-topped section disturbs the trace of a ball, m."""
    top, run, shoulder = (np.array([each or 0.0]) for each in _flat_parts(feature))
    height = np.array([abs(feature.height.median)])
    if shoulder[0] > 0.0:
        return 0.5 * float(shouldered_widths(height, top, shoulder, tip_radius)[1][0])
    return 0.5 * float(touched_widths(height, top, run, tip_radius)[1][0])


def crest_radius(feature: Feature) -> float:
    """Radius of a crest's section, m: as fitted, or of the cap of its height and width."""
    known = feature.details.radius
    width = max(feature.width.median, 1e-12)
    return float(radius_of_cap(feature.height.median, width) if known is None else known)


def _chain(feet: FloatArray, normals: FloatArray, chain: FloatArray, radius: float, tip_radius: float) -> FloatArray:
    """(N,) heights at which a ball leaves a chain (K, 3) of capsules, m; as `chain_height`."""
    from mapping.geometry.templates import chain_heights

    count, out = len(feet), np.empty((1, len(feet)))
    first, last = np.zeros(count, dtype=np.int64), np.full(count, len(chain) - 1, dtype=np.int64)
    place = (feet, normals, np.zeros_like(feet), np.zeros(count), first, last)
    chain_heights(*place, np.ascontiguousarray(chain)[None], np.array([radius]), np.ones(1), tip_radius, out)
    return np.asarray(out[0])


def _flat_topped(feature: Feature, feet: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) heights of a line or a spot with a flat top and straight flanks, m."""
    from mapping.geometry.templates import section_heights

    rounding, ends = feature.details.end_rounding, np.array([[-1e300, 1e300]])
    if rounding is None or feature.closed or len(feature.axis) < 2:
        away, rounding = distances(feet, feature.axis)[:, None], 0.0
        along = np.zeros_like(away)
    else:
        along, away = (each[:, None] for each in along_and_aside(feet, feature.axis))
        ends = np.array([[0.0, feature.length.median]])
    top, run, shoulder = (each or 0.0 for each in _flat_parts(feature))
    across, up = np.array([[0.5 * top, 0.5 * top + run]]), np.array([[feature.height.median, 0.0]])
    flat, out = np.zeros_like(away), np.empty((1, len(feet)))
    section_heights(along, away, np.zeros((2, 0, *away.shape)), flat, flat, np.zeros((1, 0)), ends,
                    np.array([0.5 * top * rounding]), across, up, np.array([shoulder]), tip_radius, out)  # fmt: skip
    return np.asarray(out[0])


def _bell(feature: Feature, feet: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) heights that a section of the feature's scale and exponent leaves, m; an end is half of a bump."""
    from mapping.geometry.templates import smooth_point_heights

    details, away = feature.details, distances(feet, feature.axis)[:, None]
    scale, exponent = float(details.scale or 0.0), float(details.exponent or 0.0)
    known = feature.height.median, 0.5 * float(width_at_half_height(scale, exponent)), 1.0 / exponent
    section, out = [np.array([each]) for each in known], np.empty((1, len(feet)))
    smooth_point_heights(away, np.zeros_like(away), np.zeros(2), np.zeros((1, 2)), *section, tip_radius, out)
    return np.asarray(out[0])


def along_and_aside(points: FloatArray, axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(N,) places of points along a polyline (K, 3) from its beginning, which goes on straight at both ends, and their
    distances from it, m."""
    far = float(np.linalg.norm(points - axis[0], axis=1).max(initial=0.0)) + float(np.ptp(axis, axis=0).sum())
    before, behind = axis[0] - axis[1], axis[-1] - axis[-2]
    longer = np.vstack([
        axis[0] + far * before / np.linalg.norm(before), axis, axis[-1] + far * behind / np.linalg.norm(behind)
    ])  # fmt: skip
    on, along = nearest_on(points, longer)
    return along - far, np.linalg.norm(points - on, axis=1)
