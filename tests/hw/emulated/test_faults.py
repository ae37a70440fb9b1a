"""What goes wrong between driver and device: no hang, no motion after the stop, a whole log, a free port, a reason."""

from __future__ import annotations

import os
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from explore3d.log.own.reader import read_log
from explore3d.log.own.writer import LogWriter
from hw.emulated.faults import FAULT_KINDS, Fault
from hw.emulated.force import OptoForceEmulator
from hw.emulated.grbl import GrblEmulator
from hw.emulated.pty_server import PtyServer
from hw.emulated.touched_body import TouchedBody
from hw.errors import FingerError
from hw.framing import Lines
from hw.grbl.frame import StageFrame
from hw.link import Link
from hw.move import Move
from hw.probing.grbl_finger import GrblFinger
from hw.probing.peck import Peck
from hw.probing.slide import Slide
from hw.sensors.optoforce import OptoForce
from mapping.surface import Surface

R, STIFFNESS, LIMIT = 0.005, 1e4, 4.0
FRAME = StageFrame.of((-0.15, -0.15, -0.05))
DOWN = np.array([0.0, 0.0, -1.0])
# Connecting, sweeping, giving up and leaving must all be over by then, s, on a host that is busy otherwise: without
# a fault they take half of it
LONGEST = 30.0
# Emulated seconds a second while it pecks: the sweeps last 100 s, for the tip may run on by no more than 0.1 mm
PECKING_PACE = 10.0


def plate() -> Surface:
    corners = np.array([[-0.03, -0.03, 0.0], [0.03, -0.03, 0.0], [0.03, 0.03, 0.0], [-0.03, 0.03, 0.0]])
    return Surface(corners, [[0, 1, 2], [0, 2, 3]])


def sweep(number: int) -> Move:
    y = 1e-3 * number
    return Move(np.array([[-0.004, y, 0.98 * R], [0.004, y, 0.98 * R]]), DOWN, speed=0.01)


def survive(fault: Fault, slide: bool, folder: Path) -> str:
    """Sweep through a fault, check everything that must hold whatever it is, and return what was said."""
    stage = GrblEmulator(TouchedBody(plate(), R, FRAME, STIFFNESS), np.array([-0.15, -0.15, -0.035]))
    sensor = OptoForceEmulator(stage, noise=0.003)
    links = [folder / "stage", folder / "sensor"]
    devices = [stage, sensor] if slide else [stage]
    said, begun, written = "", time.monotonic(), 0
    with PtyServer(devices, pace=1.0 if slide else PECKING_PACE, links=links[: len(devices)], faults=[fault]) as server:
        touch = (
            {"slide": Slide(OptoForce(str(links[1]), 400.0), STIFFNESS, approach_speed=5e-3)}
            if slide
            else {"peck": Peck(5e-4, 5e-4, 0.02, R)}
        )
        finger = GrblFinger(
            port=str(links[0]),
            tip_radius=R,
            frame=FRAME,
            armed=True,
            position_known=True,
            max_force=LIMIT,
            over_travel=1e-4,
            **touch,
        )
        # a garbled byte may hold the machine (`!`), and only somebody beside it can let it go on
        finger.waiting = lambda what: stage.receive(b"~", stage.motion.time)
        with ExitStack() as stack:
            log = stack.enter_context(LogWriter(folder / "log.mcap", tip_radius=R))
            try:
                with finger:
                    for number in range(4):
                        move = sweep(number)
                        trace = finger.execute(move)
                        log.write(move, trace)
                        written += len(trace)
            except FingerError as error:
                said = str(error)
        said = said or (finger._lost or "")
        time.sleep(0.1)
        still = stage.motion.travelled
        time.sleep(0.15)
        assert stage.motion.travelled == still or fault.kind == "disconnect", "it moved on after the finger was left"
        assert time.monotonic() - begun < LONGEST
        handles = [os.path.realpath(f"/proc/self/fd/{fd}") for fd in os.listdir("/proc/self/fd")]
        ours = [port for port in server.ports if os.path.lexists(port)]
        # the emulator itself holds the slave's side once
        assert all(handles.count(os.path.realpath(port)) <= 1 for port in ours), "a port was not let go of"
        for port in ours:
            Link(port, Lines(), lambda now, lines: None).open().close()
        if slide:
            # the limit, and what one control period (or the braking distance) adds
            beyond = STIFFNESS * (0.022 * 0.01 + 1e-4)
            assert sensor.strongest < LIMIT + beyond
    assert server.error is None
    if written:  # a log without a sample is refused on reading
        record = read_log(folder / "log.mcap")
        assert record.complete and len(record.trace) == written
    return said


@pytest.mark.parametrize(
    "kind", ["disconnect", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("reset", "alarm"))]
)
def test_one_fault_of_each_kind_is_survived(kind: str, tmp_path: Path) -> None:
    said = survive(Fault(kind, at=0.9, duration=3.0, count=40, seed=1), False, tmp_path)
    if kind in ("reset", "disconnect", "alarm", "stall"):
        assert len(said) > 20, "nothing was said"


@pytest.mark.slow
def test_a_sensor_that_comes_back_costs_a_sweep_and_no_more(tmp_path: Path) -> None:
    stage = GrblEmulator(TouchedBody(plate(), R, FRAME, STIFFNESS), np.array([-0.15, -0.15, -0.035]))
    links = [tmp_path / "stage", tmp_path / "sensor"]
    devices = [stage, OptoForceEmulator(stage, noise=0.003)]
    pulled = Fault("disconnect", at=1e9, device=1, duration=0.3)
    with PtyServer(devices, links=links, faults=[pulled]) as server:
        slide = Slide(OptoForce(str(links[1]), 400.0), STIFFNESS, approach_speed=5e-3)
        finger = GrblFinger(
            port=str(links[0]), tip_radius=R, frame=FRAME, armed=True, position_known=True, max_force=LIMIT, slide=slide
        )
        with finger:
            whole = finger.execute(sweep(0))
            finger.notice = lambda batch: setattr(server.faults[0], "at", 0.0) if server.faults else None
            cut = finger.execute(sweep(1))
            assert len(cut) and np.ptp(cut.centers[:, 0]) < 0.9 * np.ptp(whole.centers[:, 0])
            again = finger.execute(sweep(2))
            assert np.ptp(again.centers[:, 0]) > 0.9 * np.ptp(whole.centers[:, 0])
            assert again.t[0] > cut.t[-1]
            assert np.median(np.abs(again.centers[:, 2] - R)) < 2e-5
            assert slide.sensor.link.reconnections == 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", FAULT_KINDS)
@pytest.mark.parametrize("number", range(34))
def test_random_faults_are_survived(kind: str, number: int, tmp_path: Path) -> None:
    rng = np.random.default_rng((FAULT_KINDS.index(kind), number))
    slide = number % 2 == 1
    device = int(rng.integers(2)) if slide else 0
    survive(Fault.random(kind, rng, 3.0, device), slide, tmp_path)
