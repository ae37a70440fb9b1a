"""SweepCurve: a sweep as a smooth curve between its samples, with its kinks where they are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapping import FloatArray
from mapping.estimate.sweeps.contact_row import ContactRow


@dataclass(frozen=True, eq=False)
class SweepCurve:
    """Cubic Hermite segments through the samples and interference points of one sweep.

    Args:
        nodes: (M, 3) centres, m.
        arriving, leaving: (M, 3) unit tangents on both sides of each node; they differ at kinks only.
    """

    nodes: FloatArray
    arriving: FloatArray
    leaving: FloatArray

    @classmethod
    def of(cls, row: ContactRow) -> SweepCurve:
        """The curve of a row: fans shrink to one node that turns."""
        start = np.r_[True, (np.diff(row.centers, axis=0) != 0).any(axis=1)]
        if start.all():
            return cls(row.centers, row.tangents, row.tangents)
        first = np.flatnonzero(start)
        last = np.r_[first[1:] - 1, len(start) - 1]
        return cls(row.centers[first], row.tangents[first], row.tangents[last])

    def crossings(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """(N, 3) where the curve crosses the planes through `points` (N, 3) with `normals`; NaN where it does not.

        Of several crossings one near the point is taken.
        """
        if len(self.nodes) < 2:
            return np.full_like(points, np.nan)
        from mapping.estimate.sweeps.curve_kernels import plane_crossings
        from mapping.geometry.mesh import MOST_WAITING

        out, waiting = np.empty(points.shape), np.empty(MOST_WAITING, np.int64)
        plane_crossings(self.nodes, self._boxes, self.arriving, self.leaving, points, normals, waiting, out)
        return out

    @cached_property
    def _boxes(self) -> FloatArray:
        from mapping.geometry.mesh import boxes_about

        return np.asarray(boxes_about(self.nodes))
