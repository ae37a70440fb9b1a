"""GrblEmulator: a Grbl 1.1 controller and its machine, byte for byte as documented, in memory.

What it does not do: arcs, spindle, parking, overrides, ramps between segments (see hw.emulated.stage).
Reference: gnea/grbl, doc/markdown; realtime bytes are taken out of the stream before it reaches the buffer.
"""

from __future__ import annotations

import re
from collections import deque

import numpy as np

from hw import GcodeError
from hw.emulated.gcode import Block, parse_block
from hw.emulated.stage import Segment, StageMotion
from hw.emulated.touched_body import TouchedBody
from hw.grbl import RECEIVE_BUFFER
from mapping import FloatArray

PLANNER_BLOCKS = 15  # of the planner
WCO_EVERY = 10  # reports of a machine that stands; one that moves tells it less often
SETTINGS = {
    0: 10, 1: 25, 2: 0, 3: 0, 4: 0, 5: 0, 6: 0, 10: 1, 11: 0.010, 12: 0.002, 13: 0, 20: 1, 21: 0, 22: 1, 23: 0,
    24: 25, 25: 500, 26: 250, 27: 1, 30: 1000, 31: 0, 32: 0, 100: 250, 101: 250, 102: 250,
    110: 6000, 111: 6000, 112: 3000, 120: 500, 121: 500, 122: 500, 130: 300, 131: 300, 132: 100,
}  # fmt: skip
INTEGERS = {*range(7), 10, 13, *range(20, 24), 26, 32}


