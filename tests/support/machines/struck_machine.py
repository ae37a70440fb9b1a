"""A machine over a plate, what goes wrong with it on purpose, and the line that tells what came of a case."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from hw.emulated.faults import BYTE_FAULTS, Fault
from hw.emulated.force import SENSOR_FAULTS, LineSensorEmulator, OptoForceEmulator
from hw.emulated.grbl import GrblEmulator
from hw.emulated.pty_server import PtyServer
from hw.emulated.stage import PROBE_FAULTS
from hw.emulated.touched_body import TouchedBody
from hw.emulated.wire import Wire
from hw.grbl.controller import GrblController
from hw.grbl.frame import StageFrame
from mapping.surface import Surface

# As the issue asks: 10 N/mm and a limit of 5 N; a sample off the plate by more than 20 um is wrong
R, STIFFNESS, LIMIT, OFF = 0.005, 1e4, 5.0, 2e-5
# What must hold: the true force at that limit, N
MOST = 5.5
FRAME = StageFrame.of((-0.15, -0.15, -0.05))
DOWN = np.array([0.0, 0.0, -1.0])
# The stage answers at the usual rate of a serial port, bits per second: no faster than a real one
BAUD = 115200
PHASES = ("approach", "midway", "retreat")
CONTROLLER_FAULTS = ("reset", "power cycle", "lost position", "hold", "door", "port gone", "second program")
CONTROLLER_FAULTS += tuple(f"alarm {number}" for number in range(1, 11))
# The line sensor's frames and the controller's replies are struck
BYTES = tuple(f"{kind} 1 %" for kind in BYTE_FAULTS)
# Faults that a finger may go on after: the operator lets go of the machine, what is garbled is asked for again, a probe
# that bounces is touched with again
SURVIVABLE = (*BYTES, "hold", "door", "bouncing")
# What another program says to a machine that it takes for its own: it looks round, and sets its zero
SECOND_PROGRAM = b"?\n$$\n$#\nG10L20P1Z0\n"
# An operator lets the machine go on after so long, and a cable is back, s
LET_GO = 1.0
SENSORS = {"optoforce": OptoForceEmulator, "line": LineSensorEmulator}


def plate(x: float = 0.03, y: float = 0.03) -> Surface:
    """A plate of twice these lengths, m."""
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return Surface(corners, [[0, 1, 2], [0, 2, 3]])


def machine_over(surface: Surface, height: float) -> GrblEmulator:
    """A machine whose tip stands so high, m, above the middle of a body."""
    return GrblEmulator(TouchedBody(surface, R, FRAME, STIFFNESS), FRAME.to_machine(np.array([0.0, 0.0, height])))


@contextmanager
def standing_machine(latency: float | None = None) -> Iterator[tuple[GrblEmulator, GrblController]]:
    """A controller that stands high over a plate, where it was homed.

    Over a line of 115200 baud with some latency, s, if one is told; else without a line.
    """
    stage = machine_over(plate(), 0.02)
    with PtyServer([stage], wires={} if latency is None else {0: Wire(BAUD, latency)}) as server:
        controller = GrblController(server.ports[0])
        controller.open()
        controller.vouch()
        try:
            yield stage, controller
        finally:
            controller.close()
    assert server.error is None, server.error


def own_faults(touch: str) -> tuple[str, ...]:
    """The faults of what feels."""
    return PROBE_FAULTS if touch == "peck" else SENSOR_FAULTS


def strike(kind: str, stage: GrblEmulator, server: PtyServer, devices: list[object], seed: int = 0) -> None:
    """Make that go wrong now; the sensor, if there is one, is the last of the devices."""
    struck = [i for i, device in enumerate(devices) if isinstance(device, (GrblEmulator, *SENSORS.values()))]
    if kind in SENSOR_FAULTS:
        devices[struck[-1]].fault = kind  # type: ignore[attr-defined]
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
        threading.Timer(LET_GO, lambda: stage.receive(b"~", stage.motion.time)).start()
    elif kind == "second program":
        stage.receive(SECOND_PROGRAM, stage.motion.time)
    elif kind in ("port gone", "port back"):
        server.faults.append(Fault("disconnect", at=0.0, duration=LET_GO if kind == "port back" else 0.0))
    else:
        name = kind.split()[0]
        server.faults += [Fault(name, at=0.0, rate=0.01, seed=seed, device=i) for i in struck]


def case_line(
    case: tuple[str, int, str, str],
    strongest: float,
    samples: tuple[int, int],
    times: str,
    broken: list[str],
    why: str,
) -> str:
    """What came of a case: finger, number, fault and phase; largest true force, N; wrong and kept samples."""
    touch, number, kind, phase = case
    wrong, kept = samples
    return (
        f"{touch:9s} {number} {kind:14s} {phase:8s} {strongest:5.2f} N  wrong {wrong:3d} of {kept:5d}  {times}  "
        f"{', '.join(broken) or 'held'}: {why[:170]}"
    )
