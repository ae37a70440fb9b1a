"""Reports that nothing explains, of a place or a work offset: as many that agree as no garbling makes end the trust."""

from __future__ import annotations

import time

import numpy as np
import pytest
from struck_machine import standing_machine

from hw.grbl.controller import (
    IF_GARBLED_BEFORE,
    OFF_THE_WAY_IN_A_ROW,
    OFFSET_CHANGED,
    OFFSET_IF_GARBLED_BEFORE,
    OFFSET_IN_A_ROW,
    GrblController,
)

# Millimetres; the machine stands at -150, -150, -30
AWAY, ELSEWHERE = [-50.0, -150.0, -30.0], [-15.0, -150.0, -30.0]


def report(place: list[float]) -> bytes:
    return "<Idle|MPos:{:.3f},{:.3f},{:.3f}|FS:0,0>\r\n".format(*place).encode("ascii")


def heard(controller: GrblController, count: int) -> None:
    until = time.monotonic() + 2.0
    while controller.implausible < count and controller.distrust is None and time.monotonic() < until:
        time.sleep(0.001)


@pytest.mark.parametrize("before", [0, 2])
def test_reports_off_the_way_end_the_trust_if_so_many_agree_as_no_garbling_makes(before: int) -> None:
    with standing_machine() as (stage, controller):
        controller.jog(controller.resting_position() + np.array([1e-3, 0.0, 0.0]), 0.01)
        controller.resting_position()
        for k in range(before):  # garbled, here and there
            stage.out += report(AWAY if k % 2 else ELSEWHERE)
            heard(controller, k + 1)
            controller.status()
        enough = IF_GARBLED_BEFORE if before else OFF_THE_WAY_IN_A_ROW
        for _ in range(enough - 1):
            stage.out += report(AWAY)
        heard(controller, before + enough - 1)
        assert controller.distrust is None
        stage.out += report(AWAY)
        heard(controller, before + enough)
        assert controller.distrust is not None
        assert "nothing sent it" in controller.distrust


@pytest.mark.parametrize("before", [0, 1])
def test_a_work_offset_is_believed_if_told_so_often_as_no_garbling_makes(before: int) -> None:
    with standing_machine() as (stage, controller):
        controller.resting_position()

        def told(line: bytes) -> None:
            count, until = len(controller.reports) + controller.garbled, time.monotonic() + 2.0
            stage.out += line
            while len(controller.reports) + controller.garbled == count and time.monotonic() < until:
                time.sleep(0.001)

        new = b"<Idle|MPos:-150.000,-150.000,-30.000|FS:0,0|WCO:0.000,0.000,4.000>\r\n"
        for _ in range(before):
            told(b"<Idle|MQos:-150.000,-150.000,-30.000|FS:0,0>\r\n")
        assert controller.garbled == before
        for _ in range((OFFSET_IF_GARBLED_BEFORE if before else OFFSET_IN_A_ROW) - 1):
            told(new)
            assert controller.distrust is None
        told(new)
        assert controller.distrust is not None and controller.distrust.endswith(OFFSET_CHANGED)
