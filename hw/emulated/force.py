"""Emulated force sensors under the tip of an emulated stage: OptoForce, and the line protocol."""

from __future__ import annotations

from collections import deque

import numpy as np

from hw.emulated.grbl import GrblEmulator
from hw.sensors import CONFIGURE, RATE_CODES, checksum, encode_frame, encode_line
from mapping import FloatArray

# What a sensor may send instead of the force
SENSOR_FAULTS = ("frozen", "zero", "nan", "saturated", "sign", "gain 10", "gain 0.1", "stale", "drift")
# What a saturated one sends, N: the full scale of the 16 bits at 400 counts/N
FULL_SCALE = 81.9
# Drift of the offset, N/s: a hundred times that of a sensor that warms up
DRIFT = 0.1


class ForceEmulator:
    """Samples the force on the tip at its own rate and clock.

    Args:
        stage: whose tip it is.
        rate: samples per second of its own clock.
        noise: standard deviation of each component, N.
        latency: between a sample and its being sent, s.
        drift: relative error of its clock.
        seed: of the noise.
    """

    def __init__(
        self,
        stage: GrblEmulator,
        *,
        rate: float = 1000.0,
        noise: float = 0.003,
        latency: float = 0.0,
        drift: float = 0.0,
        seed: int = 0,
    ) -> None:
        self.out = bytearray()
        self.stage, self.rate, self.noise, self.latency = stage, rate, noise, latency
        self.strongest = 0.0
        self._clock = 1.0 + drift
        self._rng = np.random.default_rng(seed)
        self._next = 0
        self._due: deque[tuple[float, bytes]] = deque()
        self.fault = ""
        self.turned = np.eye(3)  # turns its axes into the machine's
        self._since: float | None = None  # the fault
        self._felt, self._index = np.zeros(3), 0

    def receive(self, data: bytes, now: float) -> None:
        """Nothing is listened to."""

    def advance(self, now: float) -> None:
        """Take the samples up to `now`, s, and send those whose latency is over."""
        while self.rate > 0 and self._next / (self.rate * self._clock) <= now:
            t = self._next / (self.rate * self._clock)
            self.stage.advance(t)
            force = self.stage.body.force(self.stage.position)
            self.strongest = max(self.strongest, float(np.linalg.norm(force)))
            felt = force @ self.turned + self.noise * self._rng.standard_normal(3)
            self._due.append((t + self.latency, self._faulty_frame(t, felt)))
            self._next += 1
        while self._due and self._due[0][0] <= now:
            self.out += self._due.popleft()[1]

    def _faulty_frame(self, t: float, felt: FloatArray) -> bytes:
        """What is sent for a force: itself, or what a fault of SENSOR_FAULTS makes of it."""
        index, down = self._next, np.array([0.0, 0.0, 1.0])
        if not self.fault:
            self._felt, self._index = felt, index
            return self.frame(index, felt)
        self._since = t if self._since is None else self._since
        sent = {
            "frozen": self._felt,
            "zero": np.zeros(3),
            "nan": np.full(3, np.nan),
            "saturated": FULL_SCALE * down,
            "sign": -felt,
            "gain 10": 10.0 * felt,
            "gain 0.1": 0.1 * felt,
            "stale": self._felt,
            "drift": felt - DRIFT * (t - self._since) * down,
        }[self.fault]
        return self.frame(self._index if self.fault == "stale" else index, sent)

    def frame(self, index: int, force: FloatArray) -> bytes:
        """The bytes of one sample."""
        raise NotImplementedError(f"{type(self).__name__} gives no bytes")

    def power_up(self, locked: bool = False) -> None:
        """Start again; `locked` means nothing to a sensor."""
        self._due.clear()
        self.out.clear()

    def trip(self, alarm: int) -> None:
        """A sensor has no alarms: it restarts."""
        self.power_up()


class OptoForceEmulator(ForceEmulator):
    """Sends nothing until it is configured.

    Args:
        counts_per_newton: its sensitivity.
    """

    def __init__(self, stage: GrblEmulator, counts_per_newton: float = 400.0, **settings: float) -> None:
        super().__init__(stage, **settings)  # type: ignore[arg-type]
        self.counts_per_newton = counts_per_newton
        self.rate = 0.0
        self._heard = b""

    def receive(self, data: bytes, now: float) -> None:
        """Configuration frames; others are left alone."""
        self._heard += data
        while (at := self._heard.find(CONFIGURE)) >= 0 and len(self._heard) >= at + 9:
            frame, self._heard = self._heard[at : at + 9], self._heard[at + 9 :]
            speeds = {code: speed for speed, code in RATE_CODES.items()}
            if frame[7] << 8 | frame[8] == checksum(frame[:7]) and frame[4] in speeds:
                self.rate = float(speeds[frame[4]])
                self._next = int(np.ceil(now * self.rate * self._clock))

    def frame(self, index: int, force: FloatArray) -> bytes:
        """A data frame, saturated with the overload bits set where a force is too large."""
        if not np.isfinite(force).all():  # its numbers are whole: it can only say that it is not well
            return encode_frame(index, 1 << 10, (0, 0, 0))
        counts = np.round(force * self.counts_per_newton)
        over = np.abs(counts) > 32767
        status = sum(1 << bit for bit, out in zip((9, 8, 7), over, strict=True) if out)
        x, y, z = (int(c) for c in np.clip(counts, -32767, 32767))
        return encode_frame(index, status, (x, y, z))

    def power_up(self, locked: bool = False) -> None:
        """Start again, silent until configured."""
        super().power_up()
        self.rate = 0.0


class LineSensorEmulator(ForceEmulator):
    """Sends lines from the beginning."""

    def frame(self, index: int, force: FloatArray) -> bytes:
        """A line."""
        return encode_line(round(index / self.rate * 1e6), (float(force[0]), float(force[1]), float(force[2])))
