"""A controller that restarted refuses what it is sent: said first is that it restarted, and not what it refused."""

from __future__ import annotations

import re
import time

import numpy as np
import pytest
from fault_campaign import struck_case
from struck_machine import PHASES, standing_machine

from hw.emulated.grbl import GrblEmulator
from hw.errors import StoppedError
from hw.grbl.controller import GrblController

# What the firmwares greet with, as their documents print it
GREETINGS = (
    "Grbl 1.1h ['$' for help]",
    "GrblHAL 1.1f ['$' or '$HELP' for help]",
    "Grbl 3.7 [FluidNC v3.7.8 (wifi) '$' for help]",
)


def lock(stage: GrblEmulator, greeting: str) -> None:
    """Restart it, locked; the greeting may be lost."""
    stage.motion.stop()
    stage.state = "Alarm"
    stage.out += greeting.encode("ascii") + b"\r\n"


def sent_jog(controller: GrblController, after: int) -> None:
    """Send a jog, and wait until it is answered."""
    controller._sent.append(30)
    controller.link.write(b"$J=G21G91X0.0100F100\n")
    until = time.monotonic() + 2.0
    while len(controller._answers) <= after and time.monotonic() < until:
        time.sleep(0.001)
    assert controller._answers[-1] == "error:9"


@pytest.mark.parametrize("greeting", GREETINGS)
def test_a_jog_that_a_restarted_controller_refuses_says_that_it_restarted(greeting: str) -> None:
    with standing_machine() as (stage, controller):
        lock(stage, greeting)
        sent_jog(controller, 0)
        with pytest.raises(StoppedError, match=r"restarted.*home it"):
            controller._settle_answers()
        assert not controller.vouched
        assert stage.motion.travelled == 0.0


def test_a_locked_controller_whose_greeting_was_lost_is_trusted_no_more() -> None:
    with standing_machine() as (stage, controller):
        lock(stage, "")
        sent_jog(controller, 0)
        with pytest.raises(StoppedError, match=r"is locked \(state Alarm\).*nobody knows where it stands.*home it"):
            controller._settle_answers()
        assert not controller.vouched
        with pytest.raises(StoppedError, match="is locked"):  # and stays so
            controller.move(np.array([-0.1, -0.1, -0.01]), 0.01, 2.0)
        assert stage.motion.travelled == 0.0


def test_a_jog_that_seems_refused_by_a_controller_that_is_not_locked_was_anothers_line() -> None:
    with standing_machine() as (stage, controller):
        controller.jog(controller.resting_position() + np.array([1e-2, 0.0, 0.0]), 0.01)
        stage.receive(b"G10L20P1Z0\n", stage.motion.time)
        with pytest.raises(StoppedError, match=r"another program, or a pendant"):
            controller.wait_idle(3.0)
        assert not controller.vouched


def test_a_line_that_a_locked_controller_refuses_says_so_too() -> None:
    with standing_machine() as (stage, controller):
        lock(stage, "")
        with pytest.raises(StoppedError, match="is locked"):
            controller.command("G90G4P0.001")


@pytest.mark.parametrize(
    ("touch", "phase"),
    [
        pytest.param(touch, phase, marks=() if (touch, phase) == ("line", "midway") else pytest.mark.slow)
        for touch in ("line", "optoforce", "peck")
        for phase in PHASES
    ],
)
def test_a_slide_in_whose_midst_the_controller_restarts_says_so_first(touch: str, phase: str) -> None:
    *_, out = struck_case("reset", phase, touch, seed=0)
    assert not out.broken, out
    assert re.match(r"\S+: the controller restarted, so nobody knows where it stands; .*home it", out.said), out.said
