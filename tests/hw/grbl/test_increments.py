"""Motions are sent as ways from where the last one ends: they add up exactly, and lead a restarted machine nowhere."""

from __future__ import annotations

import time

import numpy as np
import pytest
from struck_machine import FRAME, standing_machine

from hw.emulated.gcode import Block, GcodeError
from hw.errors import FingerError, StoppedError
from hw.grbl.guarded_stage import GuardedStage

# Grbl's motors stand on steps of 4 um
STEP = 4e-6


@pytest.mark.slow
@pytest.mark.parametrize("latency", [0.0, pytest.param(5e-3, marks=pytest.mark.slow)])
def test_a_thousand_jogs_arrive_where_the_last_was_to_end(latency: float) -> None:
    with standing_machine(latency) as (stage, controller):
        begun = controller.resting_position()
        for number in range(1, 1001):
            controller.jog(begun + number * np.array([3.333e-6, -1.111e-6, 2.2222e-6]), 5e-3)
        controller.wait_idle(10.0)
        went = stage.motion.position - begun
    # half of a digit of what was sent; that a step hides where it began is common to all
    assert np.abs(went - 1000 * np.array([3.333e-6, -1.111e-6, 2.2222e-6])).max() < 0.5 * STEP + 5e-8


def test_a_jog_that_is_refused_in_the_midst_of_others_is_made_up_for(monkeypatch: pytest.MonkeyPatch) -> None:
    with standing_machine(0.0) as (stage, controller):
        jog, refused = stage._jog, []

        def jog_but_once(block: Block) -> None:  # grblHAL between two jogs: its state is Run for some milliseconds
            if not refused:
                refused.append(block)
                raise GcodeError(8)
            jog(block)

        guarded = GuardedStage(controller, FRAME, controller.settings.bounds, 0.02, 4e-4)
        here = guarded.resting()
        monkeypatch.setattr(stage, "_jog", jog_but_once)
        guarded.creep(here + np.array([1e-4, 0.0, 0.0]))
        guarded.creep(here + np.array([2e-4, 0.0, 0.0]))
        assert refused
        assert np.abs(FRAME.to_object(stage.motion.position) - here - [2e-4, 0.0, 0.0]).max() < STEP
        assert stage.motion.travelled < 2.1e-4


def test_a_jog_that_leads_nowhere_is_refused_out_loud(monkeypatch: pytest.MonkeyPatch) -> None:
    with standing_machine(0.0) as (stage, controller):

        def beyond(block: Block) -> None:
            raise GcodeError(15)

        monkeypatch.setattr(stage, "_jog", beyond)
        here = controller.resting_position()
        with pytest.raises(FingerError, match="a jog was refused: error:15"):
            controller.jog(here + np.array([1e-4, 0.0, 0.0]), 5e-3)
            controller.wait_idle(2.0)


def test_a_jog_whose_line_was_lost_is_made_up_for_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    with standing_machine(0.0) as (stage, controller):
        lost = bytearray()
        receive = stage.receive

        def receive_all_but_the_first_line(data: bytes, now: float) -> None:
            for byte in data:
                if byte == ord("?") or lost.endswith(b"\n"):
                    receive(bytes([byte]), now)
                else:
                    lost.append(byte)

        guarded = GuardedStage(controller, FRAME, controller.settings.bounds, 0.02, 4e-4)
        here = guarded.resting()
        monkeypatch.setattr(stage, "receive", receive_all_but_the_first_line)
        guarded.creep(here + np.array([1e-4, 0.0, 0.0]))
        guarded.creep(here + np.array([2e-4, 0.0, 0.0]))
        assert lost.startswith(b"$J=")
        assert np.abs(FRAME.to_object(stage.motion.position) - here - [2e-4, 0.0, 0.0]).max() < STEP
        assert stage.motion.travelled < 2.1e-4


@pytest.mark.parametrize("how", ["move", *(pytest.param(how, marks=pytest.mark.slow) for how in ("jog", "probe"))])
def test_a_machine_that_restarts_before_a_motion_goes_no_further_than_it_was_sent(how: str) -> None:
    """The restart is not heard of: the motion is written before the greeting arrives."""
    with standing_machine(latency=0.2) as (stage, controller):
        begun = controller.resting_position()
        stage.power_cycle()  # takes where it stands for zero
        target = begun + np.array([-1e-4, 0.0, -2e-4])
        with pytest.raises(StoppedError, match="restarted"):
            if how == "jog":
                controller.jog(target, 0.05)
                time.sleep(0.5)
                controller.check()
            elif how == "move":
                controller.move(target, 0.05, 5.0)
            else:
                controller.probe(target, 0.05, 5.0)
        assert np.linalg.norm(stage.motion.position - begun) < 2.3e-4
        assert stage.motion.travelled > 0.0, "nothing was sent before the greeting came"
