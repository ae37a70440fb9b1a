"""Real firmwares: what runs on our emulator runs on grblHAL's and Grbl's own simulators.

Where one is said in GRBL_SIMULATOR (grblHAL_sim or grbl_sim.exe; several with os.pathsep between them). A simulator
that the host keeps waiting falls silent, and what falls silent is stopped: give it and us priority over all else, but
no fixed order among ourselves (with chrt -f, whose threads do not share a core, grblHAL's slides passed 1 time in 4;
with nice or chrt -r 5 in 5). With jumps of 20 ms grblHAL's covers less of a sweep than is asked here: build it with
control_frame_ns = 2 * 1000 * 1000.

    nice -n -15 python -m pytest -m slow tests/hw/probing/test_firmware.py
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from conversations import CONVERSATIONS, Real, without_what_is_the_bodys
from firmware import Firmware

from hw.emulated.force import OptoForceEmulator
from hw.emulated.pty_server import PtyServer
from hw.emulated.touched_body import TouchedBody
from hw.grbl.frame import StageFrame
from hw.move import Move
from hw.probing.grbl_finger import GrblFinger
from hw.probing.peck import Peck
from hw.probing.slide import Slide
from hw.sensors.optoforce import OptoForce
from mapping.surface import Surface

R, STIFFNESS, DOWN = 5e-3, 1e4, np.array([0.0, 0.0, -1.0])
FRAME = StageFrame.of((-0.01, -0.01, -0.012))
PROGRAMS = [Path(name) for name in os.environ.get("GRBL_SIMULATOR", "").split(os.pathsep) if name]
# The probe of grblHAL's simulator is a key, looked at every 11 ms of its time, which goes on by jumps of 20 ms; and it
# is pressed when a report says where the tip is. At 1 mm/s contacts lay 28 to 68 um deep: it is up to 70 ms late
PROBING, KEY_LATE = 1e-3, 0.07
SAFE = {"armed": True, "position_known": True, "over_travel": 4e-4}

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not PROGRAMS, reason="no simulator of a firmware: give its path in GRBL_SIMULATOR"),
    pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.name),
]


def plate() -> Surface:
    corners = np.array([[-0.03, -0.03, 0.0], [0.03, -0.03, 0.0], [0.03, 0.03, 0.0], [-0.03, 0.03, 0.0]])
    return Surface(corners, [[0, 1, 2], [0, 2, 3]])


@pytest.fixture
def firmware(program: Path, tmp_path: Path) -> Iterator[Firmware]:
    with Firmware(program, tmp_path, TouchedBody(plate(), R, FRAME, STIFFNESS)) as device:
        yield device


def sweep(y: float) -> Move:
    return Move(np.array([[-2e-3, y, 0.98 * R], [2e-3, y, 0.98 * R]]), DOWN, speed=0.01, force=1.0)


@pytest.mark.parametrize("said", CONVERSATIONS)
def test_classic_grbl_answers_as_the_documents_and_our_emulator_do(firmware: Firmware, said: str) -> None:
    if firmware.has_probe:
        pytest.skip("grblHAL numbers some errors otherwise, and reports more")
    talk = Real(firmware)
    for line, answer in CONVERSATIONS[said]:
        assert without_what_is_the_bodys(talk.answer(line)) == answer, line


def test_pecks(firmware: Firmware) -> None:
    if not firmware.has_probe:
        pytest.skip("this simulator has no probe")
    with PtyServer([firmware]) as server:
        peck = Peck(5e-4, 3e-4, PROBING, R)
        with GrblFinger(port=server.ports[0], tip_radius=R, frame=FRAME, surface=plate(), peck=peck, **SAFE) as finger:
            trace = finger.execute(sweep(0.0))
    assert server.error is None
    off = trace.centers[:, 2] - R
    assert len(trace) >= 24
    assert -PROBING * KEY_LATE < np.median(off) < 4e-6 and np.std(off) < 0.5 * PROBING * KEY_LATE


def test_slides(firmware: Firmware) -> None:
    sensor = OptoForceEmulator(firmware, noise=0.003)  # type: ignore[arg-type]
    with PtyServer([firmware, sensor]) as server:
        slide = Slide(OptoForce(server.ports[1], 400.0), STIFFNESS, approach_speed=5e-3, reach=R)
        with GrblFinger(
            port=server.ports[0], tip_radius=R, frame=FRAME, surface=plate(), slide=slide, **SAFE
        ) as finger:
            traces = [finger.execute(sweep(1e-3 * number)) for number in range(3)]
    assert server.error is None
    assert firmware.strongest < 2.0
    for trace in traces:
        assert np.ptp(trace.centers[:, 0]) > 3.5e-3
        assert np.sqrt(np.mean((trace.centers[:, 2] - R) ** 2)) < 1e-5
