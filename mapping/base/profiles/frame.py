"""The frame of a trace that runs along one line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, Trace


@dataclass(frozen=True, eq=False)
class ProfileFrame:
    """The plane of a profile: `origin` (3,), unit rows `along`, `lateral`, `outward`."""

    origin: FloatArray
    along: FloatArray
    lateral: FloatArray
    outward: FloatArray


def profile_frame(trace: Trace) -> ProfileFrame | None:
    """The frame of a trace that runs along one line, or None if it covers an area or turns back on itself."""
    origin = trace.centers.mean(axis=0)
    offset = trace.centers - origin
    _, values, axes = np.linalg.svd(offset[:: max(1, len(offset) // 20000)], full_matrices=False)
    if values[0] == 0.0:
        return None
    along = axes[0] * (1.0 if axes[0][np.abs(axes[0]).argmax()] > 0 else -1.0)
    hint = np.array([0.0, 0.0, 1.0]) if trace.normals is None else trace.normals.mean(axis=0)
    outward = hint - (hint @ along) * along
    if np.linalg.norm(outward) < 1e-6:
        outward = axes[1]
    outward = outward / np.linalg.norm(outward)
    lateral = np.cross(outward, along)
    extent = float(np.ptp(offset @ along))
    if float(np.ptp(offset @ lateral)) > min(trace.tip_radius, 0.2 * extent):
        return None
    if float(np.ptp(offset @ outward)) > extent:
        return None
    return ProfileFrame(origin, along, lateral, outward)
