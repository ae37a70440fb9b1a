"""The serial link: framing by counting what was sent, throughput, and what happens when the other side goes away."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
import tty
from pathlib import Path

import numpy as np
import pytest

from hw.emulated.faults import Fault
from hw.emulated.pty_server import PtyServer
from hw.errors import LinkError
from hw.framing import Frames, Lines
from hw.link import Link
from hw.patience import Patience
from hw.sensors import line_sensor, optoforce

HEADER = b"\xaa\x07\x08\x22"


def frame(index: int) -> bytes:
    body = HEADER + index.to_bytes(4, "big") + bytes(30)
    return body + (sum(body) & 0xFFFF).to_bytes(2, "big")


def is_whole(data: bytes) -> bool:
    return sum(data[:-2]) & 0xFFFF == int.from_bytes(data[-2:], "big")


def numbers(frames: list[bytes]) -> list[int]:
    return [int.from_bytes(f[4:8], "big") for f in frames]


def test_frames_cut_anywhere_come_out_whole_and_in_order() -> None:
    rng = np.random.default_rng(1)
    stream, framing, out = b"".join(frame(i) for i in range(500)), Frames(HEADER, 40, is_whole), []
    cuts = np.sort(rng.integers(0, len(stream), 700))
    for piece in np.split(np.frombuffer(stream, np.uint8), cuts):
        out += framing.feed(piece.tobytes())
    assert numbers(out) == list(range(500))
    assert (framing.counts.garbage, framing.counts.bad) == (0, 0)


def test_garbage_between_frames_is_counted_to_the_byte_and_costs_no_frame() -> None:
    rng = np.random.default_rng(2)
    framing, out, sent = Frames(HEADER, 40, is_whole), [], 0
    for i in range(300):
        garbage = rng.integers(0, 170, int(rng.integers(0, 50)), dtype=np.uint8).tobytes()
        sent += len(garbage)
        out += framing.feed(garbage + frame(i))
    assert numbers(out) == list(range(300))
    assert framing.counts.garbage == sent


def test_a_broken_frame_is_counted_and_the_next_one_found_even_inside_it() -> None:
    framing = Frames(HEADER, 40, is_whole)
    cut = frame(0)[:17]  # a frame that lost its end: the next header lies inside its length
    bad = bytearray(frame(1))
    bad[20] ^= 0x40
    out = framing.feed(cut + frame(2) + bytes(bad) + frame(3))
    assert numbers(out) == [2, 3]
    assert framing.counts.bad == 2
    assert framing.counts.garbage == len(cut) + len(bad)


def test_lines_with_bytes_that_no_answer_has_are_thrown_away_and_counted() -> None:
    framing = Lines()
    assert framing.feed(b"ok\r\n<Idle|MPos:0.0") == [b"ok"]
    assert framing.feed(b"00,0,0>\r\no\xffk\r\nerror:9\n") == [b"<Idle|MPos:0.000,0,0>", b"error:9"]
    assert framing.counts.bad == 1


def test_an_optoforce_frame_survives_its_own_encoding_and_no_flipped_bit() -> None:
    data = optoforce.encode_frame(65535, 0, (-32767, 400, 12))
    assert len(data) == 16 and data[:4] == bytes((170, 7, 8, 10))
    framing = Frames(optoforce.HEADER, optoforce.FRAME_BYTES, optoforce.is_whole)
    assert framing.feed(data) == [data]
    sensor = optoforce.OptoForce("none", [400.0, 400.0, 100.0])
    assert sensor.decode(data) == (65535, -32767 / 400, 1.0, 0.12)
    for bit in range(32, 128):
        spoiled = bytearray(data)
        spoiled[bit // 8] ^= 1 << bit % 8
        assert not optoforce.is_whole(bytes(spoiled))
    assert sensor.decode(optoforce.encode_frame(1, 1 << 13, (0, 0, 0))) is None


def test_the_optoforce_configuration_is_the_vendors() -> None:
    assert optoforce.configuration(1000, 150.0, False) == bytes((170, 0, 50, 3, 1, 2, 0, 0, 226))


def test_a_sensor_line_with_a_wrong_check_is_not_a_sample() -> None:
    line = line_sensor.encode_line(123456, (0.1, -0.25, 1.0))
    assert line_sensor.decode(line.strip()) == (123456, 0.1, -0.25, 1.0)
    assert line_sensor.decode(line.strip().replace(b"0.25", b"0.35")) is None
    assert line_sensor.decode(b"F,1,2,3") is None and line_sensor.decode(b"# hello*00") is None


def test_no_such_port_is_said_with_those_that_exist() -> None:
    with pytest.raises(LinkError, match="ports that exist"):
        Link("/dev/no-such-port", Lines(), lambda now, lines: None).open()


def test_a_vanished_port_is_noticed_and_let_go_of() -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    name = os.ttyname(slave)
    gone = threading.Event()
    with Link(name, Lines(), lambda now, lines: None, lost=gone.set) as link:
        os.close(master)
        os.close(slave)
        assert gone.wait(2.0)
        with pytest.raises(LinkError, match="lost"):
            link.write(b"?")
    handles = [os.readlink(f"/proc/self/fd/{fd}") for fd in os.listdir("/proc/self/fd") if _is_open(fd)]
    assert name not in handles


def test_a_program_held_up_while_it_writes_keeps_its_port(monkeypatch: pytest.MonkeyPatch) -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    write = os.write

    def held_up(file: int, data: bytes) -> int:
        count = write(file, data)
        time.sleep(0.3)
        return count

    with Link(os.ttyname(slave), Lines(), lambda now, frames: None, write_timeout=0.2) as link:
        monkeypatch.setattr(os, "write", held_up)
        link.write(b"?")
        monkeypatch.undo()
        assert link.is_open and os.read(master, 10) == b"?"
    os.close(master)
    os.close(slave)


def test_a_device_that_takes_no_bytes_is_left() -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    with Link(os.ttyname(slave), Lines(), lambda now, frames: None, write_timeout=0.2) as link:
        with pytest.raises(LinkError, match="takes no bytes"):
            link.write(b"x" * 1_000_000)
        assert not link.is_open
    os.close(master)
    os.close(slave)


def test_a_port_belongs_to_one_program() -> None:
    master, slave = os.openpty()
    with Link(os.ttyname(slave), Lines(), lambda now, lines: None), pytest.raises(LinkError, match="another program"):
        Link(os.ttyname(slave), Lines(), lambda now, lines: None).open()
    os.close(master)
    os.close(slave)


def _is_open(fd: str) -> bool:
    return os.path.lexists(f"/proc/self/fd/{fd}")


SENDER = """
import os, sys, time
fd, seconds = int(sys.argv[1]), float(sys.argv[2])
header, begun, sent = bytes((170, 7, 8, 34)), time.monotonic(), 0
while sent < 5000 * seconds:
    due = min(int((time.monotonic() - begun) * 5000), int(5000 * seconds))
    block = b""
    for i in range(sent, due):
        body = header + i.to_bytes(4, "big") + bytes(30)
        block += body + (sum(body) & 0xFFFF).to_bytes(2, "big")
    while block:
        block = block[os.write(fd, block):]
    sent = max(sent, due)
    time.sleep(0.001)
