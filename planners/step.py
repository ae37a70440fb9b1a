"""Step: where one sweep across a step passes the step's edge, so that the edge can be followed like a ridge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mapping.base import Base
from mapping.crossing import Crossing
from mapping.noise import Noise
from mapping.trace import Trace
from planners.end_fit import fit_end

FloatArray = NDArray[np.float64]


def is_step(crossing: Crossing) -> bool:
    """True for the kinds "step up" and "step down"."""
    return crossing.kind.startswith("step")


def step_crossing(
    trace: Trace, base: Base, noise: Noise, point: FloatArray, way: FloatArray, like: Crossing
) -> Crossing | None:
    """The edge on a sweep across a step, by generalised least squares with the step's closed-form trace.

    A step seen from its high side is a plateau that ends at a sharp edge: the fit is that of a ridge's end
    with a cap of radius zero (theory section 4).

    Args:
        trace: one sweep.
        base: the global model.
        noise: of the samples.
        point: (3,) a point on the sweep, m.
        way: (3,) unit direction of the sweep.
        like: a crossing of the same step.

    Returns:
        The crossing, or None if the sweep does not show the edge.
    """
    if len(trace) < 32:
        return None
    feet = base.foot(trace.centers, trace.tip_radius)
    place = (feet.points - point) @ way
    order = np.argsort(place, kind="stable")
    place, height = place[order], feet.height[order]
    sign = float(np.sign(like.height))
    third = max(1, len(height) // 4)
    falls = sign * float(height[:third].mean() - height[-third:].mean()) > 0
    s, h = (place, height) if falls else (-place[::-1], height[::-1])
    fit = fit_end(s, h, sign, abs(like.height), trace.tip_radius, noise, cap=0.0)
    if not fit.found:
        return None
    offset = fit.place if falls else -fit.place
    nearest = int(np.abs(place - offset).argmin())
    foot = base.foot((point + offset * way)[None] + trace.tip_radius * feet.normals[order][nearest], trace.tip_radius)
    return replace(
        like,
        sweep=int(trace.sweep[0]),
        t=float(trace.t[order][nearest]),
        point=foot.points[0],
        normal=foot.normals[0],
        tangent=way,
        kind="step down" if falls == (sign > 0) else "step up",
        height=fit.height,
        position_sd=fit.sd,
    )
