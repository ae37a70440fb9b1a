"""Sweep paths: sweeps as the eye should see them, thin lines on the base instead of the jitter of every sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mapping import BoolArray, Feature, FloatArray, Trace
from mapping.base import Base, LaidTrace
from mapping.detection import Crossing
from mapping.geometry.contact import BallContact
from mapping.geometry.mesh import arclengths
from mapping.model import feature_mesh

# Samples are averaged over this share of the explored size: about three pixels of a picture.
DRAWN_SPACING_SHARE = 0.0025
# Samples that tell the explored size.
SIZE_SAMPLES = 50_000
# Blocks from which the true length of a noisy path is taken.
LENGTH_BLOCKS = 64
# A sweep's way up onto a feature is that of a ball of this share of its height
WAY_SHARE = 1e-3
# Share of a feature's size below which its height lifts nothing that is seen: a ball of WAY_SHARE of it would be a
# thousand times as large as digits tell on a body of that size (1e-13)
LEAST_LIFT = 1e-7


@dataclass(frozen=True, eq=False)
class SweepPath:
    """One sweep: points (M, 3) on the base, m, its outward normals (M, 3), and where something was noticed (M,)."""

    points: FloatArray
    normals: FloatArray
    noticed: BoolArray


def sweep_paths(trace: Trace, base: Base, crossings: Sequence[Crossing] = ()) -> list[SweepPath]:
    """Every sweep on the base, averaged over stretches that the eye cannot tell apart.

    Args:
        trace: all samples; what of them is laid on the base already is not laid again.
        base: the global model.
        crossings: detections; the samples that they cover count as noticed.
    """
    if len(trace) == 0:
        return []
    spacing = DRAWN_SPACING_SHARE * float(
        np.linalg.norm(np.ptp(trace.centers[:: 1 + len(trace) // SIZE_SAMPLES], axis=0))
    )
    marked = _noticed(trace, crossings)
    paths, start = [], 0
    for sweep in LaidTrace.of(trace, base).laid_sweeps:
        centers = sweep.trace.centers
        firsts = np.arange(0, len(centers), _block(centers, spacing))
        count = np.diff(np.append(firsts, len(centers)))
        means = np.add.reduceat(centers, firsts, axis=0) / count[:, None]
        points, normals, _ = sweep.feet_of_means(means, firsts, len(centers))
        paths.append(SweepPath(points, normals, marked[start + firsts + count // 2]))
        start += len(centers)
    return paths


def over_features(paths: Sequence[SweepPath], features: Sequence[Feature]) -> list[SweepPath]:
    """The sweeps as they climb the features, which would hide them where they are wider than a line is drawn.

    Along its normal a point of a sweep is lifted onto the highest feature that stands over it.
    """
    if not paths:
        return []
    points = np.concatenate([path.points for path in paths])
    normals = np.concatenate([path.normals for path in paths])
    lift = np.zeros(len(points))
    for feature in features:
        height = feature.height.median
        if not (np.isfinite(height) and height > 0.0):
            continue
        body = feature_mesh(feature)
        low, high = body.bounds
        if height < LEAST_LIFT * float(np.max(high - low)):
            continue
        near = np.flatnonzero(((points >= low - height) & (points <= high + height)).all(axis=1))
        if len(near):
            size = WAY_SHARE * height
            start = 1.5 * height
            met = BallContact(body, size).first_contact(points[near] + start * normals[near], -normals[near])
            up = start - met.distance - size
            lift[near] = np.where(met.count > 0, np.maximum(lift[near], up), lift[near])
    lifted = np.split(points + lift[:, None] * normals, np.cumsum([len(path.points) for path in paths])[:-1])
    return [replace(path, points=places) for path, places in zip(paths, lifted, strict=True)]


def _block(points: FloatArray, spacing: float) -> int:
    """Samples per stretch: the path's length without its jitter decides."""
    size = max(1, len(points) // LENGTH_BLOCKS)
    whole = len(points) // size * size
    length = arclengths(points[:whole].reshape(-1, size, 3).mean(axis=1))[-1]
    return max(1, int(spacing * len(points) / length)) if length > 0 else len(points)


def _runs(trace: Trace) -> list[tuple[int, int]]:
    """(first, past last) sample of each run with one sweep number."""
    if len(trace) == 0:
        return []
    cuts = [0, *(np.flatnonzero(np.diff(trace.sweep)) + 1).tolist(), len(trace)]
    return list(pairwise(cuts))


def _noticed(trace: Trace, crossings: Sequence[Crossing]) -> BoolArray:
    """(N,) True for the samples that a crossing covers."""
    mask = np.zeros(len(trace), dtype=bool)
    first = {int(trace.sweep[start]): start for start, _ in reversed(_runs(trace))}
    for crossing in crossings:
        if crossing.sweep in first:
            mask[first[crossing.sweep] + crossing.start : first[crossing.sweep] + crossing.stop] = True
    return mask


def densified(points: FloatArray, spacing: float) -> FloatArray:
    """Points of the polyline (K, 3) at most `spacing` apart, m."""
    s = arclengths(points)
    even = np.linspace(0.0, s[-1], 2 + int(s[-1] / spacing))
    return np.column_stack([np.interp(even, s, points[:, k]) for k in range(3)])
