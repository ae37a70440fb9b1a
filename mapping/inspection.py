"""Inspection: which places of the base the sweeps passed over, and how high they found them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapping.base import Base
from mapping.height_profile import arclength, height_profiles
from mapping.noise import Noise
from mapping.trace import Trace

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Inspection:
    """Mean heights at places along the sweeps.

    Args:
        points: (M, 3) places on the base, m.
        height: (M,) mean height there, m.
        sd: standard deviation of each mean, m.
        sweep: (M,) number of the sweep.
        spacing: distance between neighbouring places of a sweep, m.
    """

    points: FloatArray
    height: FloatArray
    sd: float
    sweep: IntArray
    spacing: float

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    @cached_property
    def pitch(self) -> float:
        """Typical distance from a place to the nearest other sweep, m; infinity for a single sweep."""
        gaps = []
        for number in np.unique(self.sweep):
            own = np.flatnonzero(self.sweep == number)
            probes = own[np.linspace(0, len(own) - 1, 7).astype(int)[1:-1]]
            others = self.points[self.sweep != number]
            if len(others):
                distance = np.linalg.norm(self.points[probes][:, None] - others[None], axis=2).min(axis=1)
                gaps.append(float(np.median(distance)))
        return float(np.quantile(gaps, 0.75)) if gaps else float("inf")

    def denies(self, path: FloatArray, height: float, reach: float) -> bool:
        """True if a place within `reach` of the path (K, 3) was found clearly lower than half the height."""
        near = self._tree.query_ball_point(path, reach)
        places = sorted({place for some in near for place in some})
        if not places:
            return False
        return bool((np.sign(height) * self.height[places] + 3 * self.sd < 0.5 * abs(height)).any())

    def inspected(self, point: FloatArray, reach: float) -> bool:
        """True if a sweep passed within `reach` of the point."""
        return bool(self._tree.query(point)[0] <= reach)


def inspect(trace: Trace, base: Base, noise: Noise, spacing: float) -> Inspection:
    """Mean heights over stretches of the given length along every sweep of the trace."""
    points, height, sweep = [], [], []
    samples = 1.0
    for number, part in trace.sweeps():
        s = arclength(part, base)
        if len(part) < 2 or not s[-1] > 0:
            continue
        for profile in height_profiles(number, part, s, base, spacing):
            points.append(base.foot(profile.centers, part.tip_radius).points)
            height.append(profile.height)
            sweep.append(np.full(len(profile.height), number))
            samples = max(profile.samples, 1.0)
    if not points:
        return Inspection(np.zeros((0, 3)), np.zeros(0), 0.0, np.zeros(0, dtype=np.int64), spacing)
    sd = float(np.sqrt(noise.block_covariances(1, spacing, samples)[0]))
    return Inspection(np.concatenate(points), np.concatenate(height), sd, np.concatenate(sweep), spacing)
