"""PtyServer: emulated devices behind pseudo-terminals, as real as a serial port gets without a cable."""

from __future__ import annotations

import os
import select
import threading
import time
import tty
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Protocol

from hw.emulated.faults import BYTE_FAULTS, Fault
from hw.emulated.wire import Wire

TICK = 0.001  # s
# So many bytes wait for a host that reads late; what a device says beyond is lost, as with a port that nobody has open
HELD = 65536


class Device(Protocol):
    """Takes bytes, puts its own into `out`, lives on the clock that it is given."""

    out: bytearray

    def receive(self, data: bytes, now: float) -> None:
        """Bytes from the host at time `now`, s."""
        ...

    def advance(self, now: float) -> None:
        """Carry on until `now`, s."""
        ...


class PtyServer:
    """Serves devices on pseudo-terminals in a thread of its own; a context manager.

    Args:
        devices: one port each; they share the clock, and a later one is served before those it looks at.
        pace: emulated seconds per second.
        links: names (symbolic links) under which the ports stay the same when one is unplugged and comes back.
        faults: what goes wrong, and when.
        wires: what the line from a device, by its number, does to its bytes; the way to it is paced by the same rate.
    """

    def __init__(
        self,
        devices: Sequence[Device],
        *,
        pace: float = 1.0,
        links: Sequence[Path | str] = (),
        faults: Sequence[Fault] = (),
        wires: Mapping[int, Wire] | None = None,
    ) -> None:
        self._from = dict(wires or {})
        self._to = {index: Wire(wire.baudrate) for index, wire in self._from.items()}
        self.devices, self.pace = list(devices), pace
        self.faults = sorted(faults, key=lambda fault: fault.at)
        self._links = [Path(link) for link in links]
        self._ports: list[tuple[int, int] | None] = [None] * len(devices)
        self._back: dict[int, float] = {}
        self._quiet: dict[int, float] = {}
        self._spoil: dict[int, Fault] = {}
        self._stop = threading.Event()
        self._begun = time.monotonic()
        self.error: BaseException | None = None
        for index in range(len(devices)):
            self._plug(index)
        self._thread = threading.Thread(target=self._serve, name="emulator", daemon=True)

    @property
    def ports(self) -> list[str]:
        """Names to open with pyserial."""
        return [str(self._links[i]) if i < len(self._links) else self._slave(i) for i in range(len(self.devices))]

    def __enter__(self) -> PtyServer:
        for device in self.devices:
            device.out.clear()  # what was sent before anybody had the port open is lost, the greeting above all
        self._begun = time.monotonic()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(timeout=2.0)
        for index in range(len(self.devices)):
            self._unplug(index)

    def _slave(self, index: int) -> str:
        port = self._ports[index]
        return "" if port is None else os.ttyname(port[1])

    def _plug(self, index: int) -> None:
        master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        self._ports[index] = master, slave
        if index < len(self._links):
            self._links[index].unlink(missing_ok=True)
            self._links[index].symlink_to(os.ttyname(slave))

    def _unplug(self, index: int) -> None:
        port, self._ports[index] = self._ports[index], None
        if index < len(self._links):
            self._links[index].unlink(missing_ok=True)
        for handle in port or ():
            os.close(handle)

    def _serve(self) -> None:
        try:
            while not self._stop.is_set():
                masters = {port[0]: i for i, port in enumerate(self._ports) if port is not None}
                readable, _, _ = select.select(list(masters), [], [], TICK)
                # read before the clock is: what is answered was true after it was asked, however busy the host is
                heard = [(masters[master], _read(master)) for master in readable]
                wall = time.monotonic() - self._begun
                self._strike(wall)
                # all come to the present first: what one is told now must not show in another's past
                for device in reversed(self.devices):
                    device.advance(wall * self.pace)
                for index, data in heard:
                    self._hear(index, data, wall)
                for index, wire in self._to.items():
                    if data := wire.arrived(wall):
                        self.devices[index].receive(data, wall * self.pace)
                for index, device in enumerate(self.devices):
                    self._speak(index, device, wall)
        except BaseException as error:  # shown to whoever asks why the device fell silent
            self.error = error
            raise

    def _hear(self, index: int, data: bytes, wall: float) -> None:
        if self._ports[index] is None or not data:
            return
        fault = self._spoil.get(index)
        if fault is not None and fault.incoming:
            data = self._spoiled(index, data)
        if index in self._to:
            self._to[index].send(data, wall)
        elif self._quiet.get(index, 0.0) <= wall:
            self.devices[index].receive(data, wall * self.pace)

    def _speak(self, index: int, device: Device, wall: float) -> None:
        port = self._ports[index]
        if port is None or self._quiet.get(index, 0.0) > wall:
            if port is None:
                device.out.clear()
            return
        if index in self._from:
            self._from[index].send(bytes(device.out), wall)
            device.out[:] = self._from[index].arrived(wall)
        if device.out:
            fault = self._spoil.get(index)
            if fault is not None and not fault.incoming:
                device.out[:] = self._spoiled(index, bytes(device.out))
            with suppress(BlockingIOError):
                # a copy: a test may make the device speak from its own thread meanwhile
                sent = os.write(port[0], bytes(device.out))
                del device.out[:sent]
            del device.out[: max(0, len(device.out) - HELD)]

    # faults

    def _strike(self, wall: float) -> None:
        for index, since in list(self._back.items()):
            if since <= wall:
                del self._back[index]
                self._plug(index)
        while self.faults and self.faults[0].at <= wall:
            self._apply(self.faults.pop(0), wall)

    def _apply(self, fault: Fault, wall: float) -> None:
        index = fault.device
        if fault.kind in BYTE_FAULTS:
            self._spoil[index] = fault
        elif fault.kind == "stall":
            self._quiet[index] = wall + fault.duration
        elif fault.kind == "disconnect":
            self._unplug(index)
            if fault.duration:
                self._back[index] = wall + fault.duration
        else:
            fault.act(self.devices[index])

    def _spoiled(self, index: int, data: bytes) -> bytes:
        spoiled, left = self._spoil[index].spoil(data)
        if left <= 0:
            del self._spoil[index]
        return spoiled


def _read(master: int) -> bytes:
    with suppress(BlockingIOError, OSError):  # EIO: nobody has the port open
        return os.read(master, 65536)
    return b""
