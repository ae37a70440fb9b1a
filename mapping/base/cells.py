"""Cells: the mean ball centres of short stretches of sweeps: what fits of the whole body are made to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Trace
from mapping.instrument import Row


@dataclass(frozen=True, eq=False)
class Cells:
    """Means over consecutive samples of one sweep.

    Args:
        centers: (C, 3) mean ball centres in the order of time, m.
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
        centers = np.add.reduceat(trace.centers, starts) / counts
        normals = None if trace.normals is None else np.add.reduceat(trace.normals, starts) / counts
        return cls(centers, sweep[starts], normals, cell)

    def trace(self, tip_radius: float, keep: BoolArray) -> Trace:
        """Some of the cells as a trace of their own; their times count cells."""
        normals = None if self.normals is None else self.normals[keep]
        return Trace(np.flatnonzero(keep).astype(np.float64), self.centers[keep], self.sweep[keep], tip_radius, normals)


def rows_of(points: FloatArray, height: FloatArray, sweep: IntArray, samples: float = 1.0) -> list[Row]:
    """What each sweep read in cells (C) of so many samples, its points (C, 3) and heights (C,), m; sweeps ascend."""
    begins = np.flatnonzero(np.diff(sweep, prepend=sweep[:1] - 1))
    along = np.linalg.norm(np.diff(points, axis=0), axis=1)
    step = float(np.median(np.append(along[np.diff(sweep) == 0], 0.0)))
    each = zip(np.split(points, begins[1:]), np.split(height, begins[1:]), strict=True)
    return [Row(places, own, step, samples) for places, own in each]
