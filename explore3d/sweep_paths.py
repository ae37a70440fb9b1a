"""Sweep paths: sweeps as the eye should see them, thin lines on the base instead of the jitter of every sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mapping.crossing import Crossing
from mapping.polyline import arclengths
from mapping.trace import Trace

FloatArray = NDArray[np.float64]

# Blocks from which the true length of a noisy path is taken.
COARSE = 64


@dataclass(frozen=True, eq=False)
class SweepPath:
    """One sweep: points (M, 3) on the base, m, its outward normals (M, 3), and where something was noticed (M,)."""

    points: FloatArray
    normals: FloatArray
    noticed: NDArray[np.bool_]


def sweep_paths(
    trace: Trace, feet: FloatArray, normals: FloatArray, crossings: Sequence[Crossing], spacing: float
) -> list[SweepPath]:
    """Every sweep, averaged over stretches of about `spacing`.

    Args:
        trace: all samples.
        feet, normals: (N, 3) points of the base under them, m, and the outward normals there.
        crossings: detections; the samples that they cover count as noticed.
        spacing: m; what is finer cannot be seen.
    """
    marked = _noticed(trace, crossings)
    paths = []
    for start, stop in _runs(trace):
        firsts = np.arange(start, stop, _block(feet[start:stop], spacing))
        count = np.diff(np.append(firsts, stop))[:, None]
        mean = np.add.reduceat(feet[:stop], firsts, axis=0) / count
        middle = firsts + count[:, 0] // 2
        paths.append(SweepPath(mean, normals[middle], marked[middle]))
    return paths


def _block(points: FloatArray, spacing: float) -> int:
    """Samples per stretch: the path's length without its jitter decides."""
    size = max(1, len(points) // COARSE)
    whole = len(points) // size * size
    length = arclengths(points[:whole].reshape(-1, size, 3).mean(axis=1))[-1]
    return max(1, int(spacing * len(points) / length)) if length > 0 else len(points)


def _runs(trace: Trace) -> list[tuple[int, int]]:
    """(first, past last) sample of each run with one sweep number."""
    if len(trace) == 0:
        return []
    cuts = [0, *(np.flatnonzero(np.diff(trace.sweep)) + 1).tolist(), len(trace)]
    return list(pairwise(cuts))


def _noticed(trace: Trace, crossings: Sequence[Crossing]) -> NDArray[np.bool_]:
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
