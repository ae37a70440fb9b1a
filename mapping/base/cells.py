"""Cells: the mean ball centres of short stretches of sweeps: what fits of the whole body are made to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Trace
from mapping.geometry.mesh import unit_vectors
from mapping.instrument import Row


@dataclass(frozen=True, eq=False)
class Cells:
    """Means over consecutive samples of one sweep.

    Args:
        centers: (C, 3) ball centres amid the cells, in the order of time, m.
        sweep: (C,) sweep of each.
        normals: (C, 3) mean contact normals, or None.
        cell: (N,) number of the cell of each sample.
    """

    centers: FloatArray
    sweep: IntArray
    normals: FloatArray | None
    cell: IntArray

    @classmethod
    def of(cls, trace: Trace, most: int) -> Cells:
        """At most about `most` cells of equally many samples each; no cell spans two sweeps."""
        group, order = np.arange(len(trace)) * most // max(len(trace), most), np.arange(len(trace))
        if (np.diff(trace.sweep) < 0).any():  # by sweep and, within each, by group
            order = np.argsort(trace.sweep, kind="stable")
            trace, group = trace.select(order), group[order]
        sweep = trace.sweep
        starts = np.flatnonzero((np.diff(sweep, prepend=sweep[:1] - 1) != 0) | (np.diff(group, prepend=-1) != 0))
        lengths = np.diff(np.append(starts, len(trace)))
        cell, counts = np.empty(len(trace), dtype=np.int64), lengths[:, None]
        cell[order] = np.repeat(np.arange(len(starts)), lengths)
        centers = _on_the_path(np.add.reduceat(trace.centers, starts) / counts, lengths, sweep[starts])
        normals = None if trace.normals is None else np.add.reduceat(trace.normals, starts) / counts
        return cls(centers, sweep[starts], normals, cell)

    def trace(self, tip_radius: float, keep: BoolArray) -> Trace:
        """Some of the cells as a trace of their own; their times count cells."""
        normals = None if self.normals is None else self.normals[keep]
        return Trace(np.flatnonzero(keep).astype(np.float64), self.centers[keep], self.sweep[keep], tip_radius, normals)


def _on_the_path(means: FloatArray, samples: IntArray, sweep: IntArray) -> FloatArray:
    """(C, 3) places on the path amid cells of so many samples (C,), from their means (C, 3).

    The mean of n samples on a bend lies inside it, by (n^2 - 1) / 24 of the path's second derivative by the samples'
    number: 0.34 um for cells of 0.43 mm on a circle of 23 mm, by which a cylinder's radius would be too small and every
    height over it too large. The derivative is that of the parabola through a cell's mean and its neighbours', limited
    as slopes are in bins (see `height_profile`): no more than twice that of either neighbour, and none where these
    bend to the other side. So a straight path stays straight beside an edge that the ball rolls round, and noise, which
    bends to and fro, moves little; the least of the three would be too small by it (31 nm of these 0.34 um).
    """
    if len(means) < 3 or samples.max() == 1:
        return means
    place = np.cumsum(samples) - 0.5 * samples
    rise = np.diff(means, axis=0) / np.diff(place)[:, None]
    second = np.zeros_like(means)
    second[1:-1] = 2.0 * np.diff(rise, axis=0) / (place[2:] - place[:-2])[:, None]
    inner = np.zeros(len(means), dtype=bool)
    inner[1:-1] = sweep[2:] == sweep[:-2]
    size = np.linalg.norm(second, axis=1)
    longest = size.copy()
    for step in (-1, 1):
        beside = np.clip(np.arange(len(means)) + step, 0, len(means) - 1)
        known = inner & inner[beside]
        alike = np.einsum("ij,ij->i", second, second[beside]) > 0.0
        most = np.where(alike, np.minimum(size, 2.0 * size[beside]), 0.0)
        longest = np.where(known, np.minimum(longest, most), longest)
    bend = unit_vectors(second) * np.where(inner, longest, 0.0)[:, None]
    # the ends of a sweep bend as the cells beside them
    for end, step in ((np.diff(sweep, prepend=sweep[0] - 1) != 0, 1), (np.diff(sweep, append=sweep[-1] + 1) != 0, -1)):
        at = np.flatnonzero(end & ~inner)
        beside = np.clip(at + step, 0, len(means) - 1)
        bend[at] = np.where((sweep[beside] == sweep[at])[:, None], bend[beside], 0.0)
    return np.asarray(means - ((samples**2 - 1.0) / 24.0)[:, None] * bend)


def rows_of(points: FloatArray, height: FloatArray, sweep: IntArray, samples: float = 1.0) -> list[Row]:
    """What each sweep read in cells (C) of so many samples, its points (C, 3) and heights (C,), m; sweeps ascend."""
    begins = np.flatnonzero(np.diff(sweep, prepend=sweep[:1] - 1))
    along = np.linalg.norm(np.diff(points, axis=0), axis=1)
    step = float(np.median(np.append(along[np.diff(sweep) == 0], 0.0)))
    each = zip(np.split(points, begins[1:]), np.split(height, begins[1:]), strict=True)
    return [Row(places, own, step, samples) for places, own in each]
