"""ForceSensor: a three-axis force sensor behind a serial port; samples with their times, and a guard."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import takewhile
from types import TracebackType
from typing import Any

import numpy as np

from hw import Framing, Link, LinkError, Patience
from hw.sensors.clock import SensorClock, missing, unwrapped
from hw.sensors.watch import SampleWatch
from mapping import FloatArray, IntArray
from mapping.instrument import MAD_TO_SD

# In free air a sensor is listened to for so long, s
FREE_AIR = 0.2
# A sensor silent for so long is taken for lost, s
LONGEST_SENSOR_SILENCE = 1.0
# A reading thread that is held up is waited for so much longer, s: with the second above pauses of 3 s are survived,
# and giving up takes less than 5 s
LONGEST_HELD_UP = 2.5
# Samples that are kept: a minute at 5 kHz
KEPT_SAMPLES = 300_000
# Samples of a fast sensor are taken together for so long, s: to be woken for each packet takes more than what is done
# then. Longer, where the tip cannot be moved fast enough to reach what the machine is stopped at meanwhile: but a force
# is steered by every 10 ms as a rule, and should not be older than half of that
GATHER, LONGEST_GATHER = 0.002, 0.005
# if they are more than so many
WORTH_GATHERING = 4
# Before the samples asked for, the clock is known by those of so many seconds
HISTORY = 10.0
# The least delay of a sample is that of the last one to two blocks of so long, s: a clock that is 1 % off what is known
# of it is then 20 ms off at most, less than the 50 ms after which a sample is not steered by
DELAY_BLOCK = 1.0
# So many standard deviations off the median no sample of free air is noise; an even drift alone reaches 1.35 of them
OFF_FREE_AIR = 8.0
# A host may hold back samples for 0.1 s: over so many s that makes the sensor's period uncertain by 2 %
PERIOD_SPAN = 5.0


@dataclass(frozen=True, eq=False)
class FreeAir:
    """What a sensor says while nothing touches.

    Args:
        at: time.monotonic, s.
        force: (3,) N, in its own axes.
        drift: (3,) N/s.
    """

    at: float
    force: FloatArray
    drift: FloatArray


class ForceSensor:
    """Common to all sensors; a device adds its framing, `decode` and `start`.

    Forces are those on the tip, N. `force` and `timed` give them in the axes of the machine that carries the sensor,
    `zero` and `recorded` in its own; `turned` (3, 3) turns its axes into the machine's.

    Args:
        port: device name or pyserial URL.
        framing: of the device's stream.
        rate: samples per second that it is told or known to send.
        bits: width of its counter or clock.
        tick: nominal s per count of that; None: a count per sample.
        baudrate: of the port.
    """

    name = "force sensor"

    def __init__(
        self, port: str, framing: Framing, *, rate: float, bits: int, tick: float | None = None, baudrate: int
    ) -> None:
        self._gathers = rate * GATHER > WORTH_GATHERING
        self.link = Link(port, framing, self._hear, baudrate=baudrate, lost=self._on_lost)
        self.link.gather = GATHER if self._gathers else 0.0
        self.rate, self.bits = rate, bits
        self.tick = 1.0 / rate if tick is None else tick
        self.zero = np.zeros(3)
        self.zeroed: FreeAir | None = None
        self.turned = np.eye(3)
        self._samples: deque[tuple[float, int, float, float, float]] = deque(maxlen=KEPT_SAMPLES)
        self._limit = np.inf
        self._halt: Callable[[str], None] = _nothing
        self._news = threading.Condition()
        self.faulty = 0
        self.held_up = ""  # words of the last wait in vain, if this program could not look meanwhile
        self.fault: str | None = None
        self._struck = False
        self._touch, self._touched = np.inf, _nothing_more
        self.watch = SampleWatch(bits)
        self._period = self.tick
        self._newest = -np.inf
        self._least = [np.inf, np.inf]  # delay by the sensor's own clock, of the block before this one and of this one
        self._block_ends = -np.inf

    def decode(self, frame: bytes) -> tuple[int, float, float, float] | None:
        """Count and force (N) in a frame; None if the sensor says that it is not to be trusted."""
        raise NotImplementedError(f"{type(self).__name__} reads no frames")

    def decode_all(self, frames: list[bytes]) -> tuple[IntArray, FloatArray] | None:
        """Counts (N,) and forces (N, 3), N, in frames that came together; None if one is not to be trusted.

        A device whose frames can be read at once does better than to decode each of them.
        """
        samples = [self.decode(frame) for frame in frames]
        whole = [sample for sample in samples if sample is not None]
        if len(whole) < len(samples):
            return None
        table = np.array(whole, dtype=np.float64)  # counts of up to 53 bits are exact
        return table[:, 0].astype(np.int64), table[:, 1:]

    def start(self) -> None:
        """Tell the device to send."""

    def guard(self, limit: float, halt: Callable[[str], None]) -> None:
        """From now on call `halt`, in the reading thread, if a force exceeds `limit` (N) or is none (SampleWatch)."""
        self._limit, self._halt, self._struck = limit, halt, False

    @contextmanager
    def touching(self, force: float, touched: Callable[[], None]) -> Iterator[None]:
        """While the block runs, call `touched` in the reading thread for samples above `force` (N).

        Stopping there saves asking the machine where it is first, which takes as long as its link does.
        """
        self._touch, self._touched = force, touched
        try:
            yield
        finally:
            self._touch, self._touched = np.inf, _nothing_more

    def __enter__(self) -> ForceSensor:
        from hw.sensors.sample_kernels import load_sample_kernels

        load_sample_kernels()
        self.link.open()
        try:
            self.start()
            if not self.wait(self.fresh, 2.0):
                raise LinkError(
                    f"{self.link.port}: no samples from the {self.name} within 2 s; is it powered, is the baud rate "
                    f"right? It sent {self.link.counters}"
                )
        except BaseException:
            self.link.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.link.close()

    def reconnect(self, within: float) -> bool:
        """Try for some seconds to get back a sensor that was lost; True if it sends again. Tare it anew."""
        self._samples.clear()
        self.watch.forget()
        self.fault, self._struck, self.zeroed = None, False, None
        self._newest, self._least = -np.inf, [np.inf, np.inf]
        if not self.link.reopen(within):
            return False
        self.start()
        return self.wait(self.fresh, 2.0)

    @property
    def info(self) -> dict[str, Any]:
        """Kind, port, rate, counters, clock."""
        ticks, arrivals, _ = self.recorded()
        record = {"kind": self.name, "port": self.link.port, "rate": self.rate, "faulty": self.faulty}
        if len(ticks):
            clock = SensorClock.estimate(ticks.astype(float), arrivals, self.tick)
            record |= {"period": clock.period, "jitter": clock.jitter, "missing": missing(ticks)}
        return record | {"link": self.link.counters}

    @property
    def age(self) -> float:
        """Time since the newest sample was taken, s, by the sensor's own clock: old ones may still be arriving."""
        return time.monotonic() - self.heard

    @property
    def heard(self) -> float:
        """When the newest sample was taken, s, time.monotonic, but for its least delay; -inf before the first."""
        return self._newest

    def fresh(self) -> bool:
        """True if there is a sample at all."""
        return bool(self._samples)

    def force(self) -> FloatArray:
        """(3,) newest force, N."""
        newest = np.array(self._samples[-1][2:]) - self.zero if self._samples else np.zeros(3)
        return np.asarray(self.turned @ newest)

    def wait(self, done: Callable[[], bool], within: float) -> bool:
        """Wait for samples until `done`; False if that took too long.

        Only time in which the reading thread had its turns is the sensor's silence. What it has not read while this
        program was held up is not waited for beyond LONGEST_HELD_UP more.
        """
        begun, patience, late = self.link.listened, Patience(within), Patience(within + LONGEST_HELD_UP)
        with self._news:
            while not self._news.wait_for(done, timeout=min(0.05, within)):
                unread = within - self.link.listened + begun if self.link.is_open else 0.0
                too_late = late.over()  # each looks at the clock every time
                if patience.over() and (unread <= 0.0 or too_late):
                    self.held_up = patience.held_up
                    if unread > 0.0:
                        self.held_up = " (this program was held up, and did not read what was sent: is the host busy?)"
                    return False
        return True

    def tare(self, duration: float = FREE_AIR) -> None:
        """Take what is read in free air (`free_air`) as zero, and learn the noise.

        Raises:
            LinkError: no samples.
            StoppedError: no axis changes: the value is frozen.
        """
        since = time.monotonic()
        self.zeroed = self.free_air(duration)
        self.zero = self.zeroed.force
        ticks, _, forces = self.recorded(since)
        if len(ticks) > 2:
            step = float(np.median(np.diff(ticks)))
            uneven = MAD_TO_SD * float(np.median(np.abs(np.diff(ticks) - step)))
            self.watch.learn(forces, step, step * self._period, uneven)

    def free_air(self, duration: float = FREE_AIR) -> FreeAir:
        """The median force of the next moments, s, its drift, and when that was. Nothing may touch.

        What counts is when a sample was taken, by the sensor's own clock: one that a busy host hears late may be of
        the contact before, and a handful of samples makes a drift of noise.

        Raises:
            LinkError: no samples.
        """
        since = time.monotonic()
        until = since + duration
        heard = self.wait(lambda: self.heard > until, duration + LONGEST_SENSOR_SILENCE)
        ticks, arrivals, forces = self.recorded(since - HISTORY)
        if len(ticks) > 1 and arrivals[-1] - arrivals[0] > PERIOD_SPAN:
            self._retime(SensorClock.estimate(ticks.astype(float), arrivals, self.tick).period)
        lately = arrivals > since - DELAY_BLOCK
        ticks, arrivals, forces = ticks[lately], arrivals[lately], forces[lately]
        offset = float(np.min(arrivals - self._period * ticks, initial=np.inf))
        recent = offset + self._period * ticks > since
        if not heard or not recent.any():
            raise LinkError(f"{self.link.port}: no samples from the {self.name} for {duration:g} s{self.held_up}")
        ticks, forces = ticks[recent].astype(float), forces[recent]
        drift = np.zeros(3)
        if len(ticks) > 2:
            drift = np.array([_slope(np.asarray(ticks * self._period), column) for column in forces.T])
        # the median: a first sample after a reconnection may be anything
        return FreeAir(0.5 * (since + until), np.median(forces, axis=0), drift)

    def recorded(self, since: float = -np.inf) -> tuple[IntArray, FloatArray, FloatArray]:
        """Ticks (N,), arrivals (N,) s and raw forces (N, 3) N of the samples that arrived after `since`."""
        with self._news:
            kept = list(takewhile(lambda sample: sample[0] >= since, reversed(self._samples)))[::-1]
        table = np.array([(s[0], s[2], s[3], s[4]) for s in kept], dtype=np.float64).reshape(-1, 4)
        return unwrapped(np.array([s[1] for s in kept], dtype=np.int64), self.bits), table[:, 0], table[:, 1:]

    def timed(self, since: float) -> tuple[FloatArray, FloatArray]:
        """Host times (N,) s at which the samples since then were taken, and their forces (N, 3) N, zero taken off."""
        ticks, arrivals, forces = self.recorded(since - HISTORY)
        if len(ticks) == 0:
            return np.zeros(0), np.zeros((0, 3))
        clock = SensorClock.estimate(ticks.astype(float), arrivals, self.tick)
        recent = arrivals >= since
        return clock.times(ticks[recent].astype(float)), (forces[recent] - self.zero) @ self.turned.T

    def _hear(self, now: float, frames: list[bytes]) -> None:
        if not self._heard_at_once(now, frames):
            self._hear_each(now, frames)

    def _heard_at_once(self, now: float, frames: list[bytes]) -> bool:
        """Whether the frames could be taken together: if they are many, and there is nothing about any of them."""
        if len(frames) <= WORTH_GATHERING or self.fault is not None:
            return False
        told = self.decode_all(frames)
        u, v, w = self.zero.tolist()
        judged = None if told is None else self.watch.judge_all(*told, (u, v, w))
        if told is None or judged is None:
            return False
        (counts, forces), (newest, strongest) = told, judged
        self._heed(strongest)
        with self._news:
            self._stamp(now, newest)
            self._samples.extend(zip([now] * len(counts), counts.tolist(), *forces.T.tolist(), strict=True))
            self._news.notify_all()
        return True

    def _hear_each(self, now: float, frames: list[bytes]) -> None:
        kept: list[tuple[float, int, float, float, float]] = []
        newest, taken_back, strongest, watch = None, 0, 0.0, self.watch
        u, v, w = self.zero.tolist()
        for frame in frames:
            sample = self.decode(frame)
            if sample is None:
                self.faulty += 1
                continue
            told = watch.judge(sample, now)
            if told.fault is not None and self.fault is None:
                self.fault, taken_back = f"the {self.name} {told.fault}", watch.doubtful
                self._strike(self.fault)
            self.faulty += 1  # or waits for the next
            if self.fault is not None:
                continue
            for at, (count, x, y, z) in told.kept:
                self.faulty -= 1
                newest = told.newest
                kept.append((at, count, x, y, z))
                strongest = max(strongest, (x - u) ** 2 + (y - v) ** 2 + (z - w) ** 2)
        self._heed(strongest**0.5)
        with self._news:
            if newest is not None:
                self._stamp(now, newest)
            self._samples.extend(kept)
            for _ in range(min(taken_back, len(self._samples))):
                self._samples.pop()
            self._news.notify_all()

    def _heed(self, felt: float) -> None:
        """Stop the machine at a touch that is waited for, or above the limit, N."""
        if felt > self._touch:
            self._touched()
        if felt > self._limit and not self._struck:
            self._strike(
                f"the force reached {felt:.2f} N, above the limit of {self._limit:g} N; check the path, run again"
            )
        if self._gathers:
            spare = (min(self._touch, self._limit) - felt) / self.watch.steepest  # s; 0 where nothing is known yet
            self.link.gather = min(max(GATHER, spare), LONGEST_GATHER)

    def _stamp(self, now: float, count: int) -> None:
        """When was the sample of this running count taken, at the earliest?"""
        with self._news:
            delay = now - count * self._period
            if now > self._block_ends:
                self._block_ends, self._least = now + DELAY_BLOCK, [self._least[1], np.inf]
            self._least[1] = min(self._least[1], delay)
            self._newest = count * self._period + min(self._least)

    def _retime(self, period: float) -> None:
        """From now on its clock has this period, s.

        Delays by two periods compare to nothing (2e-5 s are 1.6 s after 80,000 samples): the thread that reads must not
        be in the midst of a sample.
        """
        with self._news:
            self._period, self._least = period, [np.inf, np.inf]

    def _strike(self, reason: str) -> None:
        """Halt, but once: the way out of what it stopped must stay open."""
        if not self._struck:
            self._struck = True
            self._halt(reason)

    def _on_lost(self) -> None:
        self._halt(f"the {self.name} was lost ({self.link.error})")


def _slope(times: FloatArray, values: FloatArray) -> float:
    """By least squares, less what lies too far from the median to be noise: a garbled sample would tilt the line."""
    off = np.abs(values - np.median(values))
    near = off <= OFF_FREE_AIR * MAD_TO_SD * np.median(off)
    at = times[near] - times[near].mean()
    return float(at @ values[near] / (at @ at)) if near.sum() > 2 else 0.0


def _nothing_more() -> None:
    """A touch that nobody waits for."""


def _nothing(reason: str) -> None:
    """Until a stage is there to be halted."""
