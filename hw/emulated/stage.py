"""StageMotion: where an emulated stage is while it carries out its queue of straight segments."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from hw.emulated.touched_body import TouchedBody
from mapping import FloatArray

# A probe that never closes, always is, or closes by itself on a third of its ways
PROBE_FAULTS = ("open", "closed", "bouncing")
BOUNCES = 1 / 3
# What Grbl has prepared of its motion: 5 segments of 10 ms (stepper.h), s
PREPARED = 0.05


@dataclass
class Segment:
    """A straight way.

    Args:
        end: (3,) target, m, machine coordinates.
        speed: m/s.
        kind: "line", "jog" or "probe".
        trigger: (3,) where the probe will close; None where it meets nothing.
    """

    end: FloatArray
    speed: float
    kind: str = "line"
    trigger: FloatArray | None = None


class StageMotion:
    """Runs through segments at their speeds; brakes at a constant deceleration when it is stopped.

    Between segments the speed changes at once (a look-ahead planner without its ramps); a hold, a jog cancel
    and a closing probe brake over v^2 / (2 a), as far as a stop takes on the real machine. A closing probe brakes only
    when what was prepared of the motion has been carried out.

    Args:
        position: (3,) m, machine coordinates.
        acceleration: m/s^2.
        body: what is touched.
    """

    def __init__(self, position: FloatArray, acceleration: float, body: TouchedBody) -> None:
        self.position = np.array(position, dtype=np.float64)
        self.acceleration, self.body = acceleration, body
        self.queue: deque[Segment] = deque()
        self.braking: FloatArray | None = None
        self.travelled = 0.0
        self.moved_at = 0.0
        self.latched: FloatArray | None = None
        self.held = False
        self.probe_fault = ""
        self._rng = np.random.default_rng(1)
        self._time = 0.0
        self._brake_speed = 0.0

    @property
    def busy(self) -> bool:
        """True while anything moves or waits to move."""
        return bool(self.queue) or self.braking is not None

    @property
    def end(self) -> FloatArray:
        """(3,) where the queue ends, m."""
        return self.queue[-1].end if self.queue else self.position

    def add(self, segment: Segment) -> None:
        """Queue a segment; a probing one must find the queue empty."""
        if segment.kind == "probe":
            self.latched = None
            way = segment.end - self.position
            length = float(np.linalg.norm(way))
            reach = self.body.distance(self.position, way / length)
            if self.probe_fault == "bouncing" and self._rng.uniform() < BOUNCES:
                reach = min(reach, self._rng.uniform(0.0, length))
            if reach < length and self.probe_fault != "open":
                segment.trigger = self.position + way * (reach / length)
        self.queue.append(segment)

    def probe_closed(self) -> bool:
        """What the probe's input says."""
        if self.probe_fault in ("open", "closed"):
            return self.probe_fault == "closed"
        return bool(np.any(self.body.force(self.position)))

    def brake(self) -> None:
        """Begin to stop on the present segment, which stays queued."""
        if self.queue and self.braking is None:
            segment = self.queue[0]
            way = segment.end - self.position
            length = float(np.linalg.norm(way))
            prepared = PREPARED if segment.kind == "probe" else 0.0
            stop = segment.speed * prepared + segment.speed**2 / (2.0 * self.acceleration)
            self._brake_speed = stop / (prepared + segment.speed / self.acceleration)  # the mean of both
            stop = min(length, stop)
            self.braking = self.position + (way / length if length > 0 else way) * stop
            if segment.trigger is not None and np.linalg.norm(segment.trigger - self.position) <= stop:
                self.latched = segment.trigger.copy()  # met while braking for another reason

    def stop(self) -> None:
        """Stand still at once: power is cut."""
        self.queue.clear()
        self.braking = None
        self.held = False

    def advance(self, now: float) -> Segment | None:
        """Move on until `now` (s), or until a segment ends or the braking does; the segment that ended."""
        if self.braking is not None:
            if self._run(self.braking, self._brake_speed, now):
                self.braking = None
                if self.queue and self.queue[0].kind == "probe" and self.latched is not None:
                    return self.queue.popleft()
            return None
        if not self.queue or self.held:
            self._time = max(now, self._time)
            return None
        segment = self.queue[0]
        if segment.trigger is not None and self.latched is None:
            if self._run(segment.trigger, segment.speed, now):
                self.latched = self.position.copy()
                self.brake()
            return None
        return self.queue.popleft() if self._run(segment.end, segment.speed, now) else None

    @property
    def time(self) -> float:
        """How far the motion has been carried out, s."""
        return self._time

    def _run(self, goal: FloatArray, speed: float, now: float) -> bool:
        """Towards the goal until `now`; True if it is reached, and then `time` is when it was."""
        way = goal - self.position
        length = float(np.linalg.norm(way))
        needed = length / speed
        if length > 0:
            self.moved_at = min(now, self._time + needed)
        if self._time + needed <= now:
            self.position = goal.copy()
            self.travelled += length
            self._time += needed
            return True
        done = max(0.0, now - self._time) * speed
        if length > 0:
            self.position = self.position + way * (done / length)
        self.travelled += done
        self._time = max(now, self._time)
        return False
