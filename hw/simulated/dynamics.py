"""Dynamics: a fingertip of finite mass and stiffness under the hybrid force/velocity law, solved kink to kink.

The tangential speed is commanded; normal to the body a force is held in proportion to its error (paper, section
4.2.1). Between its corners the rigid trace is a straight line in time, so the motion of the tip, in contact and in
flight, has a closed form: no step of an integrator can be unstable, however stiff the contact. Corners are put where
the rigid trace bends by more than the tolerance, so that its kinks (interference points) are met, not stepped over;
loss of contact and landing are found as roots of the closed forms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hw import FingerError
from mapping import FloatArray

# Halvings of the interval between two control instants, at most: 2^-30 of 6 um is below an atom
DEEPEST = 30
# The tip lags behind a kink by v tan(phi) / (e lambda) at most: at this margin by less than 0.04 sigma
FOLLOWING_MARGIN = 10.0
# Share of the tolerance that the rigid trace may take: an error of its slope grows while the tip flies, by how much
# only a second ride can tell, over a trace FINER times as fine; below LEAST_ERROR_SHARE of it only rounding is left
RIGID_ERROR_SHARE, FINER, LEAST_ERROR_SHARE = 0.004, 8.0, 1e-7


@dataclass(frozen=True)
class Ride:
    """What the tip did.

    Args:
        gap: (N,) height of its centre over the rigid trace at the control instants, m: about -F/k in contact.
        force: (N,) contact force, N; 0 in flight.
        pieces: how many pieces in closed form it took.
        corners: of the rigid trace.
        error: largest difference of the gap to a ride over a coarser trace, m: above the error of this one.
    """

    gap: FloatArray
    force: FloatArray
    pieces: int
    corners: int
    error: float = np.inf


@dataclass(frozen=True)
class Dynamics:
    """A tip and its control.

    Args:
        mass: of what moves with the tip, kg.
        stiffness: of the contact, N/m; it is critically damped.
        gain: of the force control, without unit, 0 to 1 (1 and above cannot be stable on a stiff body: the command
            answers a force with a force, one sample late).
        tolerance: of the gap at the control instants, m.
    """

    mass: float = 0.1
    stiffness: float = 1e5
    gain: float = 0.5
    tolerance: float = 1e-8

    def __post_init__(self) -> None:
        for name in ("mass", "stiffness", "tolerance"):
            if not 0 < getattr(self, name) < np.inf:
                raise FingerError(f"dynamics: {name} must be positive and finite; found {getattr(self, name)}")
        if not 0 <= self.gain < 1:
            raise FingerError(
                f"dynamics: the force gain must be at least 0 and below 1 to be stable; found {self.gain}"
            )

    def needed(self, speed: float, kink: float, sigma: float) -> bool:
        """False where the tip follows so fast that the rigid trace says as much: lambda > 10 v tan(phi) / sigma
        (theory equation 9.3).

        Args:
            speed: m/s; kink: largest angle of the rigid trace's kinks, rad; sigma: noise of the centre, m.
        """
        return speed >= self.fastest(kink, sigma)

    def fastest(self, kink: float, sigma: float) -> float:
        """The speed below which the tip follows a kink of that angle (rad) within the noise sigma (m), m/s."""
        rate = float(np.sqrt(self.stiffness / self.mass))
        return np.inf if kink == 0.0 else float(rate * sigma / (FOLLOWING_MARGIN * np.tan(kink)))

    def ride(self, height: Callable[[FloatArray], FloatArray], times: FloatArray, force: float) -> Ride:
        """Ride over a rigid trace, ever finer until the gap keeps to the tolerance.

        Args:
            height: of the rigid trace at times (M,) s: (M,) m.
            times: (N,) control instants, s, increasing.
            force: to hold, N.
        """
        share = RIGID_ERROR_SHARE
        ride = self._once(height, times, force, share)
        while ride.error > self.tolerance and share > LEAST_ERROR_SHARE:
            share /= FINER
            finer = self._once(height, times, force, share)
            ride = replace(finer, error=float(np.abs(finer.gap - ride.gap).max(initial=0.0)))
        return ride

    def _once(self, height: Callable[[FloatArray], FloatArray], times: FloatArray, force: float, share: float) -> Ride:
        from hw.simulated.dynamics_kernels import new_out, ride

        corners, heights = refined(height, times, share * self.tolerance)
        sampled = np.isin(corners, times)
        out = new_out(len(corners))
        pieces = ride(corners, heights, sampled, self.mass, self.stiffness, force, self.gain, out)
        return Ride(out[sampled, 0], out[sampled, 1], int(pieces), len(corners))


def refined(
    height: Callable[[FloatArray], FloatArray], times: FloatArray, tolerance: float
) -> tuple[FloatArray, FloatArray]:
    """Corners (M,), the given times among them, and heights (M,) there: between them a straight line is good to the
    tolerance at the middle. All intervals of a generation are halved at once."""
    corners, heights = np.asarray(times, dtype=np.float64), height(times)
    open_ = np.ones(max(0, len(corners) - 1), dtype=bool)
    for _ in range(DEEPEST):
        left = np.flatnonzero(open_)
        if len(left) == 0:
            break
        middle = 0.5 * (corners[left] + corners[left + 1])
        there = height(middle)
        off = np.abs(there - 0.5 * (heights[left] + heights[left + 1])) > tolerance
        off &= (middle > corners[left]) & (middle < corners[left + 1])
        open_[left[~off]] = False
        at = left[off] + 1
        corners, heights = np.insert(corners, at, middle[off]), np.insert(heights, at, there[off])
        open_ = np.insert(open_, at, True)
    return corners, heights
