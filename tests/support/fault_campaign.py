"""A fault campaign: sweeps over a plate with true dynamics, one thing going wrong, and what came of it.

Run by itself it prints one line a case: python tests/support/fault_campaign.py [slide | peck] [seeds]
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hw.emulated.faults import BYTE_FAULTS, Fault
from hw.emulated.force import SENSOR_FAULTS, LineSensorEmulator, OptoForceEmulator
from hw.emulated.grbl import GrblEmulator
from hw.emulated.pty_server import PtyServer
from hw.emulated.stage import PROBE_FAULTS
from hw.emulated.touched_body import TouchedBody
from hw.errors import FingerError
from hw.grbl.frame import StageFrame
from hw.move import Move
from hw.probing.grbl_finger import GrblFinger
from hw.probing.peck import Peck
from hw.probing.slide import Slide
from hw.sensors.line_sensor import LineSensor
from hw.sensors.optoforce import OptoForce
from mapping.surface import Surface

# As the issue asks: 10 N/mm and a limit of 5 N; a sample off the plate by more than 20 um is wrong
R, STIFFNESS, LIMIT, OFF = 0.005, 1e4, 5.0, 2e-5
FRAME = StageFrame.of((-0.15, -0.15, -0.05))
DOWN = np.array([0.0, 0.0, -1.0])
PHASES = ("approach", "midway", "retreat")
CONTROLLER_FAULTS = ("reset", "power cycle", "lost position", "hold", "door", "port gone")
CONTROLLER_FAULTS += tuple(f"alarm {number}" for number in range(1, 11))
# The line sensor's frames and the controller's replies are struck; 1 %
BYTES = tuple(f"{kind} 1 %" for kind in BYTE_FAULTS)
# The sensors' rate in this campaign, Hz, and sweeps of a case
RATE, SWEEPS = 1000.0, 3


def plate() -> Surface:
    corners = np.array([[-0.03, -0.03, 0.0], [0.03, -0.03, 0.0], [0.03, 0.03, 0.0], [-0.03, 0.03, 0.0]])
    return Surface(corners, [[0, 1, 2], [0, 2, 3]])


class Witness:
    """Sees the true force all the time, and strikes once the tip is in the phase of the second sweep."""

    def __init__(self, stage: GrblEmulator, phase: str, strike: Callable[[], None]) -> None:
        self.out = bytearray()
        self.stage, self.phase, self.strike = stage, phase, strike
        self.strongest, self.touched, self.struck, self.armed = 0.0, False, 0.0, False
        self.lifted = False

    def receive(self, data: bytes, now: float) -> None: ...

    def advance(self, now: float) -> None:
        self.stage.advance(now)
        position = self.stage.motion.position
        x, _, z = FRAME.to_object(position)
        force = STIFFNESS * max(0.0, R - z)  # on a plate; the body's own answer takes the time of a sample
        self.strongest = max(self.strongest, force)
        if self.struck or not self.armed:
            return
        self.lifted = self.lifted or z > R + 2e-3  # the second sweep begins from above
        if not self.lifted:
            return
        self.touched = self.touched or force > 0.2
        if {
            "approach": z < R + 1e-3 and force == 0.0 and not self.touched,
            "midway": force > 0.2 and abs(x) < 3e-4,
            "retreat": self.touched and x > 2.4e-3 and z > R,
        }[self.phase]:
            self.struck = time.monotonic()
            self.strike()


@dataclass(frozen=True)
class Outcome:
    """What came of a case: largest true force (N), wrong and kept samples, s until it ended, m moved after the stop."""

    strongest: float
    wrong: int
    kept: int
    lasted: float
    moved: float
    struck: bool
    said: str


def run_case(kind: str, phase: str, touch: str, seed: int = 0, model: bool = True) -> Outcome:
    """One case; `touch`: optoforce, line or peck."""
    stage = GrblEmulator(TouchedBody(plate(), R, FRAME, STIFFNESS), np.array([-0.15, -0.15, -0.04]))
    devices: list[object] = [stage]
    if touch != "peck":
        emulator = OptoForceEmulator if touch == "optoforce" else LineSensorEmulator
        devices.append(emulator(stage, noise=0.003, seed=seed))
    faults: list[Fault] = []

    def strike() -> None:
        if kind in SENSOR_FAULTS:
            devices[-1].fault = kind  # type: ignore[attr-defined]
        elif kind in PROBE_FAULTS:
            stage.motion.probe_fault = kind
        elif kind == "reset":
            stage.power_up(locked=True)
        elif kind == "power cycle":
            stage.power_cycle()
        elif kind == "lost position":
            stage.lose_position()
        elif kind.startswith("alarm"):
            stage.trip(int(kind.split()[1]))
        elif kind in ("hold", "door"):
            stage.receive(b"!" if kind == "hold" else b"\x84", stage.motion.time)
            # the operator lets it go on after a second
            threading.Timer(1.0, lambda: stage.receive(b"~", stage.motion.time)).start()
        elif kind == "port gone":
            server.faults.append(Fault("disconnect", at=0.0))
        else:
            name = kind.split()[0]
            server.faults += [
                Fault(name, at=0.0, rate=0.01, seed=seed, device=i) for i in range(len(devices)) if i != 1
            ]

    witness = Witness(stage, phase, strike)
    devices.insert(1, witness)  # the sensor is served before it, and takes its samples at their own times
    said, wrong, kept = "", 0, 0
    with PtyServer(devices, faults=faults) as server:  # type: ignore[arg-type]
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

        def keep(batch: object) -> None:
            nonlocal wrong, kept
            kept += len(batch)  # type: ignore[arg-type]
            wrong += int((np.abs(batch.centers[:, 2] - R) > OFF).sum())  # type: ignore[attr-defined]

        finger.notice = keep
        ended = 0.0
        try:
            with contextlib.suppress(FingerError), finger:
                for number in range(SWEEPS):
                    witness.armed = number >= 1
                    y = 1e-3 * number
                    move = Move(np.array([[-2.5e-3, y, 0.98 * R], [2.5e-3, y, 0.98 * R]]), DOWN, speed=0.01)
                    try:
                        finger.execute(move)
                    except FingerError as error:
                        said = str(error)
                        ended = time.monotonic()
                        break
                    if finger._lost and not ended:
                        ended = time.monotonic()
        except KeyboardInterrupt:
            raise
        said = said or (finger._lost or "")
        time.sleep(0.05)
        still = stage.motion.travelled
        time.sleep(0.2)
        moved = stage.motion.travelled - still
        assert server.error is None, server.error
    lasted = ended - witness.struck if ended and witness.struck else 0.0
    return Outcome(witness.strongest, wrong, kept, lasted, moved, witness.struck > 0.0, said)


def kinds(touch: str) -> tuple[str, ...]:
    """The faults that a finger of that kind can have."""
    return (*(PROBE_FAULTS if touch == "peck" else SENSOR_FAULTS), *CONTROLLER_FAULTS, *BYTES)


if __name__ == "__main__":
    for touch in ("optoforce", "line") if sys.argv[1] == "slide" else sys.argv[1:2]:
        for seed in range(int(sys.argv[2])):
            for kind in kinds(touch) if len(sys.argv) < 4 else sys.argv[3].split(","):
                for phase in PHASES:
                    out = run_case(kind, phase, touch, seed)
                    print(
                        f"{touch:9s} {seed} {kind:14s} {phase:8s} {out.strongest:5.2f} N  wrong {out.wrong:3d} of "
                        f"{out.kept:4d}  {out.lasted:5.1f} s  moved {1e3 * out.moved:.2f} mm"
                        f"{'' if out.struck else '  NOT STRUCK'}  {out.said[:110]}",
                        flush=True,
                    )
