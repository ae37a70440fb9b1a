"""Slide: sweep along the body under a force sensor, position along the path and force along the approach.

Hybrid law (paper, section 4.2.1): the tangential speed is commanded, the normal force is held in proportion to
its error. It runs on the host and steers the stage in short jogs, each as long as one control period; a jog that
is queued can be thrown away, so the machine stops within a period of being asked.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hw.errors import StoppedError
from hw.force_sensor import ForceSensor
from hw.fusion import positions_at, rigid_centers
from hw.guarded_stage import PATIENCE, GuardedStage
from hw.moves import Move
from hw.peck import spaced

FloatArray = NDArray[np.float64]


# Jogs that may be under way or waiting when the next is made, in control periods
QUEUED = 2.0


@dataclass(frozen=True)
class Slide:
    """How to slide.

    Args:
        sensor: feels the force.
        stiffness: of the tip and all that carries it, N/m.
        period: of the control loop, s.
        approach_speed: at which the body is approached, m/s.
        reach: how far beyond the commanded path to follow the body, m.
        gain: share of the force error that one period takes away; with the stage's delay of two to three
            periods, 0.2 leaves a phase margin of about 60 degrees.
        delay: by how much the force is stamped later than the stage's reports, s (hw.fusion.estimate_delay).
        contact: force above which a sample counts as contact, N.
    """

    sensor: ForceSensor
    stiffness: float
    period: float = 0.01
    approach_speed: float = 2e-3
    reach: float = 2e-3
    gain: float = 0.2
    delay: float = 0.0
    contact: float = 0.1

    def trace(self, stage: GuardedStage, move: Move) -> Iterator[tuple[float, FloatArray, FloatArray]]:
        """(time.monotonic, tip centre (3,), force on the tip (3,) N) at every sample in contact of the sweep."""
        self.sensor.tare()
        path, approach = spaced(move, move.speed * self.period)
        where, hit = stage.probe(path[0] + self.reach * approach[0], self.approach_speed)
        if not hit:
            return
        begun = time.monotonic()
        try:
            self._steer(stage, move, path, approach, float((where - path[0]) @ approach[0]))
        finally:
            if stage.controller.link.is_open and stage.controller.stop_reason is None:
                stage.controller.cancel_jog()
        yield from self._fused(stage, begun)

    def _steer(self, stage: GuardedStage, move: Move, path: FloatArray, approach: FloatArray, depth: float) -> None:
        """Along the path, one jog a period; `depth` (m) behind it along the approach follows the force."""
        controller, trend = stage.controller, 0.0
        here = path[0] + depth * approach[0]
        for point, inwards in zip(path, approach, strict=True):
            missing = move.force - self._pressing(stage, inwards, here, move.speed)
            wanted = self.gain * missing / self.stiffness
            # the slope of the body, learnt as it comes: else a ramp leaves a lasting error
            trend = float(np.clip(trend + 0.03 * wanted, *self._step_limits(stage)))
            depth += float(np.clip(wanted + trend, *self._step_limits(stage)))
            if depth > self.reach:
                raise StoppedError("the tip went too deep behind the commanded path: the body ends, or is elsewhere")
            target = point + depth * inwards
            way = float(np.linalg.norm(target - here))
            if way > 0:
                stage.check(target, "sliding")
                controller.jog(stage.frame.to_machine(target), max(way / self.period, 1e-4))
                here = target

    def _pressing(self, stage: GuardedStage, inwards: FloatArray, here: FloatArray, speed: float) -> float:
        """Force along the approach, N, as soon as at most QUEUED periods of motion are left up to `here`.

        The machine paces the loop: a host that is late makes it stand, never run ahead.
        """
        until = time.monotonic() + PATIENCE
        while np.linalg.norm(stage.position() - here) > QUEUED * speed * self.period:
            if time.monotonic() > until:
                raise StoppedError("the machine does not follow; is it held, or its door open?")
        stage.listen(self.sensor)
        force = stage.frame.turn_to_object(self.sensor.force())
        return -float(force @ inwards)

    def _step_limits(self, stage: GuardedStage) -> tuple[float, float]:
        most = stage.guarded_speed * self.period
        return -most, 0.5 * most

    def _fused(self, stage: GuardedStage, begun: float) -> Iterator[tuple[float, FloatArray, FloatArray]]:
        times, forces = self.sensor.timed(begun)
        reports = [(t, stage.controller.machine_position(status)) for t, status in list(stage.controller.reports)]
        reports = [(t, place) for t, place in reports if t >= begun - 1.0]
        stamps = np.array([t for t, _ in reports])
        places = stage.frame.to_object(np.array([place for _, place in reports]))
        forces = stage.frame.turn_to_object(forces)
        centers = positions_at(times - self.delay, stamps, places)
        touching = (np.linalg.norm(forces, axis=1) > self.contact) & np.isfinite(centers).all(axis=1)
        touching &= times >= begun
        rigid = rigid_centers(centers[touching], forces[touching], self.stiffness)
        yield from zip(times[touching].tolist(), rigid, forces[touching], strict=True)
