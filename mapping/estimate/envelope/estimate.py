"""Estimate: what a trace says about the body, and where it says nothing for certain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping import FloatArray, IntArray, Surface
from mapping.estimate.sweeps import BRIDGED


@dataclass(frozen=True, eq=False)
class Estimate:
    """The estimated surface of a trace.

    Args:
        surface: its mesh, whose vertices are `points`, or None where there is none: a single sweep, or
            too few samples.
        points: (N, 3) points of the estimated surface, m; in the order of the trace, bridged points
            inserted between the contacts that bound them.
        normals: (N, 3) outward unit normals of the ball there: the direction from the point to `centers`.
        centers: (N, 3) centre of the ball that bounds each point, m.
        labels: (N,) TOUCHED: the ball's single contact, on the body; BRIDGED: the ball rests on two
            places and the body lies somewhere below; EXTRAPOLATED: between or beyond the samples, or
            where the neighbouring sweeps are too far apart to tell where the ball touches.
        sample: (N,) index of the trace's sample that each point comes from, -1 for inserted points.
        sweep: (N,) number of the sweep.
        across: (N,) curvature of the traced surface across the sweeps, 1/m, positive where it bulges out;
            NaN where the neighbouring sweeps do not tell.
        sd: standard deviation of a point along its normal, m; zero for a trace taken as exact.
    """

    surface: Surface | None
    points: FloatArray
    normals: FloatArray
    centers: FloatArray
    labels: NDArray[np.int8]
    sample: IntArray
    sweep: IntArray
    across: FloatArray
    sd: float = 0.0

    def __post_init__(self) -> None:
        for name in ("points", "normals", "centers", "labels", "sample", "sweep", "across"):
            getattr(self, name).setflags(write=False)

    def fraction(self, label: int) -> float:
        """Share of the points that carry a label."""
        return float(np.mean(self.labels == label)) if len(self.labels) else 0.0

    def select(self, index: IntArray) -> Estimate:
        """The points of these indices, without a mesh."""
        return Estimate(
            None,
            self.points[index],
            self.normals[index],
            self.centers[index],
            self.labels[index],
            self.sample[index],
            self.sweep[index],
            self.across[index],
        )

    def with_resting(self, points: FloatArray, owners: IntArray) -> Estimate:
        """This estimate with bridged points (K, 3) added, each where balls of three points `owners` (K, 3) meet."""
        first = owners[:, 0]
        arm = self.centers[first] - points
        length = np.maximum(np.linalg.norm(arm, axis=1, keepdims=True), np.finfo(float).tiny)
        return Estimate(
            None,
            np.vstack([self.points, points]),
            np.vstack([self.normals, arm / length]),
            np.vstack([self.centers, self.centers[first]]),
            np.concatenate([self.labels, np.full(len(points), BRIDGED, dtype=np.int8)]),
            np.concatenate([self.sample, np.full(len(points), -1)]),
            np.concatenate([self.sweep, self.sweep[first]]),
            np.concatenate([self.across, np.full(len(points), np.nan)]),
        )
