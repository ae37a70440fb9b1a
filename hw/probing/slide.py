"""Slide: sweep along the body under a force sensor, position along the path and force along the approach.

Hybrid law (paper, section 4.2.1): the tangential speed is commanded, the normal force is held in proportion to
its error. It runs on the host and steers the stage in short jogs, each as long as one control period; a jog that
is queued can be thrown away, so the machine stops within a period of being asked.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from hw import LinkError, Move, Patience, StoppedError, UntrueForceError
from hw.grbl import LONGEST_STANDSTILL, GuardedStage
from hw.probing.fusion import (
    JUDGED_BY,
    OFF_THE_LINE_STEPS,
    known_at,
    no_spikes,
    on_the_way,
    places_at,
    progress_at,
    prompt,
    rigid_centers,
    rows_at,
)
from hw.probing.lag import EXPECTED, Lag
from hw.probing.peck import Touched, spaced
from hw.probing.press_test import press_test
from hw.probing.zero import ZeroLine, ZerosMoved
from hw.sensors import FREE_AIR, ForceSensor
from mapping import BoolArray, FloatArray

# Jogs that may be under way or waiting when the next is made, in control periods; and less where the way that it takes
# to brake, with what is made in one period more, is shorter: a planner keeps up its speed with no more (Grbl,
# jogging.md), and what is queued runs out when the cable is pulled
QUEUED = 2
# So many of the last ways sent hold the place of the machine: those queued, the next, and one for a report on its way
RECENT_WAYS = QUEUED + 2
# Of the reports at least this share must lie on the way that the machine was sent; at 1 % of garbled bytes 90 % do
ON_THE_WAY = 0.5
# Over a slow link a jog lasts this share of a round trip: the force is heard of once in a round trip, and the machine
# must neither stand for most of it, nor go on for long over what it has not felt. At 20 ms of latency and 115200 baud
# (30 ms a round trip) 4 mm at 10 mm/s take 1.2 s; with jogs of 10 ms they took 1.7 s
LINK_SHARE = 0.5
# The touch at the beginning may have so many times the force of the sweep: 0.6 of it are run on by (STEP_SHARE)
GENTLE = 1.5
# Samples are handed on this often, s
BATCH = 0.5
# Share of the wanted force that may be missing, or too much, at full tangential speed; and the slowest pace
EASE, SLOWEST = 0.25, 0.1
# A sweep begins when the force is this near to the wanted one, in its share, or after so many control periods
SETTLED_FORCE_SHARE, SETTLING = 0.2, 50
# Reports from so long before the samples are looked at: the last one may be that old, s
BEFORE = 0.1
# A body presses, it never pulls: friction at a steep side may, by less than this share of the force (0.5 on steel)
PULL = 0.6
# The zero may be wrong by this, as a displacement of the tip, during one sweep, m: its samples are off by as much
ZERO_MOVED = 1.5e-5
# A zero that seems to drift is listened to for so long, s. At 1 kHz and 5 mN of noise 0.2 s tell a drift to 6 mN/s (sd
# of a component): over a sweep of 8 s a third of what is refused, which chance exceeds once in 50 sweeps. 1 s tells it
# to 0.5 mN/s
SURE_FREE_AIR = 1.0
# What was felt so long before a stop may be wrong already, s: two requests for a status
HELD_BACK = 0.1
# A sweep takes longer than its path: touching, pressing, steep flanks, a host that is busy otherwise, s
SWEEP_OVERHEAD = 3.0
# A path of one point is touched for so many control periods
DWELL = 10


@dataclass
class _Sent:
    """Where a sweep sent the stage: when, s, to which place (3,), m, which lies how far along its path."""

    times: list[float]
    ends: list[FloatArray]
    along: list[float]

    def add(self, when: float, end: FloatArray, along: float) -> None:
        self.times.append(when)
        self.ends.append(end)
        self.along.append(along)


@dataclass(frozen=True)
class Slide:
    """How to slide.

    Args:
        sensor: feels the force.
        stiffness: of the tip and all that carries it, N/m.
        period: of the control loop, s; longer over a slow link (LINK_SHARE).
        approach_speed: at which the body is approached, m/s.
        reach: how far beyond the commanded path to follow the body, m.
        gain: share of the force error that one period takes away; with the stage's delay of two to three
            periods, 0.2 leaves a phase margin of about 60 degrees.
        delay: by how much the force is stamped later than the stage's reports, s (hw.probing.fusion.estimate_delay).
        contact: force above which a sample counts as contact, N.
        lag: what of the delay is left, learnt from one batch of samples to the next.
        zeros: by how much the sensor's zero has moved in the sweeps so far.
    """

    sensor: ForceSensor
    stiffness: float
    period: float = 0.01
    approach_speed: float = 2e-3
    reach: float = 2e-3
    gain: float = 0.2
    delay: float = 0.0
    contact: float = 0.05
    lag: Lag = field(default_factory=Lag)
    zeros: ZerosMoved = field(default_factory=ZerosMoved)

    def trace(self, stage: GuardedStage, move: Move) -> Iterator[Touched]:
        """Samples in contact with their forces, about every BATCH seconds; what was felt before a stop as well."""
        self._tare(stage, move.duration + SWEEP_OVERHEAD)
        self.sensor.watch.steepest = self.stiffness * max(move.speed, stage.guarded_speed)
        period = max(self.period, LINK_SHARE * stage.controller.round_trip)
        path, approach = spaced(move, move.speed * period)
        _, hit = stage.probe(path[0] + self.reach * approach[0], self.approach_speed, GENTLE * move.force)
        if not hit:
            return
        press_test(stage, self.sensor, approach[0], self.stiffness, move.force)
        here = stage.resting()
        last = told = time.monotonic()
        sent = _Sent([last], [here], [0.0])
        try:
            for sliding in self._steer(stage, move, path, approach, sent, period):
                if not sliding:
                    last = time.monotonic()  # what the tip feels while it settles is no sweep
                elif time.monotonic() > told + BATCH:
                    told = time.monotonic()
                    batch = self._fused(stage, approach, sent, period, last, told - self.sensor.watch.blind)
                    if len(batch.times):
                        last = float(batch.times[-1])
                        yield batch
        except (StoppedError, LinkError):
            yield self._fused(stage, approach, sent, period, last, time.monotonic() - HELD_BACK)
            raise
        finally:
            if stage.controller.link.is_open and stage.controller.stop_reason is None:
                stage.controller.cancel_jog()
        yield self._fused(stage, approach, sent, period, last)

    def _tare(self, stage: GuardedStage, duration: float) -> None:
        """Take the zero anew; in free air it must be about where it was, and stay there for the next sweep.

        What would end the run is listened to again for longer first: of a moment's noise a drift is made by chance.
        """
        before = self.sensor.zeroed
        most = max(ZERO_MOVED * self.stiffness, stage.touch_force / 2.0)
        for listening in (FREE_AIR, SURE_FREE_AIR):
            self.sensor.tare(listening)
            assert self.sensor.zeroed is not None
            moved = 0.0 if before is None else ZeroLine(before, self.sensor.zeroed).moved
            drift = float(np.linalg.norm(self.sensor.zeroed.drift)) * duration
            if max(moved, drift) <= most:
                return
        what = (
            f"moved by {moved:.2f} N since the last sweep"
            if moved > most
            else f"drifts by {drift / duration:.2f} N/s while nothing touches, "
            f"{1e6 * drift / self.stiffness:.0f} um of the tip during one sweep"
        )
        reason = f"the sensor's zero {what}: let it warm up, or look what hangs on it"
        stage.controller.halt(reason)
        raise StoppedError(reason)

    def settled(self, stage: GuardedStage, felt: Sequence[Touched]) -> list[Touched]:
        """What a sweep felt, once the tip is in free air again: less what the zero has moved meanwhile.

        Raises:
            StoppedError: it moved so that nobody knows how far the samples are off.
            LinkError: no samples.
        """
        before, after = self.sensor.zeroed, self.sensor.free_air()
        assert before is not None
        line = ZeroLine(before, after)
        self.sensor.zeroed = after  # the next sweep's zero is held against this one
        if line.doubt > ZERO_MOVED * self.stiffness:
            raise StoppedError(
                f"the sensor's zero moved by {line.moved:.2f} N during the sweep, nobody knows when: its samples may "
                f"be {1e6 * line.doubt / self.stiffness:.0f} um off and are left out; let the sensor warm up, look "
                "what hangs on it, run again with --resume"
            )
        self.zeros.learn(line)
        settled = []
        for batch in felt:
            assert batch.forces is not None
            moved = stage.frame.turn_to_object(line.offsets(batch.times) @ self.sensor.turned.T)
            settled.append(Touched(batch.times, batch.centers - moved / self.stiffness, batch.forces - moved))
        return settled

    def _steer(
        self, stage: GuardedStage, move: Move, path: FloatArray, approach: FloatArray, sent: _Sent, period: float
    ) -> Iterator[bool]:
        """Along the path, one jog a `period` (s); a depth behind it along the approach follows the force.

        Each period says whether the sweep has begun.
        """
        controller, trend = stage.controller, 0.0
        depth = float((sent.ends[0] - path[0]) @ approach[0])
        ahead = stage.stop_within(move.speed) + move.speed * period
        here, at, end = path[0] + depth * approach[0], 0.0, len(path) - 1.0
        queued = [0.0] * QUEUED  # lengths of the last jogs
        settling = SETTLING  # periods to press on before the sweep begins
        left = 0 if end > 0 else DWELL
        bounds = np.full(len(path), np.inf) if stage.expected is None else stage.expected.bounds(path, approach)
        made = time.monotonic()  # when the last jog was sent
        while True:
            inwards = _between(approach, at)
            inwards /= np.linalg.norm(inwards)
            pressing = self._pressing(stage, inwards, here, min(sum(queued), ahead), made)
            if pressing < -max(PULL * move.force, 0.5 * stage.touch_force):
                raise UntrueForceError(
                    f"the force pulls the tip by {-pressing:.2f} N where a body can only press: the sensor's sign "
                    "turned or its zero jumped; check its cable, run again"
                )
            missing = move.force - pressing
            settling = 0 if abs(missing) <= SETTLED_FORCE_SHARE * move.force else max(0, settling - 1)
            pace = 0.0 if settling else _pace(missing / move.force)
            at = min(end, at + pace)
            wanted = self.gain * missing / self.stiffness
            # the slope of the body, learnt as it comes: else a ramp leaves a lasting error
            trend = float(np.clip(trend + 0.03 * pace * wanted, *_step_limits(stage, period)))
            depth += float(np.clip(wanted + pace * trend, *_step_limits(stage, period)))
            if depth > self.reach:
                raise StoppedError("the tip went too deep behind the commanded path: the body ends, or is elsewhere")
            if depth > max(bounds[int(at)], bounds[int(np.ceil(at))]):
                raise UntrueForceError(
                    f"the tip sank {1e3 * stage.expected.beyond if stage.expected else 0.0:.2f} mm below the surface "
                    "of the model without the force that belongs to it: the sensor's zero or gain drifted, or the body "
                    "is lower there; check both, or set beyond in [finger.machine]"
                )
            target = _between(path, at) + depth * inwards
            way = float(np.linalg.norm(target - here))
            if way > 0:
                stage.check(target, "sliding")
                controller.jog(stage.frame.to_machine(target), max(way / period, 1e-4))
                made = time.monotonic()
                sent.add(made, target, at)
                here, queued = target, [*queued[1:], way]
            yield not settling
            if at >= end and not settling:
                if left == 0:
                    return
                left -= 1

    def _pressing(
        self, stage: GuardedStage, inwards: FloatArray, here: FloatArray, queued: float, made: float
    ) -> float:
        """Force along the approach, N, as soon as at most `queued` metres of motion are left up to `here`.

        The machine paces the loop: a host that is late makes it stand, never run ahead. No force counts twice: a
        loop that goes on with what it felt before its last jog (`made`, s) would press deeper without feeling it.
        """
        patience = Patience(LONGEST_STANDSTILL)
        left = max(queued, 1.5 * stage.controller.settings.resolution)
        arrived, idle = False, 0
        while not arrived:
            arrived, idle = stage.arrived(here, stage.guarded_speed, left, idle)
            stage.controller.check()
            if patience.over():
                raise StoppedError("the machine does not follow; is it held, or its door open?")
        stage.listen(self.sensor, made)
        force = stage.frame.turn_to_object(self.sensor.force())
        return -float(force @ inwards)

    def _fused(
        self, stage: GuardedStage, approach: FloatArray, sent: _Sent, period: float, after: float, until: float = np.inf
    ) -> Touched:
        """Samples in contact taken between these times, as far as the stage has reported where it was.

        It was sent along a way every `period` (s). A sample that pulls where a body can only press is none.
        """
        reports = prompt(stage.controller.reported(after - BEFORE))
        nothing = Touched(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
        if len(reports) < 2:
            return nothing
        came = np.array([report.at for report in reports])
        stamps = np.array([report.asked for report in reports])
        doubts = came - stamps - stage.controller.shortest_round_trip
        places = stage.frame.to_object(
            np.array([stage.controller.machine_position(report.status) for report in reports])
        )
        off = OFF_THE_LINE_STEPS * stage.controller.settings.resolution
        good, ways = on_the_way(
            came,
            places,
            np.array(sent.times),
            np.array(sent.ends),
            np.array(sent.along),
            queued=RECENT_WAYS,
            off=off,
        )
        if np.mean(good) < ON_THE_WAY:
            raise StoppedError(
                f"{np.sum(~good)} of {len(good)} reports of the machine's place lie more than {1e6 * off:.0f} um off "
                "the way that it was sent: check its cable, and whether another program or a pendant steers it"
            )
        if np.sum(good) < 2:
            return nothing
        stamps, places, doubts, ways = stamps[good], places[good], doubts[good], ways[good]
        ends = np.array(sent.ends)
        # it goes by steps of its motors: where they were aside of the way, they are likely to be between two reports
        aside = places - places_at(ways, ends)
        # with those that the first ones are judged by
        times, forces = self.sensor.timed(after - BEFORE - JUDGED_BY * self.sensor.watch.spacing)
        whole = no_spikes(forces, np.abs(self.sensor.turned) @ self.sensor.watch.noise)
        times, forces = times[whole], forces[whole]
        forces = stage.frame.turn_to_object(forces)
        pressing = np.linalg.norm(forces, axis=1)
        normals = forces / np.maximum(pressing, self.contact)[:, None]
        rows = np.interp(times, sent.times, sent.along)
        inwards = np.column_stack([np.interp(rows, np.arange(len(approach)), column) for column in approach.T])
        presses = np.einsum("ij,ij->i", forces, inwards) < PULL * pressing
        # what a step of the motors hides anyway
        apart = stage.controller.settings.resolution

        def touching(delay: float) -> tuple[BoolArray, FloatArray]:
            progress = progress_at(times - delay, stamps, doubts, ways, period)
            sound = presses & (pressing > self.contact) & (times > after) & (times < until)
            centers = places_at(progress.likely, ends) + rows_at(times - delay, stamps, aside)
            return sound & known_at(progress, ends, normals, apart), centers

        self.lag.expected = max(EXPECTED, stage.controller.round_trip)
        sound, centers = touching(self.delay)
        rigid = rigid_centers(centers[sound], forces[sound], self.stiffness)
        self.lag.learn(times[sound], centers[sound], rigid, normals[sound])
        sound, centers = touching(self.delay + self.lag.seconds)
        rigid = rigid_centers(centers[sound], forces[sound], self.stiffness)
        return Touched(times[sound], rigid, forces[sound])


def _step_limits(stage: GuardedStage, period: float) -> tuple[float, float]:
    """How far one jog may lead out of the body and into it, m."""
    most = stage.guarded_speed * period
    return -most, 0.5 * most


def _between(rows: FloatArray, at: float) -> FloatArray:
    """(3,) at a fractional row number."""
    low = min(int(at), len(rows) - 1)
    high = min(low + 1, len(rows) - 1)
    return np.asarray(rows[low] + (at - low) * (rows[high] - rows[low]))


def _pace(error: float) -> float:
    """Share of the tangential speed at a force error, in wanted forces: a steep flank is taken slowly.

    At full speed the tip would fly off behind a ridge, and be pressed hard in front of it, since the force
    follows the body only as fast as the guarded speed lets it.
    """
    spare = max(0.0, 1.0 - abs(error)) / (1.0 - EASE)
    return float(np.clip(spare**2, SLOWEST, 1.0))
