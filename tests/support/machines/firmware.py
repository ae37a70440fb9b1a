"""A real firmware's simulator as an emulated device: its own parser, planner and stepper; the body is ours.

Two are known: grblHAL's (github.com/grblHAL/Simulator), whose probe is toggled by a key, and that of classic Grbl 1.1h
(github.com/grbl/grbl-sim), which has no probe.

Where the motors of the classic one stand it prints. grblHAL's could, too, but then it counts every tick of a processor
of 16 MHz, and of a short jog prints nothing but its end: it is asked instead, by one more `?` whenever the host has
none under way. Between two reports it is taken to move evenly, one report late: a tip that jumped from one reported
place to the next would be felt as no tip can be.
"""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from types import TracebackType

import numpy as np

from hw.emulated.touched_body import TouchedBody

# Steps per mm that both firmwares have by default ($100 to $102), and how often they print where they stand, s
STEPS_PER_MM, PRINTED = 250, 0.001
# A machine of the size and speed of ours; soft limits would need homing
SETTINGS = {110: 6000, 111: 6000, 112: 3000, 120: 500, 121: 500, 122: 500, 130: 200, 131: 200, 132: 100}
# Where a report says that it stands; the classic one's simulator drops a character now and then
PLACE = re.compile(rb"\|MPos:" + b",".join([rb"(-?\d+\.\d{3})"] * 3) + rb"[|>]")
# A firmware answers a setting within so many s, its host being busy otherwise
ANSWERING = 5.0
# Of some thousand questions grblHAL's simulator leaves one without an answer, and then stands waiting for the next; the
# others it answers in 5 to 60 ms. So it is asked again after so long, s
UNHEARD = 0.2


