"""Whether a log shows the object of a model, in its frame: by the mesh that it was recorded for, and by its samples."""

from __future__ import annotations

import numpy as np

from explore3d.base_record import read_base
from explore3d.recording import Log
from mapping.base import Base

# Two surfaces, or a trace and the base under it, may lie so far apart in tip radii, and in sds of the pose
APART, POSE_SDS = 0.1, 3.0
# Samples, or faces, that are looked at
MOST = 5000
# Share of the faces whose middles must lie on the other mesh: a border may be cut elsewhere
SHARE = 0.9


def unlike(log: Log, base: Base, pose_sd: float = 0.0) -> str:
    """Why a log cannot be of the object with that base; "" if nothing speaks against it.

    What lies on the base may differ: a log of a twin with other features cannot be told from a later look at this one.

    Args:
        log: a recording.
        base: of the model that it shall join.
        pose_sd: standard deviation of the pose between the two, m.
    """
    limit = APART * log.trace.tip_radius + POSE_SDS * pose_sd
    own = read_base(log.events)
    if own is not None and own.kind == base.kind == "mesh":
        gap = max(_gap(own, base), _gap(base, own))
        if gap > limit:
            return (
                f"the mesh that it was recorded for lies {_mm(gap)} off the model's; at most {_mm(limit)} is possible"
            )
    some = np.linspace(0, len(log.trace) - 1, min(MOST, len(log.trace))).astype(np.int64)
    height = base.foot(log.trace.centers[some], log.trace.tip_radius).height
    off = float(np.median(np.abs(height)))
    if off > limit:
        return f"half of its samples lie more than {_mm(off)} off the model's base; at most {_mm(limit)} is possible"
    return ""


def _gap(one: Base, other: Base) -> float:
    """Distance of a mesh from another that SHARE of its faces keep within, m."""
    middles = one.surface.vertices[one.surface.faces].mean(axis=1)
    some = middles[np.linspace(0, len(middles) - 1, min(MOST, len(middles))).astype(np.int64)]
    return float(np.quantile(other.nearest.query(some).distance, SHARE))


def _mm(length: float) -> str:
    return f"{1e3 * length:.3g} mm"
