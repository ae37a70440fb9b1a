"""GuardedStage: a controller that moves in the object frame, inside its limits, and feels its way."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from hw import FingerError, LinkError, NotFeltError, Patience, StoppedError
from hw.grbl.controller import GrblController
from hw.grbl.expected import ExpectedSurface
from hw.grbl.frame import StageFrame
from hw.sensors import LONGEST_SENSOR_SILENCE, ForceSensor
from mapping import FloatArray

# Shorter ways are not worth a command: the controller refuses to probe towards where it stands
STANDING = 5e-6
# A force sample older than this is not steered by, s
FRESH = 0.05
# How long the machine may stand still in the midst of a motion, s
LONGEST_STANDSTILL = 5.0
# What a sensor that froze lets the tip press before it is noticed (SampleWatch.blind), in shares of the force limit:
# with the force of the sweep itself, a fifth of the limit as a rule, and the run-on a quarter is left
BLIND_SHARE = 0.5
# Slower than this no sensor is worth a sweep, m/s: refused with the reason
CRAWL = 1e-4
# The body is approached in steps of this share of what the tip may run on; the next one is sent when QUEUED_STEPS of
# them are left. So a host that hears of the touch late lets the tip run on by 2.5 steps, 0.6 of what it may, at most
STEP_SHARE, QUEUED_STEPS = 0.25, 1.5
# The jogs in which such a rest may be left: the one under way and the next
QUEUED_JOGS = 2
# A lift is queued for so long ahead, s, besides two round trips: a busy host asks twice in it
LIFT_AHEAD = 0.02
# A machine whose cable is pulled carries out what it was told: a long way of probing is told in pieces of so long, s; a
# stop between two takes 0.05 s
LONGEST_BLIND = 2.0
# A probe is closed, or open, if so many reports say so: one may be garbled, a contact may bounce
TOLD = 2
# The tip is free when a step of this length, m, changes the force by less than a touch
FREE_STEP, MOST_FREE_STEPS = 5e-4, 20
# A probe that is closed opens within this of the contact, m, or sticks; it is backed off in steps that double: each
# costs a handful of questions, and 20 equal ones took 5 s
MOST_STUCK = 1e-2
# The latched position lies on the way up to the motors' steps of three axes, and the rounding of the report
LATCH_STEPS = 3.0
# After contact with a touch probe the machine runs on by what it has prepared of its motion, and by its braking
# distance, which firmwares keep to 50 %. On grblHAL's simulator 31 um at 1 mm/s, of which 1 um is braking
BRAKING_DOUBT = 1.5


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
        expected: where the body must have been felt, if that is known.
        stiffness, max_force: of the tip under the sensor, N/m, and the limit, N; 0 and inf: a touch probe.
    """

    controller: GrblController
    frame: StageFrame
    bounds: FloatArray
    speed: float
    over_travel: float
    sensor: ForceSensor | None = None
    touch_force: float = 0.3
    expected: ExpectedSurface | None = None
    stiffness: float = 0.0
    max_force: float = np.inf

    @property
    def guarded_speed(self) -> float:
        """Fastest speed whose braking distance stays within half of the over-travel, m/s.

        With a touch probe all that it runs on by must stay within the whole; under a force sensor no more is prepared
        than was queued, which is less.
        """
        fastest = min(self.speed, np.sqrt(self._acceleration * self.over_travel))
        if self.sensor is None:
            late, slowing = self.controller.prepared, BRAKING_DOUBT / self._acceleration
            fastest = min(fastest, (np.sqrt(late**2 + 2.0 * slowing * self.over_travel) - late) / slowing)
        if self.sensor is not None and self.sensor.watch.blind * self.stiffness > 0:
            fastest = min(fastest, BLIND_SHARE * self.max_force / (self.stiffness * self.sensor.watch.blind))
            if fastest < CRAWL:
                raise FingerError(
                    f"a frozen force sensor would be noticed after {self.sensor.watch.blind:.1f} s only: it is "
                    "too quiet or slow; take out its filter, raise its rate, or take a softer tip"
                )
        return float(fastest)

    def stop_within(self, speed: float) -> float:
        """Way that it takes to brake from a speed, m/s, to a stand, m."""
        return speed**2 / (2.0 * self._acceleration)

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

    def probe(self, target: FloatArray, speed: float, force: float = np.inf) -> tuple[FloatArray, bool]:
        """Towards the target until contact: (latched position, True), or (target, False) if nothing is met.

        Args:
            force: that the touch should not exceed, N, as far as the tip's stiffness tells, however late the host is.
        """
        self.check(target, "probing")
        here = self.resting()
        way = float(np.linalg.norm(target - here))
        if way < STANDING:
            return here, False
        inwards = (target - here) / way
        bound = np.inf if self.expected is None else float(self.expected.bounds(here[None, :], inwards[None, :])[0])
        if bound < way:
            target = here + max(bound, 0.0) * inwards
            if bound < STANDING:
                raise self._not_felt(target)
        speed = min(speed, self.guarded_speed)
        where, hit = (
            self._peck_on(here, target, speed) if self.sensor is None else self._feel(target, speed, self.sensor, force)
        )
        if not hit and bound < way:
            raise self._not_felt(where)
        return where, hit

    def _not_felt(self, where: FloatArray) -> NotFeltError:
        assert self.expected is not None
        return NotFeltError(
            f"nothing was felt {1e3 * self.expected.beyond:.2f} mm beyond the surface of the model, at "
            f"{np.round(1e3 * where, 3).tolist()} mm (object frame): the probe or sensor is dead, or the body is not "
            "where the model has it. Touch the tip and look whether it answers; check origin and turn; pose = "
            '"estimate" finds the pose, beyond in [finger.machine] lets the tip go deeper'
        )

    def _peck_on(self, start: FloatArray, target: FloatArray, speed: float) -> tuple[FloatArray, bool]:
        """Peck, piece by piece where the way is long."""
        count = max(1, int(np.ceil(np.linalg.norm(target - start) / (speed * LONGEST_BLIND))))
        where, hit = start, False
        for number in range(1, count + 1):
            where, hit = self._peck(where, start + (target - start) * (number / count), speed)
            if hit:
                break
        return where, hit

    def _peck(self, start: FloatArray, target: FloatArray, speed: float) -> tuple[FloatArray, bool]:
        """Probe under the controller's own eyes, and judge what it says by where the machine came to rest."""
        if self.closed():
            self._open_by_backing_off(start, target)
            start = self.resting()
        way = float(np.linalg.norm(target - start))
        inwards = (target - start) / way
        step = self.controller.settings.resolution
        for _ in range(TOLD):  # a line that was lost on the way moves nothing: it is said again
            found = self.controller.probe(self.frame.to_machine(target), speed, _patience(way, speed))
            resting = self.resting()
            if found.hit or np.linalg.norm(resting - start) > STANDING:
                break
        if not found.hit:
            left = float(np.linalg.norm(target - resting))
            if left > LATCH_STEPS * step + STANDING:
                self.controller.confirm_offset()
                raise StoppedError(
                    f"the machine stopped {1e3 * left:.3f} mm before the end of its way and met nothing; was it held? "
                    "Run again with --resume"
                )
            return target, False
        where = self.frame.to_object(found.position)
        along = float((where - start) @ inwards)
        aside = float(np.linalg.norm(where - start - along * inwards))
        ran_on = float((resting - where) @ inwards)
        slack = LATCH_STEPS * step
        most = BRAKING_DOUBT * self.stop_within(speed) + self.controller.prepared * speed + slack
        if aside > slack or not -slack <= along <= way + slack or not -slack <= ran_on <= most:
            raise LinkError(
                f"the contact reported at {np.round(1e3 * where, 3).tolist()} mm does not fit to where the machine "
                f"came to rest, {np.round(1e3 * resting, 3).tolist()} mm; the line was garbled: use a shielded cable"
            )
        # one report that says closed is enough: a garbled one leaves the letter out sooner than it makes it
        if ran_on > slack and not any(self.controller.status().probe_closed for _ in range(2 * TOLD)):
            raise StoppedError(
                "the probe closed, and was open again when the machine stood deeper in the body: it bounces, or its "
                "cable picks up noise; check its contacts and shield"
            )
        return where, True

    def resting(self) -> FloatArray:
        """Where the tip centre stands, as two reports in a row tell it."""
        return self.frame.to_object(self.controller.resting_position())

    @contextmanager
    def unbounded(self) -> Iterator[None]:
        """For as long as the block runs the model bounds nothing: the probe has just been seen to live."""
        expected, self.expected = self.expected, None
        try:
            yield
        finally:
            self.expected = expected

    def closed(self) -> bool:
        """True if the probe is closed: if most of the next reports say so."""
        told = [self.controller.status().probe_closed]
        while told.count(True) < TOLD and told.count(False) < TOLD:
            told.append(self.controller.status().probe_closed)
        return told.count(True) >= TOLD

    def _open_by_backing_off(self, start: FloatArray, target: FloatArray) -> None:
        """A probe that is closed before probing begins is in contact: back, the way it was to go."""
        back = (start - target) / np.linalg.norm(start - target)
        here, step, backed_off = self.resting(), FREE_STEP, 0.0
        while backed_off < MOST_STUCK:
            step, backed_off = 2.0 * step, min(backed_off + step, MOST_STUCK)
            self.move(self._within(here + backed_off * back), self.guarded_speed)
            if not self.closed():
                return
        raise StoppedError(
            f"the probe stays closed {1e3 * MOST_STUCK:.0f} mm off the contact: it sticks, is wired "
            "for the other sense ($6), or its cable is broken"
        )

    def free(self, away: FloatArray) -> None:
        """Before the first motion: leave what the tip stands against, along `away`, until nothing changes any more.

        Raises:
            StoppedError: it presses harder that way, or never lets go.
        """
        if self.sensor is None:
            if self.closed():
                here = self.resting()
                self._open_by_backing_off(here, here - away)
            return
        before = self._raw(self.sensor)
        for _ in range(MOST_FREE_STEPS):
            self.move(self._within(self.resting() + FREE_STEP * away), min(self.guarded_speed, FREE_STEP / FRESH))
            after = self._raw(self.sensor)
            pressed = float(self.frame.turn_to_object(after - before) @ away)
            if pressed > self.touch_force:
                raise StoppedError(
                    f"the tip stood in contact, and backing off pressed it by {pressed:.2f} N more; free it by hand"
                )
            if np.linalg.norm(after - before) < self.touch_force:
                return
            before = after
        raise StoppedError("the force changes all the way off the body; is something caught at the tip?")

    def _raw(self, sensor: ForceSensor) -> FloatArray:
        self.listen(sensor, time.monotonic())
        return sensor.force()

    @property
    def _acceleration(self) -> float:
        lowest = float(np.nanmin(np.append(self.controller.settings.acceleration, np.inf)))
        return lowest if np.isfinite(lowest) else 0.01  # a firmware that does not say: assume a lame one

    def creep(self, target: FloatArray) -> None:
        """A step in contact, at the guarded speed; returns when it is made."""
        self.check(target, "pressing")
        self.controller.jog(self.frame.to_machine(target), self.guarded_speed)
        patience, idle, arrived = Patience(LONGEST_STANDSTILL), 0, False
        while not arrived:
            arrived, idle = self.arrived(
                target, self.guarded_speed, max(STANDING, self.controller.settings.resolution), idle
            )
            self.controller.check()
            if patience.over():
                raise LinkError("the machine does not follow; is it held, or its door open?")
        self.controller.wait_idle(LONGEST_STANDSTILL)

    def arrived(self, here: FloatArray, speed: float, near: float, idle: int) -> tuple[bool, int]:
        """Whether the stage is `near` (m) to the place that it was sent to by a jog, and how often it stood elsewhere.

        A jog whose line was lost, or that was thrown away for a touch that was none, is sent again.

        Args:
            speed: of the jog, m/s.
            idle: how often it stood elsewhere before.
        """
        status = self.controller.status()
        place = self.frame.to_object(self.controller.machine_position(status))
        if np.linalg.norm(place - here) <= near:
            self.controller.left(QUEUED_JOGS)
            return True, 0
        idle = idle + 1 if status.state == "Idle" else 0
        if idle > TOLD:
            self.controller.resting_position()  # from where it goes on
            self.controller.jog(self.frame.to_machine(here), speed)
            idle = 0
        return False, idle

    def _feel(self, target: FloatArray, speed: float, sensor: ForceSensor, force: float) -> tuple[FloatArray, bool]:
        """Jog until the sensor feels contact; where the machine then came to rest.

        The thread that reads the sensor cancels the jog: over a slow link the host hears where the machine is only
        after it went on for as long.
        """
        start = self.resting()
        way = float(np.linalg.norm(target - start))
        # a late host makes the machine stand: never is more queued than may be run on into the body
        most = self.over_travel if self.stiffness == 0 else min(self.over_travel, force / self.stiffness)
        step = max(STEP_SHARE * most, STANDING)
        count = int(np.ceil(way / step))
        hit = False
        with sensor.touching(self.touch_force, self.controller.cancel_now):
            for number in range(1, count + 1):
                here = start + (target - start) * (number / count)
                hit = self._felt_before(here, speed, QUEUED_STEPS * way / count, sensor)
                if hit:
                    break
            if not hit:
                self.controller.wait_idle(LONGEST_STANDSTILL)
                hit = self._touches(sensor)
        self.controller.cancel_jog()
        return self.resting(), hit

    def _felt_before(self, here: FloatArray, speed: float, near: float, sensor: ForceSensor) -> bool:
        """Jog on to `here`; True as soon as the sensor feels contact, False once the stage is `near` (m) to it.

        The force is looked at once at least, however fast the stage was there: on a busy host it always is, and
        would be sent into the body step by step.
        """
        patience, made, idle = Patience(LONGEST_STANDSTILL), time.monotonic(), 0
        self.controller.jog(self.frame.to_machine(here), speed)
        while True:
            self.controller.check()
            self.listen(sensor, made)
            if self._touches(sensor):
                return True
            arrived, idle = self.arrived(here, speed, near, idle)
            if arrived:
                return False
            if self._touches(sensor):  # felt, and the jog cancelled, while the position was asked for
                return True
            if patience.over():
                raise LinkError("the machine does not follow; is it held, or its door open?")

    def listen(self, sensor: ForceSensor, since: float = -np.inf) -> None:
        """Go on with a fresh force sample only; meanwhile the machine runs out of jogs and stands.

        Args:
            since: the sample must have come after this, s, time.monotonic: what was done then shows in no older one.

        Raises:
            StoppedError: the sensor stays silent.
        """

        def fresh() -> bool:
            # what was taken after the last motion was sent is new enough, however late it came: nothing moves beyond it
            return sensor.fault is not None or (sensor.heard > since if since > -np.inf else sensor.age <= FRESH)

        if sensor.fault is not None:
            raise StoppedError(sensor.fault)
        if not fresh() and not sensor.wait(fresh, LONGEST_SENSOR_SILENCE):
            self.controller.halt(
                f"no force sample for {sensor.age:.2f} s{sensor.held_up}; check the sensor's cable and power, run again"
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
            start = self.resting()
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
        """Back off along `away`, as far as the limits allow.

        Raises:
            StoppedError: something stands there: the force rises, or the probe that had opened closes again.
        """
        self.controller.wait_idle(LONGEST_STANDSTILL)  # an operator's hold: no jog is taken before it is let go
        start = self.resting()
        target = self._within(start + distance * away)
        if float(np.linalg.norm(target - start)) < STANDING:
            return
        sensor = self.sensor if self.sensor is not None and self.sensor.fault is None else None
        most = self.touch_force + (0.0 if sensor is None else float(np.linalg.norm(sensor.force())))
        opened, met = False, 0
        for here in self._pieces(start, target):
            self.controller.jog(self.frame.to_machine(here), self.guarded_speed)
            left, stood = STANDING if np.array_equal(here, target) else self._run_out, 0
            while stood <= TOLD:
                status = self.controller.status()
                if sensor is not None:
                    met = TOLD if np.linalg.norm(sensor.force()) > most else 0
                elif self.sensor is None:
                    opened = opened or not status.probe_closed
                    met = met + 1 if opened and status.probe_closed else 0
                if met >= TOLD:
                    self.controller.cancel_jog()
                    raise StoppedError("something was met while the tip was lifted off; free it by hand")
                place = self.frame.to_object(self.controller.machine_position(status))
                if np.linalg.norm(place - here) <= left:
                    break
                stood = 0 if status.state == "Jog" else stood + 1
            else:
                self.resting()  # an operator's hold threw the jog away: the next one begins here
        self.controller.wait_idle(LONGEST_STANDSTILL)

    def _pieces(self, start: FloatArray, target: FloatArray) -> Iterator[FloatArray]:
        """Ends of the jogs to a target: short ones, for what is queued runs out when the cable is pulled."""
        count = int(np.ceil(np.linalg.norm(target - start) / self._run_out))
        for number in range(1, count):
            yield start + (target - start) * (number / count)
        yield target

    @property
    def _run_out(self) -> float:
        """What may be queued of a lift, m: what lasts as long as asking where the machine is, and its stop."""
        lasts = LIFT_AHEAD + 2.0 * self.controller.round_trip
        return max(self.guarded_speed * lasts + self.stop_within(self.guarded_speed), STANDING)

    def _within(self, target: FloatArray) -> FloatArray:
        machine = np.clip(self.frame.to_machine(target), self.bounds[0], self.bounds[1])
        return self.frame.to_object(machine)


def _patience(way: float, speed: float) -> float:
    return 2.0 * way / speed + 3.0
