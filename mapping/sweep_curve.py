"""SweepCurve: a sweep as a smooth curve between its samples, with its kinks where they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.contact_row import ContactRow

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
        first = np.flatnonzero(start)
        last = np.r_[first[1:] - 1, len(start) - 1]
        return cls(row.centers[first], row.tangents[first], row.tangents[last])

    def crossings(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """(N, 3) where the curve crosses the planes through `points` (N, 3) with `normals`; NaN where it does not.

        Of several crossings one near the point is taken.
        """
        from scipy.spatial import cKDTree

        if len(self.nodes) < 2:
            return np.full_like(points, np.nan)
        segment = np.clip(np.asarray(cKDTree(self.nodes).query(points)[1]), 0, len(self.nodes) - 2)
        for _ in range(6):
            start, stop = self._distance(segment, points, normals), self._distance(segment + 1, points, normals)
            step = np.where(stop != start, -start / np.where(stop != start, stop - start, 1.0), 0.0)
            segment = np.clip(segment + np.floor(np.clip(step, -1e6, 1e6)).astype(int), 0, len(self.nodes) - 2)
        start, stop = self._distance(segment, points, normals), self._distance(segment + 1, points, normals)
        crossed = np.sign(start) * np.sign(stop) <= 0
        share = np.where(start != stop, start / np.where(start != stop, start - stop, 1.0), 0.0)
        for _ in range(6):
            place, slope = self._hermite(segment, share)
            height = np.einsum("ij,ij->i", place - points, normals)
            rise = np.einsum("ij,ij->i", slope, normals)
            share = np.clip(share - np.where(rise != 0, height / np.where(rise != 0, rise, 1.0), 0.0), 0.0, 1.0)
        return np.where(crossed[:, None], self._hermite(segment, share)[0], np.nan)

    def _distance(self, node: IntArray, points: FloatArray, normals: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("ij,ij->i", self.nodes[node] - points, normals))

    def _hermite(self, segment: IntArray, share: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Place on the segments at shares (N,) of their way, and its derivative."""
        a, b = self.nodes[segment], self.nodes[segment + 1]
        chord = b - a
        length = np.linalg.norm(chord, axis=1, keepdims=True)
        u, v = self.leaving[segment] * length, self.arriving[segment + 1] * length
        t = share[:, None]
        place = a + chord * t * t * (3 - 2 * t) + u * t * (1 - t) ** 2 - v * t * t * (1 - t)
        slope = chord * 6 * t * (1 - t) + u * (1 - t) * (1 - 3 * t) + v * t * (3 * t - 2)
        return place, slope
