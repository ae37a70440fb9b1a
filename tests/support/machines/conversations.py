"""What one says to a Grbl controller, and what it answers by its documents: to an emulator or a real firmware."""

from __future__ import annotations

import re
import time
from typing import Protocol

import numpy as np
from firmware import Firmware

from hw.emulated.grbl import GrblEmulator

# Line or realtime byte (then everything it says within SETTLED s of the device's time)
CONVERSATIONS: dict[str, list[tuple[str, str]]] = {
    "each line is answered by ok or by its error": [
        ("", "ok"),
        ("G21G90G94", "ok"),
        ("G1X-1", "error:22"),
        ("G2000", "error:20"),
        ("G0G1X1F100", "error:24"),
        ("X", "error:2"),
        ("X1X2", "error:25"),
        ("G1Y1F-1", "error:4"),
        ("$Q", "error:2"),
        ("$999=1", "error:3"),
        ("G4", "error:28"),
        ("G4P0.01", "ok"),
        ("G53G38.3Z-3F100", "error:30"),
    ],
    "a jog has a feed and no motion word, and changes no mode": [
        ("$J=G91X1", "error:22"),
        ("$J=X1F100G1", "error:16"),
        ("$J=G91X-1F600", "ok"),
        ("$J=G53X-2F1000Y-1", "ok"),
        ("?", "<Idle|MPos:-2.000,-1.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>"),
        ("$G", "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0] ok"),
    ],
    "a feed hold of a machine that stands is complete, and no line is read before it ends": [
        ("!", ""),
        ("?", "<Hold:0|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>"),
        ("G4P0.01", ""),
        ("~", "ok"),
        ("?", "<Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100,100>"),
    ],
    "a work offset is told in the next report": [
        ("?", "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>"),
        ("G92X5", "ok"),
        ("?", "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:-5.000,0.000,0.000>"),
        ("G92.1", "ok"),
        ("?", "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>"),
    ],
    "a door stops the machine and says so": [
        ("\x84", "[MSG:Check Door]"),
        ("?", "<Door:0|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>"),
        ("~", ""),
        ("?", "<Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100,100>"),
    ],
}
REALTIME = ("?", "!", "~", "\x84")
SETTLED = 0.5


class Nothing:
    """A body that is nowhere."""

    def force(self, center: object) -> object:
        return np.zeros(3)

    def distance(self, start: object, direction: object) -> float:
        return np.inf


class Talk(Protocol):
    """Somebody who answers."""

    def answer(self, line: str) -> str: ...


class Emulated:
    """Our emulator, at its own time."""

    def __init__(self) -> None:
        settings = {20: 0, 22: 0, 120: 500, 121: 500, 122: 500}
        self._stage = GrblEmulator(Nothing(), np.zeros(3), settings=settings)  # type: ignore[arg-type]
        self._now = 0.0
        self._stage.out.clear()

    def answer(self, line: str) -> str:
        self._stage.receive(_bytes(line), self._now)
        self._now += SETTLED
        self._stage.advance(self._now)
        said = bytes(self._stage.out)
        self._stage.out.clear()
        return _text(said)


class Real:
    """A firmware, at ours."""

    def __init__(self, firmware: Firmware) -> None:
        self._firmware = firmware

    def answer(self, line: str) -> str:
        self._firmware.receive(_bytes(line), 0.0)
        until = time.monotonic() + SETTLED
        while time.monotonic() < until:
            self._firmware.advance(0.0)
            time.sleep(0.002)
        said = bytes(self._firmware.out)
        self._firmware.out.clear()
        return _text(said)


def without_what_is_the_bodys(said: str) -> str:
    """An answer without the inputs that are on: a simulator's pins hang where they like."""
    return re.sub(r"\|Pn:[A-Z]+", "", said)


def _bytes(line: str) -> bytes:
    return line.encode("latin-1") if line in REALTIME else line.encode("latin-1") + b"\n"


def _text(said: bytes) -> str:
    return " ".join(said.decode("latin-1").split("\r\n")).strip()
