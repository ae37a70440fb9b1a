"""Feeling the way when the host is slow: a stage that is always there before it is asked."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hw.errors import StoppedError
from hw.grbl.frame import StageFrame
from hw.grbl.guarded_stage import GuardedStage

OVER_TRAVEL, STIFFNESS = 2e-4, 1e4
BOUNDS = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])


class SwiftController:
    """Stands at the end of every jog before the next question comes: the host is that slow."""

    def __init__(self) -> None:
        self.place = np.zeros(3)
        self.settings = SimpleNamespace(acceleration=np.full(3, 0.5))
        self.stop_reason: str | None = None

    def jog(self, target: Any, speed: float) -> None:
        self.place = np.array(target)

    def position(self) -> Any:
        return self.place

    resting_position = position

    def status(self) -> Any:
        return SimpleNamespace(state="Idle", position=self.place)

    def machine_position(self, status: Any) -> Any:
        return status.position

    def left(self, count: int) -> None: ...
    def check(self) -> None: ...
    def wait_idle(self, within: float) -> None: ...
    def cancel_jog(self) -> None: ...
    def cancel_now(self) -> None: ...

    def halt(self, reason: str) -> None:
        self.stop_reason = reason


class Spring:
    """A force sensor that feels a plane at z = -1 mm; its samples come `late` s after they are asked for."""

    held_up = ""

    def __init__(self, controller: SwiftController, late: float = 0.0) -> None:
        self.controller, self.late, self.heard, self.felt = controller, late, time.monotonic(), np.zeros(3)
        self.fault, self.watch = None, SimpleNamespace(blind=0.0)

    def touching(self, force: float, touched: Callable[[], None]) -> Any:
        return nullcontext()  # so slow that the host's own look comes first

    @property
    def age(self) -> float:
        return time.monotonic() - self.heard

    def force(self) -> Any:
        return self.felt

    def wait(self, done: Callable[[], bool], within: float) -> bool:
        if self.late > within:
            return False
        self.heard = time.monotonic()
        self.felt = np.array([0.0, 0.0, STIFFNESS * max(0.0, -1e-3 - self.controller.place[2])])
        return done()


def stage_with(late: float) -> GuardedStage:
    controller: Any = SwiftController()
    sensor: Any = Spring(controller, late)
    return GuardedStage(controller, StageFrame.of(), BOUNDS, 0.03, OVER_TRAVEL, sensor)


def test_contact_is_felt_though_the_stage_is_always_there_first() -> None:
    stage = stage_with(0.0)
    where, hit = stage.probe(np.array([0.0, 0.0, -3e-3]), 5e-3)
    assert hit
    assert -1e-3 - OVER_TRAVEL < where[2] < -1e-3, "it ran on into the body"


def test_the_way_is_not_felt_by_a_silent_sensor() -> None:
    stage = stage_with(9.0)
    with pytest.raises(StoppedError, match="no force sample"):
        stage.probe(np.array([0.0, 0.0, -3e-3]), 5e-3)
    assert stage.position()[2] > -1e-3
