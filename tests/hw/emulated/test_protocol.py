"""The emulator against the published protocol of Grbl 1.1, not against our driver.

Each conversation follows a sentence of gnea/grbl, doc/markdown (interface.md, commands.md, jogging.md) and the codes of
doc/csv; the answers are those that Grbl 1.1h itself gave in its simulator (tests/hw/probing/test_firmware.py).
"""

from __future__ import annotations

import numpy as np
import pytest
from conversations import CONVERSATIONS, Emulated, Nothing, without_what_is_the_bodys

from hw.emulated.grbl import GrblEmulator


@pytest.mark.parametrize("said", CONVERSATIONS)
def test_the_emulator_answers_as_the_documents_say(said: str) -> None:
    talk = Emulated()
    for line, answer in CONVERSATIONS[said]:
        assert without_what_is_the_bodys(talk.answer(line)) == answer, line


def test_a_reset_while_moving_loses_the_position_and_one_at_rest_does_not() -> None:
    stage = GrblEmulator(Nothing(), np.zeros(3), settings={20: 0})  # type: ignore[arg-type]
    stage.receive(b"G1X-10F600\n", 0.0)
    stage.advance(0.2)
    stage.out.clear()
    stage.receive(b"\x18", 0.2)
    assert b"ALARM:3" in stage.out and b"Grbl 1.1" in stage.out and b"$H'|'$X' to unlock" in stage.out
    stage.receive(b"$X\n", 0.3)
    stage.out.clear()
    stage.receive(b"\x18", 0.4)
    assert b"ALARM" not in stage.out and b"Grbl 1.1" in stage.out


def test_a_status_is_answered_at_once_also_while_lines_wait() -> None:
    stage = GrblEmulator(Nothing(), np.zeros(3), settings={20: 0})  # type: ignore[arg-type]
    stage.out.clear()
    stage.receive(b"G1X-10F600\nG4P1\nG1X0\n?", 0.0)
    assert stage.out.startswith(b"<") and stage.out.count(b"ok") < 3


def test_a_machine_that_would_leave_its_travel_is_locked_and_a_jog_refused() -> None:
    stage = GrblEmulator(Nothing(), np.zeros(3))  # type: ignore[arg-type]
    stage.out.clear()
    stage.receive(b"$J=X-999F100\n", 0.0)
    assert stage.out == b"error:15\r\n"
    stage.out.clear()
    stage.receive(b"G1X-999F100\n", 0.0)
    assert b"ALARM:2" in stage.out
    stage.out.clear()
    stage.receive(b"G1X-1\n", 0.1)
    assert stage.out == b"error:9\r\n"
