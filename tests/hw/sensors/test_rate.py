"""Five thousand samples a second from a sensor on a port: every one is heard, judged and kept."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import tty

import numpy as np
import pytest

from hw.framing import Frames
from hw.sensors.force_sensor import ForceSensor
from hw.sensors.line_sensor import LineSensor, decode, encode_line, xor_of
from hw.sensors.optoforce import BAUDRATE, FRAME_BYTES, HEADER, OptoForce, are_whole, encode_frame, is_whole
from hw.sensors.sample_kernels import (
    judge_block,
    load_sample_kernels,
    read_frames,
    read_lines,
    whole_frames,
)

RATE = 5000
# Frames of noise, in blocks of what a millisecond of a USB adapter holds
SENDER = """
import sys, time
import numpy as np
from hw.sensors.line_sensor import encode_line
from hw.sensors.optoforce import encode_frame
fd, seconds, rate, kind = int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
import os
counts = np.random.default_rng(0).integers(-9, 10, (65536, 3)).tolist()
if kind == "optoforce":
    frames = [encode_frame(i, 0, tuple(each)) for i, each in enumerate(counts)]
else:  # the board's clock goes on where the table of noise begins anew
    frames = [encode_line(200 * i, tuple(n / 400 for n in counts[i % 65536])) for i in range(int(rate * seconds))]
print("ready", flush=True)
begun, sent = time.monotonic(), 0
while sent < rate * seconds:
    due = min(int((time.monotonic() - begun) * rate), int(rate * seconds))
    block = b"".join(frames[i % len(frames)] for i in range(sent, due))
    while block:
        block = block[os.write(fd, block):]
    sent = max(sent, due)
    time.sleep(0.001)
"""


class FastSensor(OptoForce):
    """A sensor with the frames of another, but faster."""

    def __init__(self, port: str) -> None:
        ForceSensor.__init__(
            self, port, Frames(HEADER, FRAME_BYTES, is_whole, are_whole), rate=RATE, bits=16, baudrate=BAUDRATE
        )
        self._scale = (1 / 400, 1 / 400, 1 / 400)
        self._scales = np.array(self._scale)

    def start(self) -> None:
        """It sends from the beginning."""


def sustained(seconds: float, kind: str) -> tuple[ForceSensor, float]:
    """A sensor that has listened for so long, and the share of a core that it took."""
    master, slave = os.openpty()
    tty.setraw(slave)
    port = os.ttyname(slave)
    sensor: ForceSensor = FastSensor(port) if kind == "optoforce" else LineSensor(port, rate=RATE)
    halted: list[str] = []
    sender = subprocess.Popen(
        [sys.executable, "-c", SENDER, str(master), str(seconds), str(RATE), kind],
        pass_fds=[master],
        stdout=subprocess.PIPE,
    )
    assert sender.stdout is not None and sender.stdout.readline() == b"ready\n"
    with sensor:
        sensor.tare()
        sensor.watch.steepest = 200.0
        sensor.guard(5.0, halted.append)
        cpu, begun = time.process_time(), time.monotonic()
        assert sender.wait(timeout=3 * seconds + 30) == 0
        share = (time.process_time() - cpu) / (time.monotonic() - begun)
        time.sleep(0.3)
    os.close(master)
    os.close(slave)
    assert not halted and sensor.fault is None
    return sensor, share


def test_to_judge_and_keep_five_thousand_samples_takes_a_twentieth_of_a_second() -> None:
    counts = np.random.default_rng(0).integers(-9, 10, (20_000, 3)).tolist()
    frames = [encode_frame(i, 0, tuple(each)) for i, each in enumerate(counts)]
    sensor = FastSensor("/dev/none")
    sensor.watch.learn(np.array(counts[:1000]) / 400, 1.0, 1.0 / RATE)
    sensor.watch.steepest = 200.0
    took = []
    for first in range(0, 20_000, RATE):
        begun = time.process_time()
        for i in range(first, first + RATE, 10):  # as many as come together in GATHER
            sensor._hear(i / RATE, sensor.link.framing.feed(b"".join(frames[i : i + 10])))
        took.append(time.process_time() - begun)
    assert sensor.fault is None and sensor.faulty == 0
    assert min(took) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "tick"), [("optoforce", 1), ("line", 200)])
def test_a_minute_of_five_kilohertz_loses_no_sample(kind: str, tick: int) -> None:
    sensor, share = sustained(60.0, kind)
    ticks, _, _ = sensor.recorded()
    # opening a port throws away what waited there
    assert (np.diff(ticks) == tick).all() and len(ticks) > 59 * RATE
    assert (ticks[-1] // tick + 1) % 2**16 == 60 * RATE % 2**16
    # the port may be opened in the midst of the first line
    assert sensor.faulty <= (kind == "line") and sensor.link.counters["garbage"] == 0
    # beside other jobs; a core that is never late is woken more often
    assert share < 0.1


@pytest.mark.parametrize(
    "number", ["0", "-0.00000", "1.1", "-123.456789", "0.1234567890123", "12345.", ".5", "1e-3", "+2", "9" * 17]
)
def test_lines_are_read_at_once_as_they_are_one_by_one(number: str) -> None:
    lines = []
    for micros in (7, 2**32 - 1):
        body = f"F,{micros},{number},-2.25,{number}".encode()
        lines.append(body + f"*{xor_of(body):02X}".encode())
    sensor = LineSensor("/dev/none", rate=RATE)
    told = sensor.decode_all(lines)
    assert told is not None
    for line, count, force in zip(lines, *told, strict=True):
        assert decode(line) == (count, *force)
    for at in range(len(lines[0])):  # one bit is wrong
        broken = lines[0][:at] + bytes([lines[0][at] ^ 1]) + lines[0][at + 1 :]
        alone = decode(broken)
        at_once = sensor.decode_all([lines[1], broken])
        assert (at_once is None) == (alone is None)


def test_the_loops_are_compiled_before_a_sensor_is_heard_and_not_again() -> None:
    load_sample_kernels()
    known = {loop: len(loop.signatures) for loop in (judge_block, read_frames, read_lines, whole_frames)}
    counts = np.random.default_rng(0).integers(-9, 10, (100, 3)).tolist()
    fast, line = FastSensor("/dev/none"), LineSensor("/dev/none", rate=RATE)
    frames = [encode_frame(i, 0, tuple(each)) for i, each in enumerate(counts)]
    lines = [encode_line(200 * i, tuple(each)) for i, each in enumerate(np.array(counts) / 400)]
    for sensor, told, tick in ((fast, frames, 1.0), (line, lines, 200.0)):
        sensor.watch.learn(np.array(counts) / 400, tick, 1.0 / RATE)
        sensor._hear(0.0, sensor.link.framing.feed(b"".join(told[:2])))  # the second bears the first one out
        assert sensor._heard_at_once(0.0, sensor.link.framing.feed(b"".join(told[2:])))
        assert len(sensor.recorded()[0]) == 100 and sensor.faulty == 0
    assert {loop: len(loop.signatures) for loop in known} == known
