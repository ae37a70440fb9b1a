"""A force that goes wrong by less than a jump: what was felt since the last test of it is not kept."""

from __future__ import annotations

import numpy as np
import pytest
from struck_machine import DOWN, FRAME, MOST, STIFFNESS, R, machine_over, plate

from hw.emulated.force import OptoForceEmulator
from hw.emulated.pty_server import PtyServer
from hw.errors import FingerError
from hw.move import Move
from hw.probing.grbl_finger import GrblFinger
from hw.probing.slide import Slide
from hw.sensors.optoforce import OptoForce
from mapping.trace import Trace

pytestmark = pytest.mark.slow


def slid(fault: str, force: float) -> tuple[list[Trace], Trace, str, float]:
    """What was told on the way, what came of it, what was said then, and the strongest true force, N."""
    stage = machine_over(plate(), 0.006)
    sensor = OptoForceEmulator(stage, noise=0.05)  # a tenth of it is no frozen value yet
    told: list[Trace] = []
    with PtyServer([stage, sensor]) as server:
        slide = Slide(OptoForce(server.ports[1], 400.0), STIFFNESS, approach_speed=5e-3, reach=R)
        safe = {"armed": True, "position_known": True, "over_travel": 4e-4, "surface": plate()}
        finger = GrblFinger(port=server.ports[0], tip_radius=R, frame=FRAME, slide=slide, **safe)

        def notice(batch: Trace) -> None:
            told.append(batch)
            sensor.fault = fault

        finger.notice = notice
        with finger:
            path = np.array([[-1e-2, 0.0, 0.98 * R], [1e-2, 0.0, 0.98 * R]])
            trace, said = finger.execute(Move(path, DOWN, speed=1e-2, force=force)), ""
            try:
                finger.execute(Move(path[:1] - 5e-3 * DOWN, DOWN, speed=1e-2, purpose="travel"))
            except FingerError as error:
                said = str(error)
    assert server.error is None
    return told, trace, said, sensor.strongest


@pytest.mark.parametrize(("fault", "force", "why"), [("gain 0.1", 0.5, "sank"), ("sign", 0.25, "pulls")])
def test_a_force_that_is_found_untrue_takes_its_sweep_back(fault: str, force: float, why: str) -> None:
    told, trace, said, strongest = slid(fault, force)
    assert told and why in said
    assert len(trace) == 0
    assert strongest < MOST