class GrblEmulator:
    """Takes bytes, gives bytes in `out`, moves when its clock is advanced.

    Args:
        body: what the tip touches, machine coordinates.
        position: (3,) tip centre when it is switched on, m, machine coordinates.
        settings: `$` numbers that differ from SETTINGS.
        locked: begin in the alarm state, as after power-up with homing enabled.
        repeatability: standard deviation of the latched position along the probing direction, m.
        seed: of that noise.
        banner: greeting, "Grbl 1.1h" or "GrblHAL 1.1f".
    """

    def __init__(
        self,
        body: TouchedBody,
        position: FloatArray,
        *,
        settings: dict[int, float] | None = None,
        locked: bool = False,
        repeatability: float = 0.0,
        seed: int = 0,
        banner: str = "Grbl 1.1h",
    ) -> None:
        self.settings = {**SETTINGS, **(settings or {})}
        self.body, self.banner, self.repeatability = body, banner, repeatability
        self.motion = StageMotion(position, self.settings[120] * 1e-3, body)
        self.out = bytearray()
        self.lost_bytes = 0
        self._rng = np.random.default_rng(seed)
        self._buffer = bytearray()
        self._replies: deque[str] = deque()
        self.systems = {f"G{n}": np.zeros(3) for n in range(54, 60)}
        self._probed, self._hit = np.zeros(3), False
        self._astray = np.zeros(3)  # what it believes of its position less what is true
        self._dwell: float | None = None
        self.power_up(locked)

    def power_up(self, locked: bool = False) -> None:
        """Switch on (again): what was moving stands still, and the greeting is sent."""
        self.motion.stop()
        self.state = "Alarm" if locked else "Idle"
        self._begin()

    def trip(self, alarm: int) -> None:
        """Raise an alarm: all motion stops at once."""
        self.motion.stop()
        self.state, self._probing, self._dwell = "Alarm", False, None
        self._buffer.clear()
        self._say(f"ALARM:{alarm}")
        if alarm in (1, 2):
            self._say("[MSG:Reset to continue]")

    def lose_position(self) -> None:
        """The supply failed, or steps were lost: it believes to stand at machine zero, and says nothing of it."""
        self._astray = -self.motion.position

    def power_cycle(self) -> None:
        """Switched off and on, without homing enabled: not locked, greets, and takes where it stands for zero."""
        self.power_up()
        self.lose_position()

    def receive(self, data: bytes, now: float) -> None:
        """Bytes from the host; realtime ones act at once."""
        self.advance(now)
        for byte in data:
            if byte in b"?!~\x18" or byte >= 0x80:
                self._realtime(byte)
            elif len(self._buffer) < RECEIVE_BUFFER:
                self._buffer.append(byte)
            else:
                self.lost_bytes += 1
        self.advance(now)

    def advance(self, now: float) -> None:
        """Carry on until `now`, s."""
        self._read_lines()
        while True:
            ended = self.motion.advance(now)
            if ended is not None:
                self._segment_ended(ended)
            self._settle()
            self._read_lines()
            if self.motion.time >= now and (ended is None):
                return

    # messages

    def _begin(self) -> None:
        self._buffer.clear()
        self.modes = {"distance": "G90", "unit": "G21", "system": "G54", "feed": "G94", "plane": "G17"}
        self._motion, self._feed, self._g92 = "G0", 0.0, np.zeros(3)
        self._reports = 0
        self._probing = False
        self._dwell = None  # answered when the queue is empty (its own time is left out)
        self._say("")
        self._say(f"{self.banner} ['$' for help]")
        if self.state == "Alarm":
            self._say("[MSG:'$H'|'$X' to unlock]")

    def _say(self, line: str) -> None:
        self.out += line.encode("ascii") + b"\r\n"

    def _units(self, metres: FloatArray) -> str:
        scale, digits = (1 / 0.0254, 4) if self.settings[13] else (1e3, 3)
        return ",".join(f"{value * scale:.{digits}f}" for value in metres + 0.0)

    def _steps(self, position: FloatArray) -> FloatArray:
        per_metre = np.array([self.settings[100 + axis] * 1e3 for axis in range(3)])
        return np.asarray(np.round(position * per_metre) / per_metre)

    @property
    def position(self) -> FloatArray:
        """(3,) m, machine coordinates: stepping motors stand on their steps, and the step counts are what is told."""
        return self._steps(self.motion.position)

    @property
    def offset(self) -> FloatArray:
        """(3,) work coordinate offset, m."""
        return np.asarray(self.systems[self.modes["system"]] + self._g92)

    def report(self) -> str:
        """The status report."""
        position, mask = self.position + self._astray, int(self.settings[10])
        place = f"MPos:{self._units(position)}" if mask & 1 else f"WPos:{self._units(position - self.offset)}"
        fields = [self.state, place]
        if mask & 2:
            fields.append(f"Bf:{PLANNER_BLOCKS - len(self.motion.queue)},{RECEIVE_BUFFER - len(self._buffer)}")
        speed = self.motion.queue[0].speed * 60e3 if self.motion.queue and not self.motion.held else 0.0
        fields.append(f"FS:{speed:.0f},0")
        if self.motion.probe_closed():
            fields.append("Pn:P")
        # the work offset when it changed, and every ten reports; the overrides in the report after it
        if self._reports % WCO_EVERY == 0:
            fields.append(f"WCO:{self._units(self.offset)}")
        elif self._reports % WCO_EVERY == 1:
            fields.append("Ov:100,100,100")
        self._reports += 1
        return f"<{'|'.join(fields)}>"

    # realtime

    def _realtime(self, byte: int) -> None:
        if byte == ord("?"):
            self._say(self.report())
        elif byte == 0x18:
            self._reset()
        elif byte in (ord("!"), 0x84) and self.state in ("Run", "Jog", "Idle"):
            if self.state == "Jog":
                self._cancel_jog()
            else:
                if byte == 0x84:
                    self._say("[MSG:Check Door]")
                self.motion.brake()
                self.motion.held = True
                name = "Hold" if byte == ord("!") else "Door"
                self.state = f"{name}:{1 if self.motion.braking is not None else 0}"
        elif byte == ord("~") and self.state in ("Hold:0", "Door:0"):
            self.motion.held = False
            self.state = "Run" if self.motion.queue else "Idle"
        elif byte == 0x85 and self.state == "Jog":
            self._cancel_jog()

    def _reset(self) -> None:
        moving = self.motion.braking is not None or (self.motion.busy and not self.motion.held)
        self.motion.stop()
        if moving:
            self._say("ALARM:3")
        self.state = "Alarm" if moving or self.state == "Alarm" else "Idle"
        self._begin()

    def _cancel_jog(self) -> None:
        self.motion.brake()
        while len(self.motion.queue) > 1:
            self.motion.queue.pop()
        if self.motion.braking is not None:
            self.motion.queue[0].end = self.motion.braking

    # motion

    def _segment_ended(self, segment: Segment) -> None:
        if segment.kind == "probe":
            self._probing, self._hit = False, self.motion.latched is not None
            latched = self.motion.position if self.motion.latched is None else self.motion.latched
            if self._hit and self.repeatability:
                way = segment.end - latched
                length = max(float(np.linalg.norm(way)), 1e-12)
                latched = latched + way / length * self.repeatability * self._rng.standard_normal()
            self._probed = self._steps(latched) + self._astray
            self._say(f"[PRB:{self._units(self._probed)}:{int(self._hit)}]")
            self._say("ok")

    def _settle(self) -> None:
        if self._dwell is not None and not self.motion.busy:
            self._dwell = None
            self._say("ok")
        if self.state in ("Hold:1", "Door:2", "Door:1") and self.motion.braking is None:
            self.state = self.state.split(":")[0] + ":0"
        elif self.state in ("Run", "Jog", "Home") and not self.motion.busy:
            self.state = "Idle"

    def _read_lines(self) -> None:
        """Take lines out of the buffer for as long as the parser is free; in a hold none is."""
        while (
            not self.state.startswith(("Hold", "Door"))
            and not self._probing
            and self._dwell is None
            and len(self.motion.queue) < PLANNER_BLOCKS
        ):
            match = re.search(rb"[\r\n]", self._buffer)
            if match is None:
                return
            line = self._buffer[: match.start()].decode("ascii", "replace").strip()
            del self._buffer[: match.end()]
            if not line and match.group() == b"\n":
                continue  # the second half of CR LF; Grbl answers it with an ok of its own, as do we to CR
            self._line(line)

    def _line(self, line: str) -> None:
        try:
            if len(line) > 80:
                raise GcodeError(11)
            if line.startswith("$"):
                self._system(line)
            elif self.state == "Alarm" or self.state == "Jog":
                raise GcodeError(9)
            elif line:
                self._block(parse_block(line))
            if not self._probing and self._dwell is None:
                self._say("ok")
        except GcodeError as error:
            self._say(f"error:{error.number}")

    def _system(self, line: str) -> None:
        text = line.upper().replace(" ", "")
        if text.startswith("$J="):
            self._jog(parse_block(text[3:]))
        elif text == "$X":
            if self.state == "Alarm":
                self._say("[MSG:Caution: Unlocked]")
                self.state = "Idle"
        elif text == "$G":  # in any state
            words = f"{self._motion} {self.modes['system']} G17 {self.modes['unit']} {self.modes['distance']} G94"
            self._say(f"[GC:{words} M5 M9 T0 F{self._feed:.0f} S0]")
        elif self.state not in ("Idle", "Alarm"):
            raise GcodeError(8)
        elif text == "$$":
            for number, value in self.settings.items():
                self._say(f"${number}={value:.0f}" if number in INTEGERS else f"${number}={value:.3f}")
        elif text == "$#":
            self._parameters()
        elif text == "$I":
            self._say("[VER:1.1h.20190825:]")
            self._say("[OPT:V,15,128]")
        elif text == "$H":
            self._home()
        elif match := re.fullmatch(r"\$(\d+)=(-?[\d.]+)", text):
            self._set(int(match[1]), float(match[2]))
        elif text == "$":
            self._say("[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]")
        else:
            raise GcodeError(3 if re.match(r"\$\d", text) else 2)  # anything else is read as the number of a setting

    def _set(self, number: int, value: float) -> None:
        if number not in self.settings:
            raise GcodeError(3)
        if number == 20 and value and not self.settings[22]:
            raise GcodeError(10)
        self.settings[number] = value
        self.motion.acceleration = self.settings[120] * 1e-3

    def _parameters(self) -> None:
        for name, offset in [*self.systems.items(), ("G28", np.zeros(3)), ("G30", np.zeros(3)), ("G92", self._g92)]:
            self._say(f"[{name}:{self._units(offset)}]")
        self._say("[TLO:0.000]")
        self._say(f"[PRB:{self._units(self._probed)}:{int(self._hit)}]")

    def _home(self) -> None:
        if not int(self.settings[22]) & 1:
            raise GcodeError(5)
        self.state = "Idle"
        self._dwell = 0.0
        self.motion.add(Segment(np.full(3, -self.settings[27] * 1e-3), self.settings[25] / 60e3))
        self.state = "Run"

    # g-code

    def _block(self, block: Block) -> None:
        self.modes |= {group: word for group, word in block.modes.items() if group in self.modes}
        self._feed = block.values.get("F", self._feed) * (1.0 if "F" not in block.values else self._unit() * 1e3)
        motion = block.motion or self._motion
        if "G4" in block.once:
            if "P" not in block.values:
                raise GcodeError(28)
            self._dwell = block.values["P"]
            return
        if "G53" in block.once and motion not in ("G0", "G1"):
            raise GcodeError(30)
        self._motion = motion
        if "G10" in block.once or "G92" in block.once:
            self._shift(block)
        elif "G92.1" in block.once:
            self._g92, self._reports = np.zeros(3), 0
        elif block.has_axes:
            self._move(self._target(block, self.modes), motion)
        elif block.motion is not None and block.motion.startswith("G38"):
            raise GcodeError(26)

    def _unit(self) -> float:
        return 0.0254 if self.modes["unit"] == "G20" else 1e-3

    def _target(self, block: Block, modes: dict[str, str]) -> FloatArray:
        unit = 0.0254 if modes["unit"] == "G20" else 1e-3
        target = self.motion.end + self._astray
        for axis, letter in enumerate("XYZ"):
            if letter in block.values:
                value = block.values[letter] * unit
                if "G53" in block.once:
                    target[axis] = value
                elif modes["distance"] == "G91":
                    target[axis] += value
                else:
                    target[axis] = value + self.offset[axis]
        return np.asarray(target - self._astray)

    def _move(self, target: FloatArray, motion: str) -> None:
        way = target - self.motion.end
        length = float(np.linalg.norm(way))
        if motion != "G0" and self._feed <= 0:
            raise GcodeError(22)
        if self._outside(target):
            self.trip(2)
            return
        probing = motion.startswith("G38")
        if probing and length == 0:
            raise GcodeError(33)
        if probing and self.motion.probe_closed() and motion in ("G38.2", "G38.3"):
            self.trip(4)
            return
        if length == 0:
            return
        self._probing = probing
        speed = self._limited(way / length, np.inf if motion == "G0" else self._feed / 60e3)
        self.motion.add(Segment(target, speed, "probe" if probing else "line"))
        self.state = "Run"

    def _limited(self, direction: FloatArray, speed: float) -> float:
        rates = np.array([self.settings[110 + axis] / 60e3 for axis in range(3)])
        share = np.abs(direction)
        return float(min(speed, np.divide(rates, share, out=np.full(3, np.inf), where=share > 1e-12).min()))

    def _outside(self, target: FloatArray) -> bool:
        travel, target = np.array([self.settings[130 + axis] * 1e-3 for axis in range(3)]), target + self._astray
        return bool(self.settings[20]) and bool(((target > 1e-9) | (target < -travel - 1e-9)).any())

    def _jog(self, block: Block) -> None:
        if self.state not in ("Idle", "Jog"):
            raise GcodeError(8 if self.state != "Alarm" else 9)
        if block.motion is not None or "F" not in block.values or not block.has_axes:
            raise GcodeError(22 if "F" not in block.values else 16)
        modes = self.modes | block.modes
        target = self._target(block, modes)
        if self._outside(target):
            raise GcodeError(15)
        way = target - self.motion.end
        length = float(np.linalg.norm(way))
        if length > 0:
            feed = block.values["F"] * (25.4 if modes["unit"] == "G20" else 1.0) / 60e3
            self.motion.add(Segment(target, self._limited(way / length, feed), "jog"))
            self.state = "Jog"

    def _shift(self, block: Block) -> None:
        self._reports = 0
        for axis, letter in enumerate("XYZ"):
            if letter in block.values:
                value = block.values[letter] * self._unit()
                if "G92" in block.once:
                    self._g92[axis] = self.motion.end[axis] - self.systems[self.modes["system"]][axis] - value
                else:
                    name = f"G{53 + int(block.values.get('P', 1))}"
                    here = self.motion.end[axis] - value
                    self.systems[name][axis] = value if block.values.get("L") == 2 else here