class Firmware:
    """A process that runs the simulator, as a device of a PtyServer; a context manager.

    Args:
        program: the simulator.
        folder: for its files.
        body: what its tip touches, machine coordinates. It begins at machine zero.
    """

    def __init__(self, program: Path, folder: Path, body: TouchedBody) -> None:
        self.out = bytearray()
        self.body, self.position = body, np.zeros(3)
        self._told, self._told_before = (0.0, np.zeros(3)), (0.0, np.zeros(3))  # when it said where it stands, s
        self.strongest = 0.0
        told = subprocess.run([program, "-h"], capture_output=True, text=True, check=False)
        self.has_probe = "-p <port>" in told.stdout + told.stderr
        self._program, self._folder = program, folder
        self._closed, self._printed = False, b""
        self._socket: socket.socket | None = None
        self._steps: int | None = None
        self._asked: deque[bool] = deque()  # for each report that is to come: was it the host that asked?
        self._asked_at = 0.0
        self._waiting = 0  # the host's questions, while our own is under way: one report would answer both
        self._rest = b""

    def __enter__(self) -> Firmware:
        words = [str(self._program), "-n", "-b", os.devnull]
        port = 0
        if self.has_probe:
            words += ["-s", os.devnull]
            with socket.create_server(("127.0.0.1", 0)) as free:
                port = free.getsockname()[1]
            words += ["-p", str(port)]
        else:  # it reads and writes through buffers that a pipe would fill first
            steps = self._folder / "steps"
            os.mkfifo(steps)
            self._steps = os.open(steps, os.O_RDONLY | os.O_NONBLOCK)
            words += ["-r", str(PRINTED), "-s", str(steps)]
            words = [shutil.which("stdbuf") or "stdbuf", "-i0", "-o0", *words]
        self._process = subprocess.Popen(
            words, cwd=self._folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0
        )
        try:
            self._begin(port)
        except BaseException:  # its loop never sleeps: one that is left behind takes a core
            self.__exit__(None, None, None)
            raise
        return self

    def _begin(self, port: int) -> None:
        assert self._process.stdout is not None
        self._socket = self._connected(port) if self.has_probe else None
        os.set_blocking(self._process.stdout.fileno(), False)
        self._answer("for help]")
        for number, value in SETTINGS.items():
            self._write(f"${number}={value}\n".encode())
            self._answer("ok\r\n")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()
        if self._steps is not None:
            os.close(self._steps)
        if self._socket is not None:
            self._socket.close()

    def _connected(self, port: int) -> socket.socket:
        until = time.monotonic() + ANSWERING
        while True:
            try:
                connection = socket.create_connection(("127.0.0.1", port))
            except OSError:
                if time.monotonic() > until:
                    raise
                time.sleep(0.05)
                continue
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return connection

    def _answer(self, end: str) -> None:
        until, heard = time.monotonic() + ANSWERING, b""
        while end.encode() not in heard:
            assert time.monotonic() < until, f"{self._program} said {heard!r}, and not {end!r}"
            time.sleep(0.002)
            heard += self._read()

    def _read(self) -> bytes:
        with suppress(BlockingIOError):
            if self._socket is not None:
                return self._socket.recv(65536)
            assert self._process.stdout is not None
            return self._process.stdout.read(65536) or b""
        return b""

    def _write(self, data: bytes) -> None:
        if self._socket is not None:
            self._socket.sendall(data)
        else:
            assert self._process.stdin is not None
            self._process.stdin.write(data)

    def receive(self, data: bytes, now: float) -> None:
        """Bytes from the host."""
        if self.has_probe:
            self._waiting += data.count(b"?")
            data = data.replace(b"?", b"")
        if data:
            self._write(data)

    def advance(self, now: float) -> None:
        """Hear what the firmware says, learn where its motors stand, and close the probe if the tip touches there."""
        said = self._read()
        if self.has_probe:
            said = self._without_our_own(said, now)
            self._ask()
        elif self._steps is not None:
            self._look(self._steps)
        # what a block prints ends with the planning of its last 60 ms: then its own reports say where it stands
        if not self.has_probe:
            self._note(said, now)
        self.out += said
        if self.has_probe:
            (before, begin), (after, end) = self._told_before, self._told
            share = (now - after) / (after - before) if after > before else 1.0
            self.position = begin + min(max(share, 0.0), 1.0) * (end - begin)
        force = float(np.linalg.norm(self.body.force(self.position)))
        self.strongest = max(self.strongest, force)
        if self.has_probe and (force > 0.0) != self._closed:
            self._closed = force > 0.0
            assert self._process.stdin is not None
            self._process.stdin.write(b"p")

    def _ask(self) -> None:
        """One question at a time, the host's before our own: a second one before the answer would get none."""
        now = time.monotonic()
        if self._asked and now - self._asked_at < UNHEARD:
            return
        if not self._asked:
            hosts = self._waiting > 0
            self._waiting -= hosts
            self._asked.append(hosts)
        self._asked_at = now
        self._write(b"?")

    def _without_our_own(self, said: bytes, now: float) -> bytes:
        """What the firmware said, in whole lines, but for the reports that the host did not ask for."""
        *lines, self._rest = (self._rest + said).split(b"\n")
        told = b""
        for line in lines:
            self._note(line, now)
            # one that nobody waits for answers a question that was asked twice
            ours = line.startswith(b"<") and not (self._asked and self._asked.popleft())
            told += b"" if ours else line + b"\n"
        return told

    def _note(self, said: bytes, now: float) -> None:
        for place in PLACE.findall(said):
            self.position = np.array([float(number) for number in place]) * 1e-3
            self._told_before, self._told = self._told, (now, self.position)

    def _look(self, steps: int) -> None:
        with suppress(BlockingIOError):
            *lines, self._printed = (self._printed + os.read(steps, 65536)).split(b"\n")
            for line in lines:
                numbers = line.replace(b",", b" ").split()
                if len(numbers) >= 4 and not line.startswith(b"#"):
                    self.position = np.array([float(n) for n in numbers[1:4]]) / (1e3 * STEPS_PER_MM)
