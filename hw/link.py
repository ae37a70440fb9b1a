"""Link: a serial port that a thread of its own reads, cuts into frames and stamps with the time of arrival."""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any

from hw.errors import LinkError
from hw.framing import Framing
from hw.patience import LONGEST_LOOK, Patience

# Read in one go, bytes: what a port's buffer in the system holds
MOST_AT_ONCE = 65536

Receive = Callable[[float, list[bytes]], None]


class Link:
    """A serial connection with time-outs on everything.

    Args:
        port: device name or pyserial URL ("/dev/ttyUSB0", "COM3", "socket://host:23").
        framing: cuts what arrives into frames.
        receive: called in the reading thread with the time of arrival (s, time.monotonic) and the frames; without any
            where one was thrown away.
        baudrate: bits per second.
        write_timeout: longest time a write may take, s.
        lost: called once, in the reading thread, when the connection breaks.
        still: keep the lines DTR and RTS low on opening and leave them alone: boards of the Arduino kind restart
            when one of them is raised.

    What arrives within `gather` s may be taken together, if the device sends often: it may be set at any time.

    Raises:
        LinkError: (on open) no such port, or another program has it.
    """

    def __init__(
        self,
        port: str,
        framing: Framing,
        receive: Receive,
        *,
        baudrate: int = 115200,
        write_timeout: float = 0.5,
        lost: Callable[[], None] | None = None,
        still: bool = False,
    ) -> None:
        self.port, self.framing = port, framing
        self.received = 0
        self.reconnections = 0
        self.error: str | None = None
        self.heard = time.monotonic()
        self.listened = 0.0  # s in which the reading thread had its turns: a device is silent in these alone
        self._receive, self._lost = receive, lost
        self._baudrate, self._write_timeout, self._still = baudrate, write_timeout, still
        self._writing = threading.RLock()  # a signal may strike while a write goes on, and stop the machine
        self.gather = 0.0
        self._serial: Any = None
        self._reader: threading.Thread | None = None
        self._closing = False

    def open(self) -> Link:
        """Open the port and begin to read; nothing is written."""
        from serial import SerialException, serial_for_url

        try:
            self._serial = serial_for_url(
                self.port,
                do_not_open=True,
                baudrate=self._baudrate,
                timeout=0.05,
                write_timeout=self._write_timeout,
            )
            if self._still:  # set before the port is open: afterwards the restart has begun
                self._serial.dtr = self._serial.rts = False
            if "://" not in self.port:
                self._serial.exclusive = True
            self._serial.open()
        except (SerialException, OSError, ValueError) as error:
            # pyserial wraps what the system says once or twice; its own words begin after the number
            number = error.errno if isinstance(error, OSError) else None
            why = os.strerror(number) if number else str(error)
            raise LinkError(f"cannot open {self.port}: {why}; {_advice(self.port)}") from error
        self.error, self._closing = None, False
        self.heard = time.monotonic()
        self._reader = threading.Thread(target=self._read, name=f"link {self.port}", daemon=True)
        self._reader.start()
        return self

    @property
    def is_open(self) -> bool:
        """True while bytes can be sent and received."""
        return self._serial is not None and self.error is None

    @property
    def handle(self) -> int | None:
        """Of the open port's file; None where it is no file."""
        handle: int | None = getattr(self._serial, "fd", None)
        return handle

    @property
    def counters(self) -> dict[str, int]:
        """Bytes received, good frames, garbage bytes, bad frames, reconnections."""
        counts = self.framing.counts
        return {
            "bytes": self.received,
            "frames": counts.frames,
            "garbage": counts.garbage,
            "bad": counts.bad,
            "reconnections": self.reconnections,
        }

    def write(self, data: bytes) -> None:
        """Send bytes; from any thread.

        Raises:
            LinkError: the connection is lost, or the device does not take the bytes in time.
        """
        from serial import SerialException

        with self._writing:
            if not self.is_open:
                raise LinkError(self.error or f"{self.port} is not open")
            try:
                _send(self._serial, data, self._write_timeout)
            except (SerialException, OSError) as error:
                self._break(f"{self.port}: cannot write ({error})")
                raise LinkError(self.error or str(error)) from error

    def raise_lines(self) -> None:
        """Raise DTR and RTS: a native USB port sends nothing before it is asked so. May restart the device."""
        with self._writing, suppress(OSError):  # a pseudo-terminal has no such lines
            if self._serial is not None:
                self._serial.dtr = self._serial.rts = True

    def reopen(self, within: float) -> bool:
        """Try for some seconds to open the port again after it was lost; True if it is open now."""
        until = time.monotonic() + within
        self.close()
        while time.monotonic() < until:
            with suppress(LinkError):
                self.open()
                self.reconnections += 1
                return True
            time.sleep(0.05)
        self.error = f"{self.port} did not come back within {within:g} s"
        return False

    def close(self) -> None:
        """Let go of the port; never raises, may be called twice."""
        self._closing = True
        serial, self._serial = self._serial, None
        if self._reader is not None and self._reader is not threading.current_thread():
            self._reader.join(timeout=1.0)
        if serial is not None:
            with suppress(OSError):  # a port whose device is gone cannot be closed in good order
                serial.close()

    def _read(self) -> None:
        from serial import SerialException

        serial = self._serial
        looked = time.monotonic()
        try:
            while not self._closing:
                if data := _received(serial, self.gather):
                    self._take(data)
                before, looked = looked, time.monotonic()
                self.listened += min(looked - before, LONGEST_LOOK)
        except (SerialException, OSError, TypeError) as error:  # pyserial: TypeError if closed while it reads
            if not self._closing:
                self._break(f"{self.port}: connection lost ({error})")

    def _take(self, data: bytes) -> None:
        now = time.monotonic()
        self.received += len(data)
        bad = self.framing.counts.bad
        frames = self.framing.feed(data)
        if frames:
            self.heard = now
        if frames or self.framing.counts.bad > bad:
            self._receive(now, frames)

    def _break(self, why: str) -> None:
        first, self.error = self.error is None, self.error or f"{why}; check cable and power, then run again"
        if first and self._lost is not None:
            self._lost()

    def __enter__(self) -> Link:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()


