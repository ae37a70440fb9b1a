"""Objects: whether recordings show one body in one frame, judged by their meshes, extents and samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from explore3d.log import Log, read_base
from mapping import length_text
from mapping.base import Base, fit_base

# Two surfaces, or a trace and the base under it, may lie so far apart in tip radii, and in sds of the pose
MOST_SURFACE_GAP, POSE_SDS = 0.1, 3.0
# Samples, or faces, that are looked at
MOST_COMPARED_PLACES = 5000
# Share of the faces whose middles must lie on the other mesh: a border may be cut elsewhere
MATCHING_FACE_SHARE = 0.9


def unlike(log: Log, base: Base, pose_sd: float = 0.0) -> str:
    """Why a log cannot be of the object with that base; "" if nothing speaks against it.

    What lies on the base may differ: a log of a twin with other features cannot be told from a later look at this one.

    Args:
        log: a recording.
        base: of the model that it shall join.
        pose_sd: standard deviation of the pose between the two, m.
    """
    limit = MOST_SURFACE_GAP * log.trace.tip_radius + POSE_SDS * pose_sd
    own = read_base(log.events)
    if own is not None and own.kind == base.kind == "mesh":
        gap = max(_gap(own, base), _gap(base, own))
        if gap > limit:
            most = length_text(limit)
            return (
                f"the mesh that it was recorded for lies {length_text(gap)} off the other; at most {most} is possible"
            )
    some = np.linspace(0, len(log.trace) - 1, min(MOST_COMPARED_PLACES, len(log.trace))).astype(np.int64)
    height = base.foot(log.trace.centers[some], log.trace.tip_radius).height
    off = float(np.median(np.abs(height)))
    if off > limit:
        most = length_text(limit)
        return f"half of its samples lie more than {length_text(off)} off the base; at most {most} is possible"
    return ""


def _gap(one: Base, other: Base) -> float:
    """Distance of a mesh from another that MATCHING_FACE_SHARE of its faces keep within, m."""
    middles = one.surface.vertices[one.surface.faces].mean(axis=1)
    some = middles[np.linspace(0, len(middles) - 1, min(MOST_COMPARED_PLACES, len(middles))).astype(np.int64)]
    return float(np.quantile(other.nearest.query(some).distance, MATCHING_FACE_SHARE))


def not_one_object(logs: Sequence[Log]) -> str:
    """Why recordings cannot be taken as sweeps over one object without being told; "" if nothing speaks against it.

    Their fingertips, scenes, extents and bases must agree: each one's box must share a place with another's, and the
    samples of each must lie on the base of the first, its own or the one fitted to it.
    """
    first = logs[0]
    for log in logs[1:]:
        name = ", ".join(log.sources)
        if log.trace.tip_radius != first.trace.tip_radius:
            tips = [length_text(each.trace.tip_radius, 6) for each in (log, first)]
            return f"{name} was felt with a tip of {tips[0]}, not {tips[1]}"
    boxes = [(log.trace.centers.min(axis=0), log.trace.centers.max(axis=0)) for log in logs]
    for number, (low, high) in enumerate(boxes):
        room = first.trace.tip_radius
        others = [box for other, box in enumerate(boxes) if other != number]
        if not any((low <= top + room).all() and (high >= bottom - room).all() for bottom, top in others):
            return f"{', '.join(logs[number].sources)} lies in another place than the others"
    base = read_base(first.events) or fit_base(first.trace)
    for log in logs[1:]:
        if complaint := unlike(log, base):
            return f"{', '.join(log.sources)}: {complaint}"
    return ""
