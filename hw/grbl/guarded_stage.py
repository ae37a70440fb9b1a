"""GuardedStage: a controller that moves in the object frame, inside its limits, and feels its way."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from hw import FingerError, LinkError, StoppedError
from hw.grbl.controller import GrblController
from hw.grbl.frame import StageFrame
from hw.sensors import ForceSensor
from mapping import FloatArray

# Shorter ways are not worth a command: the controller refuses to probe towards where it stands
STANDING = 5e-6
# A force sample older than FRESH is not steered by; a sensor silent for LONGEST_SENSOR_SILENCE is taken for lost, s
FRESH, LONGEST_SENSOR_SILENCE = 0.05, 1.0
# How long the machine may stand still in the midst of a motion, s
LONGEST_STANDSTILL = 5.0


@dataclass(eq=False)
class GuardedStage:
    """Positions are tip centres (3,), m, object frame.

    Args:
        controller: an opened one.
        frame: where the object stands on the machine.
        bounds: (2, 3) machine coordinates that the tip centre may take, m.
        speed: of motion through free space, m/s.
        over_travel: how far the tip may run on after contact while it brakes, m: limits the speed of everything
            that may touch.
    """

    controller: GrblController
    frame: StageFrame
    bounds: FloatArray
    speed: float
    over_travel: float
    sensor: ForceSensor | None = None
    touch_force: float = 0.3

    @property
    def guarded_speed(self) -> float:
        """Fastest speed whose braking distance stays within half of the over-travel, m/s."""
        acceleration = np.nanmin(np.append(self.controller.settings.acceleration, np.inf))
        if not np.isfinite(acceleration):
            acceleration = 0.01  # a firmware that does not say: assume a lame one
        return float(min(self.speed, np.sqrt(acceleration * self.over_travel)))

    def position(self) -> FloatArray:
        """Where the tip centre is now."""
        return self.frame.to_object(self.controller.position())

    def check(self, points: FloatArray, what: str) -> None:
        """Refuse points (N, 3) outside of the machine's limits. Raises FingerError."""
        machine = np.atleast_2d(self.frame.to_machine(points))
        outside = ((machine < self.bounds[0] - 1e-9) | (machine > self.bounds[1] + 1e-9)).any(axis=1)
        if outside.any():
            where = np.round(1e3 * machine[outside.argmax()], 3).tolist()
            low, high = np.round(1e3 * self.bounds, 3).tolist()
            raise FingerError(f"the {what} leads to machine position {where} mm; possible are {low} to {high} mm")

    def probe(self, target: FloatArray, speed: float) -> tuple[FloatArray, bool]:
        """Towards the target until contact: (latched position, True), or (target, False) if nothing is met."""
        self.check(target, "probing")
        here = self.position()
        way = float(np.linalg.norm(target - here))
        if way < STANDING:
            return here, False
        speed = min(speed, self.guarded_speed)
        if self.sensor is not None:
            return self._feel(target, speed, self.sensor)
        found = self.controller.probe(self.frame.to_machine(target), speed, _patience(way, speed))
        return self.frame.to_object(found.position), found.hit

    def _feel(self, target: FloatArray, speed: float, sensor: ForceSensor) -> tuple[FloatArray, bool]:
        """Jog until the sensor feels contact; where the machine then came to rest."""
        start = self.position()
        way = float(np.linalg.norm(target - start))
        # a late host makes the machine stand: never is more queued than may be run on into the body
        step = max(0.25 * self.over_travel, STANDING)
        count = int(np.ceil(way / step))
        hit = False
        for number in range(1, count + 1):
            here = start + (target - start) * (number / count)
            made = time.monotonic()
            self.controller.jog(self.frame.to_machine(here), speed)
            hit = self._felt_before(here, 1.5 * way / count, made, sensor)
            if hit:
                break
        if not hit:
            self.controller.wait_idle(LONGEST_STANDSTILL)
            hit = self._touches(sensor)
        self.controller.cancel_jog()
        return self.position(), hit

    def _felt_before(self, here: FloatArray, near: float, made: float, sensor: ForceSensor) -> bool:
        """True as soon as the sensor feels contact, False once the stage is `near` (m) to `here`.

        The force is looked at once at least, however fast the stage was there: on a busy host it always is, and
        would be sent into the body step by step.
        """
        until = time.monotonic() + LONGEST_STANDSTILL
        while True:
            self.listen(sensor, made)
            if self._touches(sensor):
                return True
            if np.linalg.norm(self.position() - here) <= near:
                return False
            if time.monotonic() > until:
                raise LinkError("the machine does not follow; is it held, or its door open?")

    def listen(self, sensor: ForceSensor, since: float = -np.inf) -> None:
        """Go on with a fresh force sample only; meanwhile the machine runs out of jogs and stands.

        Args:
            since: the sample must have come after this, s, time.monotonic: what was done then shows in no older one.

        Raises:
            StoppedError: the sensor stays silent.
        """

        def fresh() -> bool:
            return sensor.age <= FRESH and sensor.heard > since

        if not fresh() and not sensor.wait(fresh, LONGEST_SENSOR_SILENCE):
            self.controller.halt(
                f"no force sample for {sensor.age:.2f} s; check the sensor's cable and power, run again"
            )
            raise StoppedError(self.controller.stop_reason or "stopped")

    def _touches(self, sensor: ForceSensor) -> bool:
        return bool(np.linalg.norm(sensor.force()) > self.touch_force)

    def move(self, target: FloatArray, speed: float | None = None) -> None:
        """Straight to the target, feeling nothing: only away from contact, or where nothing can be."""
        self.check(target, "motion")
        way = float(np.linalg.norm(target - self.position()))
        speed = self.speed if speed is None else min(speed, self.speed)
        if way >= STANDING:
            self.controller.move(self.frame.to_machine(target), speed, _patience(way, speed))

    def go(self, target: FloatArray, away: FloatArray, lift: float, tries: int = 6) -> None:
        """To the target, feeling the way; to a place straight above it, along `away`, if something stands before it.

        Args:
            away: (3,) unit direction that leaves the body.
            lift: how far to back off the first time, m; doubled each time.

        Raises:
            StoppedError: still blocked after `tries`.
        """
        for _ in range(tries):
            start = self.position()
            where, hit = self.probe(target, self.guarded_speed)
            if not hit:
                return
            # back the way it came, which is known to be free, then up; next time it goes over what is there
            back = min(lift, float(np.linalg.norm(where - start)))
            self.move(where - back * (target - start) / np.linalg.norm(target - start))
            self.lift(away, lift)
            target = self._within(target + lift * away)
            lift *= 2.0
        mm = np.round(1e3 * where, 3).tolist()
        raise StoppedError(f"the way is blocked at {mm} mm (object frame); travel round it or lift higher")

    def lift(self, away: FloatArray, distance: float) -> None:
        """Back off along `away`, as far as the limits allow; never feels, so only away from the body."""
        here = self.position()
        self.move(self._within(here + distance * away))

    def _within(self, target: FloatArray) -> FloatArray:
        machine = np.clip(self.frame.to_machine(target), self.bounds[0], self.bounds[1])
        return self.frame.to_object(machine)


def _patience(way: float, speed: float) -> float:
    return 2.0 * way / speed + 3.0
