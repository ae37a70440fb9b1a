"""What a force sensor says in free air, heard late by a busy host: only what was taken meanwhile counts."""

from __future__ import annotations

import os
import threading
import time
import tty
from contextlib import suppress

import numpy as np
import pytest

from hw.errors import LinkError
from hw.sensors.force_sensor import ForceSensor
from hw.sensors.line_sensor import LineSensor, encode_line
from hw.sensors.sample_kernels import load_sample_kernels

NOISE = 0.005  # N
# Seconds that the host is late, in which the tip was lifted off a contact of 1 N
LATE = 0.12


def taken(since: float, until: float, contact_ends: float, begun: float, seed: int = 0) -> list[bytes]:
    """Frames of 1 kHz, s of time.monotonic; before `contact_ends` the tip was pressed by 1 N."""
    times = np.arange(np.ceil(1e3 * (since - begun)), np.ceil(1e3 * (until - begun))) * 1e-3 + begun
    forces = NOISE * np.random.default_rng(seed).standard_normal((len(times), 3))
    forces[times < contact_ends, 2] += 1.0
    return [
        encode_line(round(1e6 * (at - begun)), tuple(force)).strip() for at, force in zip(times, forces, strict=True)
    ]


class Late:
    """A sensor whose frames are heard LATE s after they were taken, from now on and for so long, s."""

    def __init__(self, sensor: ForceSensor, lasting: float) -> None:
        self.sensor, self.lasting = sensor, lasting
        load_sample_kernels()
        self.begun = time.monotonic() - 2.0
        # a second and a half that was heard in time: what is known of the clock
        for number in range(15):
            at = self.begun + 0.1 * number
            sensor._hear(at + 0.1, taken(at, at + 0.1, np.inf, self.begun, number))
        self._thread = threading.Thread(target=self._speak, daemon=True)

    def _speak(self) -> None:
        told, ends, off = self.begun + 1.5, time.monotonic() + self.lasting, time.monotonic() - 0.5 * LATE
        while (now := time.monotonic()) < ends:
            self.sensor._hear(now, taken(told, now - LATE, off, self.begun, int(1e3 * now)))
            told = max(told, now - LATE)
            time.sleep(0.002)

    def __enter__(self) -> ForceSensor:
        self._thread.start()
        return self.sensor

    def __exit__(self, *ended: object) -> None:
        self._thread.join()


def on_a_port() -> tuple[LineSensor, int]:
    """A sensor on a pseudo-terminal, and the other side of it."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    return LineSensor(os.ttyname(slave), rate=1000.0), master


class Sending:
    """Frames of noise of 1 kHz until the block ends; what nobody reads waits for it, as in an adapter."""

    def __init__(self, master: int) -> None:
        self._master, self._ended = master, threading.Event()
        self._begun = time.monotonic()
        self._thread = threading.Thread(target=self._send, daemon=True)

    def _send(self) -> None:
        told, rest = self._begun, b""
        while not self._ended.wait(0.002):
            now = time.monotonic()
            rest += b"".join(frame + b"\n" for frame in taken(told, now, -np.inf, self._begun, int(1e3 * now)))
            told = now
            with suppress(BlockingIOError):
                rest = rest[os.write(self._master, rest) :]

    def __enter__(self) -> Sending:
        self._thread.start()
        return self

    def end(self) -> None:
        """Fall silent."""
        self._ended.set()
        self._thread.join()

    def __exit__(self, *ended: object) -> None:
        self.end()


def hold_up(sensor: ForceSensor, lasting: float) -> None:
    """Make the thread that reads miss its turns, s, from its next one on."""
    hear, done, begun = sensor.link._receive, threading.Event(), threading.Event()

    def late(now: float, frames: list[bytes]) -> None:
        if not begun.is_set():
            begun.set()
            done.wait(lasting)
        hear(now, frames)

    sensor.link._receive = late
    assert begun.wait(1.0)


def test_samples_of_the_contact_before_that_come_late_are_no_zero_and_no_drift() -> None:
    sensor = LineSensor("nowhere", rate=1000.0)
    with Late(sensor, 0.6):
        air = sensor.free_air()
    # 200 samples of this noise tell a drift to 6 mN/s; what is left of the contact's would make it 1 N/s and more
    assert np.abs(air.force).max() < 6.0 * NOISE / np.sqrt(100.0)
    assert np.abs(air.drift).max() < 6.0 * 0.0062


def test_a_sensor_that_falls_silent_meanwhile_is_no_zero() -> None:
    sensor = LineSensor("nowhere", rate=1000.0)
    with Late(sensor, 0.15), pytest.raises(LinkError, match="no samples"):
        sensor.free_air()


class Interrupted(int):
    """A count in the midst of whose reading another thread does something, if it may."""

    def __new__(cls, value: int, meanwhile: threading.Thread) -> Interrupted:
        count = super().__new__(cls, value)
        count.meanwhile = meanwhile  # type: ignore[attr-defined]
        return count

    def __mul__(self, period: float) -> float:
        product = int(self) * period
        if self.meanwhile.ident is None:  # type: ignore[attr-defined]
            self.meanwhile.start()  # type: ignore[attr-defined]
            self.meanwhile.join(0.1)  # type: ignore[attr-defined]
        return product


def test_a_period_that_is_learnt_while_a_sample_is_heard_makes_none_old() -> None:
    """It would be 1.6 s older than it is, and the machine be stopped for the silence of a sensor that sends."""
    sensor = LineSensor("nowhere", rate=1000.0)
    sensor._retime(1e-3)
    learns = threading.Thread(target=sensor._retime, args=(1e-3 - 2e-5,))
    now = time.monotonic()
    sensor._stamp(now, Interrupted(80_000, learns))
    learns.join()
    for later in range(1, 100):
        sensor._stamp(now + 1e-3 * later, 80_000 + later)
        assert abs(now + 1e-3 * later - sensor.heard) < 0.05


def test_a_sensor_is_not_blamed_while_the_thread_that_reads_it_is_held_up() -> None:
    sensor, master = on_a_port()
    with Sending(master) as sending, sensor:
        hold_up(sensor, 1.6)
        since = time.monotonic()
        assert sensor.wait(lambda: sensor.heard > since, 1.0), sensor.held_up
        assert time.monotonic() - since > 1.2
        # and one that is silent for a second is taken for dead within it
        sending.end()
        since = time.monotonic()
        assert not sensor.wait(lambda: sensor.heard > since, 1.0)
        assert 0.95 < time.monotonic() - since < 1.3
        assert sensor.held_up == ""


@pytest.mark.slow
def test_a_thread_that_never_reads_again_is_not_waited_for_for_ever() -> None:
    sensor, master = on_a_port()
    with Sending(master), sensor:
        hold_up(sensor, 5.0)
        since = time.monotonic()
        assert not sensor.wait(lambda: sensor.heard > since, 1.0)
        assert 3.4 < time.monotonic() - since < 4.1
        assert "held up" in sensor.held_up
