"""DynamicFinger: the simulated finger with a mass, a stiff contact and the hybrid law, for scenes that need it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hw import Move
from hw.simulated.dynamics import Dynamics
from hw.simulated.finger import SimulatedFinger
from mapping import BoolArray, FloatArray, IntArray, Trace
from mapping.geometry.contact import Contacts


@dataclass(kw_only=True)
class DynamicFinger(SimulatedFinger):
    """Like SimulatedFinger, but its tip has inertia and yields: it lags, overshoots and flies.

    At every sample the tip stands off the rigid contact along the approach direction by the gap of
    hw.simulated.dynamics; samples in flight are not in contact and are left out. Sweeps that leave the body for a
    while are ridden piece by piece.

    Args:
        dynamics: mass, stiffness, force gain, tolerance.
    """

    dynamics: Dynamics = field(default_factory=Dynamics)
    _force: float = field(init=False, default=1.0)

    def execute(self, move: Move) -> Trace:
        """Carry out one move; see SimulatedFinger."""
        self._force = move.force
        return super().execute(move)

    def _pressed(self, path: FloatArray, approach: FloatArray) -> tuple[Contacts, BoolArray]:
        felt, keep = super()._pressed(path, approach)
        centers, touching = felt.centers.copy(), keep.copy()
        times = np.arange(len(path)) / self.rate
        stroke = 2.0 * self.tip_radius if self.stroke is None else self.stroke
        for run in _runs(keep):
            inside = times[run]

            def height(t: FloatArray) -> FloatArray:
                way = np.column_stack([np.interp(t, times, path[:, k]) for k in range(3)])
                inwards = np.column_stack([np.interp(t, times, approach[:, k]) for k in range(3)])
                inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
                found = self._ball.first_contact(way - stroke * inwards, inwards).distance
                return np.where(np.isfinite(found), -found, -2.0 * stroke)

            ride = self.dynamics.ride(height, inside, self._force)
            centers[run] -= ride.gap[:, None] * approach[run]
            touching[run] = ride.force > 0.0
        return replace(felt, centers=centers), touching


def _runs(mask: BoolArray) -> list[IntArray]:
    index = np.flatnonzero(mask)
    return np.split(index, np.flatnonzero(np.diff(index) > 1) + 1) if len(index) else []
