"""The line protocol of Grbl 1.1, grblHAL and FluidNC: what its messages mean.

Reference: gnea/grbl, doc/markdown/interface.md, commands.md and jogging.md (Grbl 1.1).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from mapping import FloatArray

MACHINE_STATES = ("Idle", "Run", "Hold", "Jog", "Alarm", "Door", "Check", "Home", "Sleep", "Tool")
STATUS, HOLD, RESUME, RESET, DOOR, JOG_CANCEL = b"?", b"!", b"~", b"\x18", b"\x84", b"\x85"
RECEIVE_BUFFER = 128  # bytes
LENGTH_DIGITS = 4  # of a length in mm: a fortieth of a step of 4 um
# Motion is prepared in segments of so long, s (ACCELERATION_TICKS_PER_SECOND), so many at most (SEGMENT_BUFFER_SIZE
# less one): what is prepared is carried out before a hold, a jog cancel or a closing probe brakes
SEGMENT, SEGMENTS_OF_GRBL, SEGMENTS_OF_GRBLHAL = 0.01, 5, 9

# Grbl 1.1, doc/csv/error_codes_en_US.csv, alarm_codes_en_US.csv, and grblHAL's additions in errors.h, alarms.h
ERRORS = {
    1: "a word has no letter",
    2: "a number is malformed",
    3: "unknown $ command",
    4: "a value must not be negative",
    5: "homing is not enabled ($22=0)",
    6: "the step pulse is too short",
    7: "the settings in the EEPROM were damaged and are the default ones again: check them ($$)",
    8: "this $ command needs an idle machine",
    9: "locked by an alarm or while jogging; unlock ($X) or home ($H) first",
    10: "soft limits need homing to be enabled",
    11: "line too long",
    12: "a step rate beyond what the controller can make",
    13: "the safety door is open",
    14: "the start-up or build line is too long",
    15: "the jog would leave the machine's travel",
    16: "malformed jog",
    17: "laser mode needs a spindle with PWM",
    18: "reset asserted",
    20: "unsupported G-code",
    21: "two words of one modal group in a line",
    22: "no feed rate set",
    23: "this word needs a whole number",
    24: "two commands that both need axis words",
    25: "a word is there twice",
    26: "axis words missing",
    27: "line number out of range",
    28: "a value word is missing",
    29: "no such work coordinate system",
    30: "G53 works with G0 and G1 only",
    31: "axis words without a command that needs them",
    32: "an arc without axis words of its plane",
    33: "the target is not possible, or is where the machine already stands",
    34: "malformed arc",
    35: "an arc without offsets",
    36: "value words that nothing needs",
    37: "a tool length offset for an axis that is not configured for it",
    38: "tool number too large",
}
ALARMS = {
    1: "a hard limit was hit; the position is probably lost: home again ($H)",
    2: "the target lies outside the machine's travel; the position is kept: unlock ($X)",
    3: "reset while moving; the position is lost: home again ($H)",
    4: "the probe was closed before probing began: back off and check its wiring; unlock ($X)",
    5: "the probe met nothing within its way: check that it is connected; unlock ($X)",
    6: "reset while homing: home again",
    7: "the safety door was opened while homing: home again",
    8: "homing could not leave the limit switch: check its wiring, or make the pull-off ($27) longer; home again",
    9: "homing did not find the limit switch: check its wiring and the travel ($130 to $132); home again",
    10: "emergency stop, or homing two motors of one axis failed: release it, reset, home again ($H)",
    11: "homing is required: home the machine ($H)",
    12: "a limit switch is closed: move off it by hand, home again ($H)",
    13: "the probe protection was hit while no probing was under way: back off, reset, check the probe",
    14: "the spindle does not reach its speed; reset",
    15: "homing did not find the second switch of an axis with two motors: check its wiring; home again",
    16: "the self-test at power-on failed: switch it off and on, read its own messages",
    17: "a motor driver reports a fault: check motors and supply, home again ($H)",
    18: "homing failed: home again ($H)",
    19: "a driver of the bus failed: check its cable, switch the machine off and on, home again ($H)",
}


@dataclass(frozen=True, eq=False)
class Status:
    """A status report.

    Args:
        state: Idle, Run, Hold, Jog, Alarm, Door, Check, Home, Sleep (or what else the firmware calls it).
        substate: the number behind the colon, for example 0 in Hold:0; None without one.
        position: (3,) as reported, report units.
        is_machine: True if `position` is in machine, False if in work coordinates.
        offset: (3,) work coordinate offset, if this report has it.
        pins: letters of the inputs that are on; P is the probe.
        blocks, bytes: free planner blocks and receive-buffer bytes, if reported.
    """

    state: str
    substate: int | None
    position: FloatArray
    is_machine: bool
    offset: FloatArray | None = None
    pins: str = ""
    blocks: int | None = None
    bytes: int | None = None

    @property
    def probe_closed(self) -> bool:
        """True if the probe input is on."""
        return "P" in self.pins


@dataclass(frozen=True, eq=False)
class Probed:
    """A [PRB:...] message: (3,) latched machine position in report units, and whether contact was made."""

    position: FloatArray
    hit: bool


@dataclass(frozen=True)
class GrblSettings:
    """What `$$` printed; numbers by their code. Lengths are millimetres whatever the report units are."""

    values: dict[int, float] = field(default_factory=dict)

    @classmethod
    def of(cls, lines: Iterable[str]) -> GrblSettings:
        """From the answer's lines; others (start-up lines, texts) are left out."""
        found = (re.fullmatch(r"\$(\d+)=(-?[\d.]+)(?:\s*\(.*\))?", line) for line in lines)
        return cls({int(m[1]): float(m[2]) for m in found if m})

    @property
    def report_scale(self) -> float:
        """Metres per report unit."""
        return 0.0254 if self.values.get(13, 0.0) else 1e-3

    @property
    def resolution(self) -> float:
        """Step of the reported positions, m: of the motors ($100 to $102), or of the digits if that is coarser."""
        digits = 1e-4 if self.values.get(13, 0.0) else 1e-3
        steps = [1e-3 / count for count in self._three(100) if count > 0]
        return float(max([*steps, digits * self.report_scale]))

    @property
    def max_rate(self) -> FloatArray:
        """(3,) fastest axis speeds, m/s; NaN where the firmware does not say."""
        return self._three(110) * (1e-3 / 60.0)

    @property
    def acceleration(self) -> FloatArray:
        """(3,) axis accelerations, m/s^2; NaN where the firmware does not say."""
        return self._three(120) * 1e-3

    @property
    def travel(self) -> FloatArray:
        """(3,) length of the axes, m; NaN where the firmware does not say."""
        return self._three(130) * 1e-3

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) lowest and highest machine coordinates, m.

        Machine zero is the end of travel that homing finds ($23 tells which end); with Grbl's default build
        all coordinates are negative, with HOMING_FORCE_SET_ORIGIN ($22 bit 3 in grblHAL) zero is at that end.
        """
        travel, mask = self.travel, int(self.values.get(23, 0.0))
        forced = bool(int(self.values.get(22, 0.0)) & 8)
        positive = np.array([bool(mask >> axis & 1) and forced for axis in range(3)])
        return np.stack([np.where(positive, 0.0, -travel), np.where(positive, travel, 0.0)])

    @property
    def soft_limits(self) -> bool:
        """True if the controller itself refuses to leave its travel."""
        return bool(self.values.get(20, 0.0))

    @property
    def homing(self) -> bool:
        """True if the machine has a homing cycle."""
        return bool(int(self.values.get(22, 0.0)) & 1)

    def _three(self, first: int) -> FloatArray:
        return np.array([self.values.get(first + axis, np.nan) for axis in range(3)])


def parse_status(line: str) -> Status | None:
    """The report in a line <...>, or None if it is not a whole one."""
    match = re.fullmatch(r"<([A-Za-z]+)(?::(\d+))?\|([MW])Pos:([-\d.,]+)((?:\|[^|<>]*)*)>", line)
    if match is not None and match[1] not in MACHINE_STATES:
        return None  # garbled: "Jpg" must not pass for a machine that stands
    position = None if match is None else _place(match[4])
    if match is None or position is None:
        return None
    fields = dict(part.split(":", 1) for part in match[5].split("|") if ":" in part)
    blocks, _, free = fields.get("Bf", "").partition(",")
    return Status(
        state=match[1],
        substate=None if match[2] is None else int(match[2]),
        position=position,
        is_machine=match[3] == "M",
        offset=_place(fields["WCO"]) if "WCO" in fields else None,
        pins=fields.get("Pn", ""),
        blocks=int(blocks) if blocks.isdigit() else None,
        bytes=int(free) if free.isdigit() else None,
    )


def parse_probe(line: str) -> Probed | None:
    """The result in a line [PRB:x,y,z:1], or None if it is not one."""
    match = re.fullmatch(r"\[PRB:([-\d.,]+):([01])\]", line)
    position = None if match is None else _place(match[1])
    return None if match is None or position is None else Probed(position, match[2] == "1")


def parse_offset(parameters: Iterable[str], modes: Iterable[str]) -> FloatArray:
    """(3,) work coordinate offset, report units, from the answers to `$#` and `$G`."""
    tables = {}
    for line in parameters:
        match = re.fullmatch(r"\[(G5[4-9](?:\.\d)?|G92|TLO):([-\d.,]+)\]", line)
        if match:
            tables[match[1]] = match[2]
    words = " ".join(modes).strip("[]").removeprefix("GC:").split()
    active = next((word for word in words if re.fullmatch(r"G5[4-9](\.\d)?", word)), "G54")
    offset = np.zeros(3)
    for name in (active, "G92"):
        part = _vector(tables.get(name, ""))
        offset += 0.0 if part is None else part
    length = [float(x) for x in tables.get("TLO", "0").split(",")]
    offset += length[:3] if len(length) >= 3 else [0.0, 0.0, length[0]]
    return offset


# What a machine answers to a jog while it does something else
NOT_IDLE = "error:8"
# and, if it is locked, or jogs while it is sent a line of G-code, to any line
LOCKED = "error:9"


def describe(line: str) -> str:
    """An error or alarm line in words."""
    kind, _, code = line.partition(":")
    table = ALARMS if kind == "ALARM" else ERRORS
    number = int(code) if code.isdigit() else -1
    unknown = "not in the documents of Grbl 1.1 or grblHAL: see the firmware's; reset and home again ($H)"
    return f"{line} ({table.get(number, unknown if number >= 0 else code.strip() or unknown)})"


def firmware_name(lines: Iterable[str]) -> str:
    """What a firmware calls itself in the answer to $I (Grbl, grblHAL, FluidNC) or M115 (Marlin and others); or ""."""
    text = " ".join(lines)
    if match := re.search(r"FIRMWARE_NAME:\s*(.+?)(?=\s+[A-Z_]+:|$)", text):
        return match[1].strip()
    if match := re.search(r"FluidNC v?([\w.-]+)", text):
        return f"FluidNC {match[1]}"
    if match := re.search(r"\[VER:([^:\]]+)", text):
        hal = "HAL" in text.upper() or "[FIRMWARE:grblHAL]" in text
        return f"{'grblHAL' if hal else 'Grbl'} {match[1].strip()}"
    return ""


def prepared(version: str) -> float:
    """What a firmware of that name (`firmware_name`) has prepared of its motion and carries out before it brakes, s.

    Firmwares other than Grbl are taken to prepare as much as grblHAL. One segment more is under way.
    """
    return SEGMENT * (1 + (SEGMENTS_OF_GRBL if version.startswith("Grbl ") else SEGMENTS_OF_GRBLHAL))


def words(axes: FloatArray) -> str:
    """Axis words of a position or displacement in metres, as millimetres to the tenth of a micrometre."""
    return "".join(f"{axis}{value:.{LENGTH_DIGITS}f}" for axis, value in zip("XYZ", 1e3 * axes + 0.0, strict=True))


def rounded(axes: FloatArray) -> FloatArray:
    """A position or displacement, m, as its axis words say it."""
    return np.asarray(np.round(1e3 * axes, LENGTH_DIGITS) * 1e-3)


def feed_word(speed: float) -> str:
    """Feed word of a speed in m/s: mm/min."""
    return f"F{speed * 60e3:.4g}" if speed * 60e3 < 1000 else f"F{speed * 60e3:.0f}"


def _place(text: str) -> FloatArray | None:
    """(3,) of a place as it is reported: always with three decimals (mm) or four (inches); else a digit was lost."""
    parts = [re.fullmatch(r"-?\d+\.(\d{3,4})", part) for part in text.split(",")]
    decimals = {len(part[1]) for part in parts if part is not None}
    return _vector(text) if None not in parts and len(decimals) == 1 else None


def _vector(text: str) -> FloatArray | None:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return None
    return np.array(values[:3]) if len(values) >= 3 else None