def _received(serial: Any, gather: float) -> bytes:
    """What has arrived after `gather` s, or else arrives before the port's time-out.

    Where the port is a file, the file is asked itself: pyserial asks four times, which at 1000 packets a second takes
    ten percent of a core.

    Raises:
        OSError, SerialException: the connection is lost.
    """
    file = getattr(serial, "fd", None)
    if file is None:
        data: bytes = serial.read(1)
        waiting = serial.in_waiting if data else 0
        return data + (serial.read(waiting) if waiting else b"")
    if gather:
        time.sleep(gather)
    data = _there(file)
    if not data:
        if not select.select([file], [], [], serial.timeout)[0]:
            return b""
        data = _there(file)  # a device that is gone gives nothing, and says that there is something
    if not data:
        raise OSError("the device is gone")
    return data


def _send(serial: Any, data: bytes, within: float) -> None:
    """Hand bytes to the system; where the port is a file, a pause of this program is no fault of the device's.

    pyserial looks at the clock after it wrote, too: a program that was held up in between had its port closed.

    Raises:
        OSError, SerialException: the connection is lost, or no bytes are taken within so many s.
    """
    file = getattr(serial, "fd", None)
    if file is None:
        serial.write(data)
        return
    patience = Patience(within)
    while data:
        try:
            data = data[os.write(file, data) :]
        except BlockingIOError:
            if patience.over():
                raise OSError(f"it takes no bytes{patience.held_up}") from None
            select.select([], [file], [], serial.timeout)


def _there(file: int) -> bytes:
    """What has arrived, perhaps nothing: pyserial opens its files so that they wait for nothing."""
    try:
        return os.read(file, MOST_AT_ONCE)
    except BlockingIOError:
        return b""


def _advice(port: str) -> str:
    from serial.tools.list_ports import comports

    there = sorted(found.device for found in comports())
    if port in there or os.path.exists(port):
        return "is another program using it, and may you read it (group dialout)?"
    return f"ports that exist: {', '.join(there) or 'none'}"
