"""Crest: where one sweep crosses a ridge, groove or step that is already known from other sweeps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping import FloatArray, Trace
from mapping.base import Base
from mapping.detection import Crossing
from mapping.instrument import Noise
from planners.follow.template_fit import FEWEST_FITTED, ShapeFit, crest_shape, dip_shape, edge_shape, fit_shape

# Fall of chi-squared below which a sweep shows nothing: five standard deviations
SEEN_CHI_SQUARE_FALL = 25.0


def is_step(crossing: Crossing) -> bool:
    """True for the kinds "step up" and "step down"."""
    return crossing.is_step


def slender(crossing: Crossing, tip_radius: float) -> float:
    """Half-width of a thin wire of the crossing's height, sqrt(2 r H), over the crossing's own half-width."""
    return float(np.sqrt(2.0 * tip_radius * abs(crossing.height)) / max(crossing.half_width, np.finfo(float).tiny))


def seen_again(
    trace: Trace,
    base: Base,
    noise: Noise,
    point: FloatArray,
    way: FloatArray,
    like: Crossing,
    reach: float,
) -> Crossing | None:
    """The crossing of a known line by a sweep across it, or None if the sweep does not show it.

    The line's shape is known from `like`, so only its place and height are fitted: more precise, and much
    quicker, than looking for anything anywhere.

    Args:
        trace: one sweep.
        base: the global model.
        noise: of the samples.
        point: (3,) where the line is expected, on the sweep, m.
        way: (3,) unit direction of the sweep.
        like: an earlier crossing of the same line.
        reach: how far from `point` it may lie, m.
    """
    feet = base.foot(trace.centers, trace.tip_radius)
    place = (feet.points - point) @ way
    order = np.argsort(place, kind="stable")
    place, height, normals = place[order], feet.height[order], feet.normals[order]
    window = np.abs(place) <= reach + (2.5 if is_step(like) else 0.9) * like.half_width
    if window.sum() < FEWEST_FITTED:
        return None
    wide = flattening(place[window], normals[window], way, trace.tip_radius)
    fit, kind, half_width = _fitted(wide * place[window], height[window], trace.tip_radius, noise, like, wide * reach)
    fit, half_width = replace(fit, place=fit.place / wide, sd=fit.sd / wide), half_width / wide
    # a fit at the rim of its range follows the flank of something else
    if fit.gain < SEEN_CHI_SQUARE_FALL or abs(fit.place) > 0.97 * reach:
        return None
    near = int(np.abs(place - fit.place).argmin())
    foot = base.foot((point + fit.place * way + trace.tip_radius * normals[near])[None], trace.tip_radius)
    return replace(
        like,
        sweep=int(trace.sweep[0]),
        t=float(trace.t[order][near]),
        point=foot.points[0],
        normal=foot.normals[0],
        tangent=way,
        kind=kind,
        height=fit.height,
        height_sd=fit.height_sd,
        position_sd=fit.sd,
        half_width=half_width,
        snr=float(np.sqrt(fit.gain)),
    )


def flattening(place: FloatArray, normals: FloatArray, way: FloatArray, tip_radius: float) -> float:
    """By how much shapes on a bent base are narrower than the same shapes on a flat one.

    Over a base of curvature k the ball's centre runs 1 + k r times as far as its foot, and the crest's own trace of
    radius R rises over one of radius r + 1/k: to second order the height falls off as over a flat base whose
    lengths are stretched by sqrt((1 + k r) (1 - k (R - r))), about sqrt(1 + k r).

    Args:
        place: (N,) places along the sweep, m, in order.
        normals: (N, 3) of the base there.
        way: (3,) direction of the sweep, of any length.
    """
    ends = np.linspace(0, len(place) - 1, 9).astype(int)
    step = np.diff(place[ends])
    turn = np.diff(normals[ends], axis=0) @ (way / np.linalg.norm(way))
    # the median leaves out an edge of the mesh, where the base turns at once
    bend = float(np.median(turn[step > 0] / step[step > 0])) if (step > 0).any() else 0.0
    return float(np.sqrt(np.clip(1.0 + bend * tip_radius, 0.25, 4.0)))


def _fitted(
    place: FloatArray, height: FloatArray, tip_radius: float, noise: Noise, like: Crossing, reach: float
) -> tuple[ShapeFit, str, float]:
    """The fit, the kind and the half-width of the line where the sweep crosses it."""
    sign, crest = float(np.sign(like.height)), abs(like.height)
    if is_step(like):
        fit, kind = _edge(place, height, tip_radius, noise, like, reach)
        return fit, kind, like.half_width
    if sign < 0:
        fit = fit_shape(place, height, dip_shape(tip_radius), sign, crest, (-reach, reach), noise)
        return fit, like.kind, like.half_width
    # a wire's cap is half as high as itself; another one's follows from its width, x_c^2 = 2 (r + a) H
    wide = max(like.half_width**2 / (2.0 * crest) - tip_radius, 0.0)
    caps = sorted({0.5 * crest, min(wide, 10.0 * tip_radius)})
    fits = [fit_shape(place, height, crest_shape(a, tip_radius), sign, crest, (-reach, reach), noise) for a in caps]
    best = int(np.argmax([fit.gain for fit in fits]))
    half_width = float(np.sqrt(2.0 * (tip_radius + caps[best]) * abs(fits[best].height)))
    return fits[best], like.kind, half_width


def _edge(
    place: FloatArray, height: FloatArray, tip_radius: float, noise: Noise, like: Crossing, reach: float
) -> tuple[ShapeFit, str]:
    """A step is fitted from its high side: the profile is turned round where it climbs."""
    sign, crest = float(np.sign(like.height)), abs(like.height)
    quarter = max(1, len(height) // 4)
    falls = sign * float(height[:quarter].mean() - height[-quarter:].mean()) > 0
    s, h = (place, height) if falls else (-place[::-1], height[::-1])
    fit = fit_shape(s, h, edge_shape(tip_radius), sign, crest, (-reach, reach), noise)
    kind = "step down" if falls == (sign > 0) else "step up"
    return (fit if falls else replace(fit, place=-fit.place)), kind
