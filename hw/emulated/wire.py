"""Wire: what a serial line does to bytes on their way: they leave one after another, and arrive late and in lumps."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from math import ceil

# Start, eight data and stop bit
BITS_PER_BYTE = 10
# An adapter of the FTDI kind hands on a packet when it is full, bytes, or when its timer ends
PACKET = 62


@dataclass
class Wire:
    """One direction of a line.

    Args:
        baudrate: bits per second; 0: at once.
        latency: until the device answers, s.
        timer: of the USB adapter, s: it hands on what it has when this ends; 0: there is none. 16 ms with FTDI's.
    """

    baudrate: int = 0
    latency: float = 0.0
    timer: float = 0.0
    _free: float = field(init=False, default=0.0)  # when the last byte has left
    _under_way: deque[tuple[float, int]] = field(init=False, default_factory=deque)  # arrival at the adapter, byte
    _arrived: bytearray = field(init=False, default_factory=bytearray)
    _flushed: float = field(init=False, default=0.0)

    def send(self, data: bytes, now: float) -> None:
        """Bytes that the sender writes at `now`, s."""
        begin = now + self.latency
        each = BITS_PER_BYTE / self.baudrate if self.baudrate else 0.0
        self._free = max(self._free, begin)
        for byte in data:
            self._free += each
            self._under_way.append((self._free, byte))

    def arrived(self, now: float) -> bytes:
        """What the receiver gets at `now`, s."""
        given = bytearray()
        while self._under_way and self._under_way[0][0] <= now:
            at, byte = self._under_way.popleft()
            if self.timer:
                given += self._lump(at)
            self._arrived.append(byte)
            if self.timer and len(self._arrived) >= PACKET:
                given += self._arrived
                self._arrived.clear()
        given += self._lump(now)
        return bytes(given)

    def _lump(self, now: float) -> bytes:
        """What the adapter hands on: all of it without a timer, else once its timer has ended since the last time."""
        if self.timer:
            if now - self._flushed < self.timer:
                return b""
            self._flushed = self.timer * ceil(now / self.timer - 1.0) if now > 0 else 0.0
        lump = bytes(self._arrived)
        self._arrived.clear()
        return lump
