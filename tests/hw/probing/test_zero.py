"""A force sensor's zero that moves while the tip presses: taken off where both ends tell how, doubted where not."""

from __future__ import annotations

import numpy as np
import pytest
from struck_machine import DOWN, FRAME, STIFFNESS, R, plate

from hw.emulated import force
from hw.emulated.force import OptoForceEmulator
from hw.emulated.grbl import GrblEmulator
from hw.emulated.pty_server import PtyServer
from hw.emulated.touched_body import TouchedBody
from hw.errors import FingerError, StoppedError
from hw.move import Move
from hw.probing.grbl_finger import GrblFinger
from hw.probing.slide import Slide
from hw.probing.zero import ZeroLine
from hw.sensors.force_sensor import FreeAir
from hw.sensors.optoforce import OptoForce
from mapping.trace import Trace


def reading(at: float, moved: float, drift: float) -> FreeAir:
    return FreeAir(at, np.array([0.1, 0.2, 0.0]) + moved * DOWN, drift * DOWN)


def test_an_even_drift_is_taken_off_and_hardly_doubted() -> None:
    line = ZeroLine(reading(10.0, 0.0, 0.1), reading(14.0, 0.4, 0.1))
    assert line.offsets(np.array([10.0, 11.0, 14.0])) == pytest.approx(np.outer([0.0, 0.1, 0.4], DOWN))
    assert line.moved == pytest.approx(0.4) and line.doubt == pytest.approx(0.0, abs=1e-12)


def test_a_drift_that_began_or_ended_on_the_way_is_doubted_by_all_that_the_zero_moved() -> None:
    for before, after in ((0.0, 0.1), (0.1, 0.0), (0.0, 0.0)):
        assert ZeroLine(reading(10.0, 0.0, before), reading(14.0, 0.3, after)).doubt == pytest.approx(0.3)


def test_a_noisy_drift_does_not_make_a_zero_doubted_that_has_not_moved() -> None:
    assert ZeroLine(reading(0.0, 0.0, 0.005), reading(60.0, 0.01, -0.005)).doubt == pytest.approx(0.01)


def slid(at_once: bool) -> tuple[Trace, GrblFinger, str]:
    """One sweep of 4 mm in 4 s, and what is said; the sensor drifts from its beginning, or once samples came."""
    stage = GrblEmulator(TouchedBody(plate(), R, FRAME, STIFFNESS), np.array([-0.15, -0.15, -0.044]))
    sensor = OptoForceEmulator(stage, noise=0.003)
    with PtyServer([stage, sensor]) as server:
        slide = Slide(OptoForce(server.ports[1], 400.0), STIFFNESS, approach_speed=5e-3, reach=R)
        safe = {"armed": True, "position_known": True, "over_travel": 4e-4}
        finger = GrblFinger(port=server.ports[0], tip_radius=R, frame=FRAME, slide=slide, **safe)
        with finger:
            if at_once:
                sensor.fault = "drift"
            else:
                finger.notice = lambda batch: setattr(sensor, "fault", "drift")
            path = np.array([[-2e-3, 0.0, 0.98 * R], [2e-3, 0.0, 0.98 * R]])
            trace, said = finger.execute(Move(path, DOWN, speed=1e-3)), ""
            try:
                finger.execute(Move(path[:1] - 5e-3 * DOWN, DOWN, speed=1e-2, purpose="travel"))
            except FingerError as error:
                said = str(error)
    assert server.error is None
    return trace, finger, said


@pytest.mark.slow
def test_a_slow_sweep_with_a_drifting_sensor_is_put_right(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(force, "DRIFT", 0.018)  # N/s: more is refused before the sweep
    trace, finger, said = slid(at_once=True)
    assert not said
    assert 0.07 < finger.slide.zeros.moved < 0.2 and finger.slide.zeros.doubt < 0.05  # type: ignore[union-attr]
    assert np.ptp(trace.centers[:, 0]) > 3.5e-3
    off = trace.centers[:, 2] - R
    assert np.sqrt(np.mean(off**2)) < 2e-6  # 5 um and more if it stayed in


@pytest.mark.slow
def test_a_sweep_in_which_the_zero_goes_astray_is_left_out_and_said() -> None:
    trace, _, said = slid(at_once=False)
    assert len(trace) == 0
    assert "zero moved by" in said and "left out" in said


class Told:
    """A sensor that tells these drifts in turn, and a stage that hears whether it is halted."""

    def __init__(self, *drifts: float) -> None:
        self.drifts, self.listened, self.halted = list(drifts), [], ""
        self.zeroed: FreeAir | None = None
        self.touch_force, self.controller = 0.3, self

    def tare(self, duration: float) -> None:
        self.listened.append(duration)
        self.zeroed = reading(0.0, 0.0, self.drifts.pop(0))

    def halt(self, reason: str) -> None:
        self.halted = reason


def test_a_drift_by_chance_is_listened_to_again_and_one_that_stays_ends_the_run() -> None:
    told = Told(0.03, 0.001)
    slide = Slide(told, STIFFNESS)  # type: ignore[arg-type]
    slide._tare(told, 8.0)  # type: ignore[arg-type]
    assert not told.halted and told.listened == [0.2, 1.0]
    told = Told(0.03, 0.03)
    with pytest.raises(StoppedError, match=r"drifts by 0\.03 N/s"):
        Slide(told, STIFFNESS)._tare(told, 8.0)  # type: ignore[arg-type]
    assert told.halted
