"""Lag: how much later than the stage's reports the force is stamped, learnt from the surface itself while sliding.

A touch tells the delay to half a millisecond (hw/delay.py); on a tip of 1e4 N/m, while the force changes by 10 N/s,
0.15 ms are 0.15 um, and the width of a wire of 0.65 mm comes out 4 um wrong. But the surface does not know how hard
it is pressed: what is left of the stage's chatter in the rigid trace is stage speed times lag.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# The lag is expected to be of this size, s: a stretch without chatter leaves it as it is
EXPECTED = 5e-4
# Second differences over this time, s: the surface is straight over it but for a bend that no chatter follows
SPAN = 0.01
# Residuals of more standard deviations are kinks of the surface
KINK = 4.0


@dataclass
class Lag:
    """A running estimate over all batches of samples that were learnt from.

    Args:
        moment: sum of v h / s^2 of second differences along the normal; v speed of the stage, h rigid trace, s its
            residual.
        weight: sum of v^2 / s^2, 1/s^2.
    """

    moment: float = 0.0
    weight: float = 0.0

    @property
    def seconds(self) -> float:
        """To be added to the delay with which the batches were fused, s."""
        return self.moment / (self.weight + EXPECTED**-2)

    def learn(self, times: FloatArray, positions: FloatArray, rigid: FloatArray, normals: FloatArray) -> None:
        """Learn from consecutive samples of one sweep.

        Args:
            times: (N,) s.
            positions: (N, 3) of the stage at these times by the delay known before, m.
            rigid: (N, 3) centres with what the tip yields put back, m.
            normals: (N, 3) outward unit normals of the contact.
        """
        if len(times) < 3:
            return
        spacing = float(np.median(np.diff(times)))
        span = max(1, round(SPAN / spacing))
        if len(times) < 3 * span:
            return
        speeds = np.gradient(positions, times, axis=0)
        even = np.abs(times[2 * span :] - times[: -2 * span] - 2 * span * spacing) < 0.5 * spacing
        chatter, height = (
            np.einsum("ij,ij->i", _bend(values, span), normals[span:-span])[even] for values in (speeds, rigid)
        )
        slope = 0.0
        for _ in range(3):
            rest = height - slope * chatter
            spread = 1.4826 * float(np.median(np.abs(rest))) if len(rest) else 0.0
            use = np.abs(rest) <= KINK * spread
            power = float(chatter[use] @ chatter[use])
            if spread == 0.0 or power == 0.0:
                return
            slope = float(chatter[use] @ height[use]) / power
        # samples within a span share their errors
        self.weight += power / (span * spread**2)
        self.moment += slope * power / (span * spread**2)


def _bend(values: FloatArray, span: int) -> FloatArray:
    """(N - 2 span, 3) values less the mean of those `span` samples before and after."""
    return np.asarray(values[span:-span] - 0.5 * (values[2 * span :] + values[: -2 * span]))
