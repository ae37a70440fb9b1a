"""Framing: cutting a stream of bytes into lines or checked frames, and finding the way back after garbage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol


@dataclass
class Counts:
    """What a stream brought: `frames` good ones, `garbage` bytes thrown away, `bad` frames of a wrong check."""

    frames: int = 0
    garbage: int = 0
    bad: int = 0


class Framing(Protocol):
    """Cuts bytes into frames; keeps what is incomplete."""

    counts: Counts

    def feed(self, data: bytes) -> list[bytes]:
        """The frames that are complete now."""
        ...


@dataclass
class Lines:
    """Lines that end in CR, LF or both; empty ones are left out.

    A line that is longer than `longest` bytes or holds bytes outside printable ASCII is counted as bad and
    thrown away: a garbled answer must not be mistaken for another.
    """

    longest: int = 1024
    counts: Counts = field(default_factory=Counts)
    _rest: bytes = b""

    def feed(self, data: bytes) -> list[bytes]:
        """The complete lines without their ends."""
        *lines, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if len(self._rest) > self.longest:
            self.counts.garbage += len(self._rest)
            self._rest = b""
        good: list[bytes] = []
        bad: list[bytes] = []
        for line in filter(None, lines):
            (good if len(line) <= self.longest and _printable(line) else bad).append(line)
        self.counts.frames += len(good)
        self.counts.bad += len(bad)
        self.counts.garbage += sum(map(len, bad))
        return good


@dataclass
class Frames:
    """Frames of a fixed length that begin with a header and pass a check.

    Bytes before a header are garbage. After a wrong check the search goes on one byte behind that header,
    so that a good frame that begins inside a broken one is still found.

    Args:
        header: first bytes of every frame.
        length: of a whole frame, header included.
        check: is this frame whole and right?
        check_all: are all of these frames, one behind another, whole and right, headers included? Told at once, as it
            nearly always is; else they are looked at one by one. None: they always are.
    """

    header: bytes
    length: int
    check: Callable[[bytes], bool]
    check_all: Callable[[bytes], bool] | None = None
    counts: Counts = field(default_factory=Counts)
    _rest: bytes = b""

    def feed(self, data: bytes) -> list[bytes]:
        """The complete frames, headers included."""
        buffer, at, good = self._rest + data, 0, []
        end = len(buffer) - len(buffer) % self.length
        if self.check_all is not None and end and self.check_all(buffer[:end]):
            good = [buffer[first : first + self.length] for first in range(0, end, self.length)]
            self._rest = buffer[end:]
            self.counts.frames += len(good)
            return good
        while True:
            found = at if buffer.startswith(self.header, at) else buffer.find(self.header, at)
            if found < 0:
                # the last bytes may be the beginning of a header that is still to come
                found = max(at, len(buffer) - len(self.header) + 1)
                self.counts.garbage += found - at
                break
            self.counts.garbage += found - at
            at = found
            if len(buffer) - at < self.length:
                break
            frame = buffer[at : at + self.length]
            if self.check(frame):
                good.append(frame)
                at += self.length
            else:
                self.counts.bad += 1
                self.counts.garbage += 1
                at += 1
        self._rest = buffer[found:]
        self.counts.frames += len(good)
        return good


_PRINTABLE = bytes((9, *range(32, 127)))


def _printable(line: bytes) -> bool:
    return not line.translate(None, _PRINTABLE)
