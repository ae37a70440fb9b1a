"""Press test: does the force rise as the stage presses, with the right sign and about the stiffness that was stated?

A force that is read ten times too small lets the machine press ten times too hard, a wrong sign lets it press on for
ever, and a zero that drifted is a contact in mid-air. One step into the body tells all of them.
"""

from __future__ import annotations

import time

import numpy as np

from hw import StoppedError
from hw.grbl import GuardedStage
from hw.sensors import ForceSensor
from mapping import FloatArray

# Force that the step should add, N: 100 times the noise of usual sensors (3 mN, of which 20 samples are averaged)
STEP_FORCE = 0.5
# Of the force limit at most this share is added: with the touch before it (0.3 N read, ten times that if the gain is a
# tenth) the limit is not reached
MOST_OF_LIMIT = 0.3
# The step is at least so many steps of the motors: their rounding then makes 20 % of error at most
LEAST_STEPS = 5.0
# The ratio of the rise to the stated stiffness: a tip on a flank of 60 degrees feels a half, the rounding 20 %, the
# stated stiffness may be wrong by 20 %; a gain of 10 is far off
LEAST_RATIO, MOST_RATIO = 0.4, 2.5
# The forces before and after are means over so long, s: 20 samples of 1 kHz, 2 of 100 Hz; the first wait is for the tip
# to come to rest, five periods of 50 Hz
AVERAGED, AT_REST = 0.02, 0.1


def press_test(
    stage: GuardedStage, sensor: ForceSensor, inwards: FloatArray, stiffness: float, wanted: float = np.inf
) -> float:
    """Press one small step further, or back where that would exceed `wanted`; the stiffness found, N/m.

    The tip stays pressed.

    Args:
        stage: the tip stands in contact.
        inwards: (3,) unit direction into the body, object frame.
        stiffness: of the tip and what carries it, as stated, N/m.
        wanted: force of the sweep that follows, N.

    Raises:
        StoppedError: the force does not rise, falls, or rises with another stiffness.
    """
    step = min(STEP_FORCE, MOST_OF_LIMIT * stage.max_force) / stiffness
    step = max(
        step, min(LEAST_STEPS * stage.controller.settings.resolution, MOST_OF_LIMIT * stage.max_force / stiffness)
    )
    before, start = _mean_force(stage, sensor), stage.resting()
    pressed, more = float(np.linalg.norm(before)), step * stiffness
    inwards = -inwards if pressed + more > wanted and pressed > more else inwards  # back, but not out of contact
    stage.creep(start + step * inwards)
    after, way = _mean_force(stage, sensor), float((stage.resting() - start) @ inwards)
    change = after - before
    rise = float(np.copysign(np.linalg.norm(change), -(change @ inwards)))
    found = rise / max(way, 1e-9)
    if not LEAST_RATIO <= found / stiffness <= MOST_RATIO:
        reason = (
            f"press test: over {1e6 * way:.0f} um in contact the force changed by {rise:+.2f} N, {1e-3 * found:.2f} "
            f"N/mm; stated are {1e-3 * stiffness:.2f} N/mm. {_cause(found / stiffness)}"
        )
        stage.controller.halt(reason)
        raise StoppedError(reason)
    return found


def _cause(ratio: float) -> str:
    if ratio < -LEAST_RATIO:
        return "The sign of the sensor's axis is wrong: turn it round (its axes are those of the force on the tip)"
    if abs(ratio) < 0.1:
        return "Nothing is felt: the contact was none, the zero drifted, or the sensor does not carry the tip"
    return "Check the sensor's sensitivity (counts_per_newton) and the stiffness in [finger.sensor]"


def _mean_force(stage: GuardedStage, sensor: ForceSensor) -> FloatArray:
    """(3,) mean force at rest, N, object frame."""
    time.sleep(AT_REST)
    since = time.monotonic() - AVERAGED
    stage.listen(sensor, since + AVERAGED)
    _, forces = sensor.timed(since)
    return stage.frame.turn_to_object(np.mean(forces if len(forces) else sensor.force()[None, :], axis=0))
