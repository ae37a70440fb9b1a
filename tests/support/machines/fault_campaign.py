"""A fault campaign: sweeps over a plate with true dynamics, one thing going wrong, and what came of it.

Run by itself it prints one line a case, and then how many of each fault held:
PYTHONPATH=. python tests/support/machines/fault_campaign.py [slide | peck | optoforce | line | all]
[how many seeds, or from-to] [faults, with commas between]

The device lives in this program, and has no processor of its own: run it on a host with nothing else to do. A case
whose fault never struck is no case: it is made again.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from struck_machine import (
    BAUD,
    BYTES,
    CONTROLLER_FAULTS,
    DOWN,
    FRAME,
    LIMIT,
    MOST,
    OFF,
    PHASES,
    SENSORS,
    STIFFNESS,
    SURVIVABLE,
    R,
    case_line,
    machine_over,
    own_faults,
    plate,
    strike,
)

from hw.emulated.grbl import GrblEmulator
from hw.emulated.pty_server import PtyServer
from hw.emulated.wire import Wire
from hw.errors import FingerError
from hw.move import Move
from hw.probing.grbl_finger import GrblFinger
from hw.probing.peck import Peck
from hw.probing.slide import Slide
from hw.sensors.line_sensor import LineSensor
from hw.sensors.optoforce import OptoForce

# So often is a case made that ends before its fault strikes: the host was too busy to serve the device
MADE = 3
# A zero that drifts while the tip presses shows only when it is in free air again, however long the sweep
UNSEEN_IN_CONTACT = ("drift",)
# What shows in contact only; until the next one the machine lifts, takes its zero and travels, which is no hang
SEEN_IN_CONTACT = ("sign", "gain 10", "gain 0.1", "open")
# What must hold: how long giving up may take, and nothing may move before it, s
LONGEST = 5.0
# The sensors' rate in this campaign, Hz, and sweeps of a case
RATE, SWEEPS = 1000.0, 3


class Witness:
    """Sees the true force all the time, and strikes once the tip is in the phase of the second sweep."""

    def __init__(self, stage: GrblEmulator, phase: str, strike: Callable[[], None]) -> None:
        self.out = bytearray()
        self.stage, self.phase, self.strike = stage, phase, strike
        self.strongest, self.touched, self.struck, self.armed = 0.0, False, 0.0, False
        self.lifted, self.over = False, False
        self.struck_at, self.stood = 0.0, 0.0
        self.felt = 0.0  # when the tip was first in contact since the strike

    def receive(self, data: bytes, now: float) -> None: ...

    def advance(self, now: float) -> None:
        self.stage.advance(now)
        position = self.stage.motion.position
        x, _, z = FRAME.to_object(position)
        force = STIFFNESS * max(0.0, R - z)  # on a plate; the body's own answer takes the time of a sample
        self.strongest = max(self.strongest, force)
        if self.struck and not self.over:
            self.stood = max(self.stood, now - max(self.stage.motion.moved_at, self.struck_at))
        if self.struck and force > 0.2 and not self.felt:
            self.felt = time.monotonic()
        if self.struck or not self.armed:
            return
        self.lifted = self.lifted or z > R + 2e-3  # the second sweep begins from above
        if not self.lifted:
            return
        self.touched = self.touched or force > 0.2
        if {
            "approach": z < R + 1e-3 and force == 0.0 and not self.touched,
            "midway": force > 0.2 and abs(x) < 3e-4,
            "retreat": self.touched and x > 2e-3 and z > R,
        }[self.phase]:
            self.struck, self.struck_at = time.monotonic(), now
            self.strike()


@dataclass(frozen=True)
class Outcome:
    """What came of a case.

    Args:
        kind: the fault.
        strongest: largest true force, N.
        wrong, kept: samples of all sweeps.
        lasted: from the strike, or when it could be felt, until the finger said that it stopped, s; 0 if it went on.
        stood: longest stand of the machine between the strike and the end, s.
        moved: after the finger was left, m.
        struck: whether the fault came to pass.
        said: why it stopped, or "".
    """

    kind: str
    strongest: float
    wrong: int
    kept: int
    lasted: float
    stood: float
    moved: float
    struck: bool
    said: str

    @property
    def broken(self) -> list[str]:
        """What does not hold."""
        found = {
            "not struck": not self.struck,
            "force": self.strongest > MOST,
            "wrong samples": self.wrong > 0,
            "late": self.lasted > LONGEST and self.kind not in SURVIVABLE + UNSEEN_IN_CONTACT,
            "hang": self.stood > LONGEST,
            "moved": self.moved > 0.0,
            "unsaid": not self.said and self.kind not in SURVIVABLE,
        }
        return [name for name, true in found.items() if true]


def run_case(kind: str, phase: str, touch: str, seed: int = 0, model: bool = True) -> Outcome:
    """One case; `touch`: optoforce, line or peck."""
    stage = machine_over(plate(), 0.01)
    devices: list[object] = [stage]
    if touch != "peck":
        devices.append(SENSORS[touch](stage, noise=0.003, seed=seed))
    witness = Witness(stage, phase, lambda: strike(kind, stage, server, devices, seed))
    devices.insert(1, witness)  # the sensor is served before it, and takes its samples at their own times
    said, wrong, kept = "", 0, 0
    with PtyServer(devices, wires={0: Wire(BAUD)}) as server:  # type: ignore[arg-type]
        ports = server.ports
        if touch == "peck":
            feeling: dict[str, object] = {"peck": Peck(5e-4, 5e-4, 0.02, R)}
        else:
            sensor = OptoForce(ports[-1], 400.0) if touch == "optoforce" else LineSensor(ports[-1], rate=RATE)
            feeling = {"slide": Slide(sensor, STIFFNESS, approach_speed=5e-3, reach=R)}
        finger = GrblFinger(
            port=ports[0],
            tip_radius=R,
            frame=FRAME,
            armed=True,
            position_known=True,
            max_force=LIMIT,
            over_travel=4e-4,
            surface=plate() if model else None,
            **feeling,  # type: ignore[arg-type]
        )

        ended = 0.0
        try:
            with contextlib.suppress(FingerError), finger:
                for number in range(SWEEPS):
                    witness.armed = number >= 1
                    y = 1e-3 * number
                    move = Move(np.array([[-2.5e-3, y, 0.98 * R], [2.5e-3, y, 0.98 * R]]), DOWN, speed=0.01)
                    try:
                        felt = finger.execute(move).centers[:, 2]
                    except FingerError as error:
                        said = str(error)
                        break
                    finally:
                        if (said or finger._lost) and not ended:
                            ended, witness.over = time.monotonic(), True
                    kept, wrong = kept + len(felt), wrong + int((np.abs(felt - R) > OFF).sum())
                witness.over = True
        finally:
            ended = ended or (time.monotonic() if said else 0.0)
        said = said or (finger._lost or "")
        time.sleep(0.05)
        still = stage.motion.travelled
        time.sleep(0.2)
        moved = stage.motion.travelled - still
        assert server.error is None, server.error
    since = witness.felt if kind in SEEN_IN_CONTACT else witness.struck
    lasted = ended - since if ended and since else 0.0
    return Outcome(kind, witness.strongest, wrong, kept, lasted, witness.stood, moved, witness.struck > 0.0, said)


def kinds(touch: str) -> tuple[str, ...]:
    """The faults that a finger of that kind can have."""
    return (*own_faults(touch), *CONTROLLER_FAULTS, *BYTES)


def struck_case(kind: str, phase: str, touch: str, seed: int, model: bool = True) -> Iterator[Outcome]:
    """A case, and again if its fault did not strike."""
    for _ in range(MADE):
        out = run_case(kind, phase, touch, seed, model)
        yield out
        if out.struck:
            return


def main(what: str, seeds: range, chosen: tuple[str, ...]) -> None:
    """Print what came of each case, and the table of all that were struck."""
    table: dict[tuple[str, str], list[Outcome]] = {}
    fingers = {"slide": ("optoforce", "line"), "all": ("optoforce", "line", "peck")}
    for seed, touch in product(seeds, fingers.get(what, (what,))):
        for kind, phase in product(chosen or kinds(touch), PHASES):
            for out in struck_case(kind, phase, touch, seed):
                times = f"{out.lasted:5.1f} s, stood {out.stood:4.1f} s"
                case = (touch, seed, kind, phase)
                print(case_line(case, out.strongest, (out.wrong, out.kept), times, out.broken, out.said), flush=True)
            table.setdefault((touch, kind), []).append(out)
    every = [out for cases in table.values() for out in cases]
    print(
        f"\n{sum(not out.broken for out in every)} of {len(every)} cases held, {sum(out.struck for out in every)} were "
        f"struck; strongest {max(out.strongest for out in every):.2f} N; {sum(out.wrong for out in every)} wrong of "
        f"{sum(out.kept for out in every)} samples"
    )
    print("\n| | fault | held | force, N | wrong of kept | longest to the end, s | longest stand, s |")
    print("|---|---|---|---|---|---|---|")
    for (touch, kind), cases in table.items():
        print(
            f"| {touch} | {kind} | {sum(not out.broken for out in cases)} of {len(cases)} | "
            f"{max(out.strongest for out in cases):.2f} | {sum(out.wrong for out in cases)} of "
            f"{sum(out.kept for out in cases)} | {max(out.lasted for out in cases):.1f} | "
            f"{max(out.stood for out in cases):.1f} |"
        )


if __name__ == "__main__":
    first, _, last = sys.argv[2].rpartition("-")
    wanted = range(int(first), int(last) + 1) if first else range(int(last))
    main(sys.argv[1], wanted, tuple(sys.argv[3].split(",")) if len(sys.argv) > 3 else ())