"""


def sustain(seconds: float) -> tuple[list[int], float]:
    """Numbers of the frames that arrived, and the share of a core that the reading process used."""
    master, slave = os.openpty()
    tty.setraw(slave)
    seen: list[int] = []
    with Link(os.ttyname(slave), Frames(HEADER, 40, is_whole), lambda now, got: seen.extend(numbers(got))):
        cpu, begun = time.process_time(), time.monotonic()
        sender = subprocess.Popen([sys.executable, "-c", SENDER, str(master), str(seconds)], pass_fds=[master])
        assert sender.wait(timeout=3 * seconds + 30) == 0
        time.sleep(0.3)
        share = (time.process_time() - cpu) / (time.monotonic() - begun)
    os.close(master)
    os.close(slave)
    return seen, share


def test_two_seconds_of_five_kilohertz_lose_nothing() -> None:
    seen, _ = sustain(2.0)
    assert seen == list(range(10_000))


@pytest.mark.slow
def test_a_minute_of_five_kilohertz_loses_nothing_and_takes_less_than_a_third_of_a_core() -> None:
    seen, share = sustain(60.0)
    assert seen == list(range(300_000))
    assert share < 0.30


def test_a_port_that_comes_back_is_opened_again_and_that_is_counted(tmp_path: Path) -> None:
    class Echo:
        """Sends back what it gets."""

        def __init__(self) -> None:
            self.out = bytearray()

        def receive(self, data: bytes, now: float) -> None:
            self.out += data

        def advance(self, now: float) -> None:
            """Nothing happens by itself."""

    gone, heard = threading.Event(), threading.Event()
    fault = Fault("disconnect", at=0.3, duration=0.5)
    with (
        PtyServer([Echo()], links=[tmp_path / "port"], faults=[fault]) as server,
        Link(server.ports[0], Lines(), lambda now, lines: heard.set(), lost=gone.set) as link,
    ):
        assert gone.wait(3.0)
        assert link.reopen(3.0)
        link.write(b"hello\n")
        assert heard.wait(2.0)
        assert link.counters["reconnections"] == 1
        assert not Link(str(tmp_path / "nowhere"), Lines(), lambda now, lines: None).reopen(0.2)


def test_a_pause_of_the_host_hardly_counts_and_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("hw.patience.time.monotonic", lambda: now[0])
    patience = Patience(1.0)
    for _ in range(9):
        now[0] += 0.05
        assert not patience.over()
    assert patience.held_up == ""
    now[0] += 3.0
    assert not patience.over() and patience.left == pytest.approx(0.3)
    assert "held up for 3.0 s" in patience.held_up
