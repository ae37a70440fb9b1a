"""Lag: how much later than the stage's reports a sensor's samples are stamped.

Touching and leaving tells it to half a millisecond (measured_delay). On a tip of 1e4 N/m, while the force changes by
10 N/s, 0.15 ms are 0.15 um, and the width of a wire of 0.65 mm comes out 4 um wrong; so the slide itself tells the rest
(Lag): the surface does not know how hard it is pressed, and what is left of the stage's chatter in the rigid trace is
stage speed times lag.
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from hw import FingerError
from hw.grbl import LONGEST_STANDSTILL, GuardedStage
from hw.probing.fusion import estimate_delay
from hw.sensors import ForceSensor
from mapping import FloatArray
from mapping.instrument import MAD_TO_SD

# The lag is expected to be of this size, s: a stretch without chatter leaves it as it is
EXPECTED = 5e-4
# Second differences over this time, s: the surface is straight over it but for a bend that no chatter follows
SECOND_DIFFERENCE_SPAN = 0.01
# Residuals of more standard deviations are kinks of the surface
KINK = 4.0


@dataclass
class Lag:
    """A running estimate over all batches of samples that were learnt from.

    Args:
        moment: sum of v h / s^2 of second differences along the normal; v speed of the stage, h rigid trace, s its
            residual.
        weight: sum of v^2 / s^2, 1/s^2.
        expected: size of the lag, s: what asking for a report takes, if that is more than EXPECTED.
    """

    moment: float = 0.0
    weight: float = 0.0
    expected: float = EXPECTED

    @property
    def seconds(self) -> float:
        """To be added to the delay with which the batches were fused, s."""
        return self.moment / (self.weight + self.expected**-2)

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
        span = max(1, round(SECOND_DIFFERENCE_SPAN / spacing))
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
            spread = MAD_TO_SD * float(np.median(np.abs(rest))) if len(rest) else 0.0
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


# Longer than any delay that there could be, s
LULL = 0.2
ENOUGH_TOUCHES, TRIES = 5, 12


def measured_delay(
    stage: GuardedStage, sensor: ForceSensor, inwards: FloatArray, stiffness: float, *, press: float = 1.0
) -> tuple[float, float]:
    """Delay and its standard error, s, from five touches of the body before the tip.

    Args:
        stage: the tip stands free, at most a few millimetres before the body.
        inwards: (3,) unit direction towards the body, object frame.
        stiffness: of the tip, N/m.
        press: force to reach, N.

    Raises:
        FingerError: there is no body within 10 mm.
    """
    sensor.tare()
    where, hit = stage.probe(stage.resting() + 0.01 * inwards, 2e-3)
    if not hit:
        raise FingerError("no contact within 10 mm: put the tip before the body first")
    free, low, speed = where - 1e-3 * inwards, where + press / stiffness * inwards, 4e-3
    found = []
    for _ in range(TRIES):
        stage.move(free)
        time.sleep(LULL)
        begun = time.monotonic()
        _follow(stage, low, speed)
        _follow(stage, free, speed)
        time.sleep(LULL)
        reports = stage.controller.reported(begun)
        places = [stage.frame.to_object(stage.controller.machine_position(report.status)) for report in reports]
        heights = [float(place @ -inwards) for place in places]
        times, forces = sensor.timed(begun)
        pressing = -(stage.frame.turn_to_object(forces) @ inwards)
        stamps = np.array([report.asked for report in reports])
        with suppress(ValueError):  # a touch during which a busy host missed the reports says nothing
            found.append(estimate_delay(stamps, np.array(heights), times, pressing, 0.3 * press))
        if len(found) == ENOUGH_TOUCHES:
            break
    if len(found) < ENOUGH_TOUCHES:
        raise FingerError(f"only {len(found)} of {TRIES} touches could be used; is the host too busy?")
    return float(np.median(found)), float(np.std(found) / np.sqrt(len(found)))


def _follow(stage: GuardedStage, target: FloatArray, speed: float) -> None:
    """Jog to the target and ask for the position all the way."""
    stage.controller.jog(stage.frame.to_machine(target), speed)
    stage.controller.wait_idle(LONGEST_STANDSTILL)
