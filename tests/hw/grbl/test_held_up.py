"""Answers that come late and all at once, after a stall: each is as old as its own question."""

from __future__ import annotations

import time

import numpy as np
import pytest

from hw.grbl import GrblController
from hw.probing.fusion import prompt

REPORT = "<Idle|MPos:0.000,0.000,0.000|FS:0,0>"


def test_the_answers_to_a_stall_are_no_prompt_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    controller = GrblController("nowhere")
    monkeypatch.setattr(controller.link, "write", lambda data: None)
    controller.link.heard = time.monotonic()
    for _ in range(10):  # nothing is heard meanwhile, and each is taken for late by the next
        time.sleep(0.002)
        controller._request(patience=0.001)
    now = time.monotonic() + 0.05
    for number in range(10):
        controller._sort(now + 0.005 * number, REPORT)
    assert min(report.round_trip for report in controller.reports) > 0.04
    controller._sort(now + 0.1, REPORT)  # one that nobody asked for
    assert np.isinf(controller.reports[-1].round_trip)
    assert controller.reports[-1] not in prompt(list(controller.reports))
