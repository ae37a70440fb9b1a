"""Crest: where one sweep crosses a ridge, groove or step that is already known from other sweeps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mapping.base import Base
from mapping.crossing import Crossing
from mapping.noise import Noise
from mapping.trace import Trace
from planners.shape_fit import ShapeFit, crest_shape, edge_shape, fit_shape

FloatArray = NDArray[np.float64]

# Fall of chi-squared below which a sweep shows nothing: five standard deviations
SEEN = 25.0


def is_step(crossing: Crossing) -> bool:
    """True for the kinds "step up" and "step down"."""
    return crossing.kind.startswith("step")


def seen_again(
    trace: Trace, base: Base, noise: Noise, point: FloatArray, way: FloatArray, like: Crossing, reach: float
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
    window = np.abs(place) <= reach + (2.5 if is_step(like) else 1.2) * like.half_width
    if window.sum() < 32:
        return None
    fit, kind = _fitted(place[window], height[window], trace.tip_radius, noise, like, reach)
    if fit.gain < SEEN:
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
        snr=float(np.sqrt(fit.gain)),
    )


def _fitted(
    place: FloatArray, height: FloatArray, tip_radius: float, noise: Noise, like: Crossing, reach: float
) -> tuple[ShapeFit, str]:
    sign, crest = float(np.sign(like.height)), abs(like.height)
    if not is_step(like):
        shape = crest_shape(like.half_width, sign, tip_radius, crest)
        return fit_shape(place, height, shape, sign, crest, (-reach, reach), noise), like.kind
    quarter = max(1, len(height) // 4)
    falls = sign * float(height[:quarter].mean() - height[-quarter:].mean()) > 0
    s, h = (place, height) if falls else (-place[::-1], height[::-1])
    fit = fit_shape(s, h, edge_shape(tip_radius), sign, crest, (-reach, reach), noise)
    kind = "step down" if falls == (sign > 0) else "step up"
    return (fit if falls else replace(fit, place=-fit.place)), kind
