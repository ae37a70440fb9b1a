"""The conformance suite: our own fingers pass it by the door that anybody's use, and a finger that errs does not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from explore3d.testing import CASES, CONTRACT, NonconformityError, Rig, check
from hw.emulated.faults import Fault
from hw.emulated.force import OptoForceEmulator
from hw.emulated.grbl import GrblEmulator
from hw.emulated.pty_server import PtyServer
from hw.emulated.touched_body import TouchedBody
from hw.errors import FingerError
from hw.grbl.frame import StageFrame
from hw.move import Move
from hw.probing.grbl_finger import GrblFinger
from hw.probing.peck import Peck
from hw.probing.slide import Slide
from hw.sensors.optoforce import OptoForce
from hw.simulated.dynamic_finger import DynamicFinger
from hw.simulated.finger import SimulatedFinger
from mapping.surface import Surface
from mapping.trace import Trace

R, DOWN = 5e-3, np.array([0.0, 0.0, -1.0])
SWEEP = Move(np.array([[-2.5e-3, 0.0, 0.98 * R], [2.5e-3, 0.0, 0.98 * R]]), DOWN, speed=0.01)
FRAME = StageFrame.of((-0.15, -0.15, -0.05))


def plate() -> Surface:
    corners = np.array([[-0.03, -0.03, 0.0], [0.03, -0.03, 0.0], [0.03, 0.03, 0.0], [-0.03, 0.03, 0.0]])
    return Surface(corners, [[0, 1, 2], [0, 2, 3]])


def off(centers: np.ndarray) -> np.ndarray:
    return np.asarray(centers[:, 2] - R)


@contextmanager
def simulated(kind: type[SimulatedFinger] = SimulatedFinger) -> Iterator[Rig]:
    yield Rig(lambda: kind(object=plate(), tip_radius=R), SWEEP, off, 2e-5)


@contextmanager
def machine(slides: bool = False) -> Iterator[Rig]:
    """Our Grbl finger on its emulator."""
    stage = GrblEmulator(TouchedBody(plate(), R, FRAME, 1e4), np.array([-0.15, -0.15, -0.04]))
    devices = [stage, OptoForceEmulator(stage, noise=0.003)] if slides else [stage]
    with PtyServer(devices) as server:

        def made() -> GrblFinger:
            feeling = {"peck": Peck(5e-4, 5e-4, 0.02, R)}
            if slides:
                feeling = {"slide": Slide(OptoForce(server.ports[1], 400.0), 1e4, approach_speed=5e-3, reach=R)}
            safe = {"armed": True, "position_known": True, "surface": plate(), "over_travel": 4e-4}
            return GrblFinger(port=server.ports[0], tip_radius=R, frame=FRAME, **safe, **feeling)  # type: ignore[arg-type]

        def stop() -> None:
            stage.trip(3)

        def dead() -> None:
            if slides:
                devices[1].fault = "zero"  # type: ignore[union-attr]
            else:
                stage.motion.probe_fault = "open"

        faults: dict[str, Callable[[], None]] = {
            "gone": lambda: server.faults.append(Fault("disconnect", at=0.0)),
            "silent": lambda: server.faults.append(Fault("stall", at=0.0, duration=60.0)),
            "stopped": stop,
            "restarted": lambda: stage.power_up(locked=True),
            "dead": dead,
            "garbled": lambda: server.faults.append(Fault("garble", at=0.0, rate=0.01)),
        }
        if slides:
            faults["frozen"] = lambda: setattr(devices[1], "fault", "frozen")
        yield Rig(made, SWEEP, off, 2e-5, lambda: stage.motion.travelled, faults=faults)
    assert server.error is None


@pytest.mark.parametrize("case", CONTRACT)
@pytest.mark.parametrize("kind", [SimulatedFinger, DynamicFinger])
def test_the_simulated_fingers_keep_the_contract(kind: type[SimulatedFinger], case: str) -> None:
    assert check(case, lambda: simulated(kind))


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("slides", [False, True])
def test_our_machine_conforms(slides: bool, case: str) -> None:
    if not check(case, lambda: machine(slides)):
        assert not slides and case.startswith("frozen")


class _Still:
    """A device that a finger moves, and what its finger does wrong."""

    def __init__(self, wrong: str) -> None:
        self.wrong, self.way, self.failed = wrong, 0.0, False


class _Erring(SimulatedFinger):
    device: _Still

    def __enter__(self) -> _Erring:
        self.device.way += self.device.wrong == "moves unasked"
        return self

    def execute(self, move: Move) -> Trace:
        wrong = self.device.wrong
        if wrong == "refuses nothing" and (move.path > 1.0).any():
            return super().execute(SWEEP)
        if self.device.failed:
            if wrong == "tells nothing":
                return super().execute(move)
            if wrong == "tells lies":
                felt = super().execute(move)
                return replace(felt, centers=felt.centers + 1e-4)
            raise FingerError("the device\nis lost" if wrong == "rambles" else "the device is lost; plug it in")
        felt = super().execute(move)
        self.device.way += 0.01
        if wrong == "repeats its number" and len(felt):
            return replace(felt, sweep=np.zeros(len(felt), dtype=np.int64))
        if wrong == "talks on its way" and move.purpose == "travel":
            return super().execute(SWEEP)
        return felt

    @property
    def info(self) -> dict[str, object]:
        return {"kind": "erring", "place": np.zeros(3)} if self.device.wrong == "no JSON" else super().info


@pytest.mark.parametrize(
    ("wrong", "case", "told"),
    [
        ("no JSON", "says what it is", "JSON"),
        ("moves unasked", "moves nothing unasked", "connecting and leaving moved"),
        ("repeats its number", "feels the body", "two sweeps have one number"),
        ("talks on its way", "feels nothing on its way", "a travel gave samples"),
        ("refuses nothing", "refuses what exceeds its limits", "leaves the workspace"),
        ("tells nothing", "gone, midway", "no FingerError has said so"),
        ("tells lies", "garbled, midway", "um off"),
        ("rambles", "gone, early", "one line"),
    ],
)
def test_a_finger_that_errs_is_told_what_is_wrong(wrong: str, case: str, told: str) -> None:
    @contextmanager
    def rig() -> Iterator[Rig]:
        device = _Still(wrong)

        def made() -> SimulatedFinger:
            finger = _Erring(object=plate(), tip_radius=R)
            finger.device = device
            return finger

        def fail() -> None:
            device.failed = True

        yield Rig(made, SWEEP, off, 1e-6, lambda: device.way, faults={"gone": fail, "garbled": fail})

    with pytest.raises(NonconformityError, match=told):
        check(case, rig)


def test_a_fault_that_the_rig_has_not_is_told_apart_from_one_that_was_survived() -> None:
    assert check("silent, midway", simulated) is False
