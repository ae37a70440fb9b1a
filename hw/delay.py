"""Delay: how much later a sensor's samples are stamped than the stage's reports, measured by touching and leaving."""

from __future__ import annotations

import time
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from hw.errors import FingerError
from hw.force_sensor import ForceSensor
from hw.fusion import estimate_delay
from hw.guarded_stage import PATIENCE, GuardedStage

# Longer than any delay that there could be, s
LULL = 0.2
ENOUGH, TRIES = 5, 12

FloatArray = NDArray[np.float64]


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
    where, hit = stage.probe(stage.position() + 0.01 * inwards, 2e-3)
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
        stamps = np.array([report.at for report in reports])
        with suppress(ValueError):  # a touch during which a busy host missed the reports says nothing
            found.append(estimate_delay(stamps, np.array(heights), times, pressing, 0.3 * press))
        if len(found) == ENOUGH:
            break
    if len(found) < ENOUGH:
        raise FingerError(f"only {len(found)} of {TRIES} touches could be used; is the host too busy?")
    return float(np.median(found)), float(np.std(found) / np.sqrt(len(found)))


def _follow(stage: GuardedStage, target: FloatArray, speed: float) -> None:
    """Jog to the target and ask for the position all the way."""
    stage.controller.jog(stage.frame.to_machine(target), speed)
    stage.controller.wait_idle(PATIENCE)
