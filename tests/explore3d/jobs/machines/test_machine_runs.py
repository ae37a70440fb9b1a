"""The command line over a machine that fails, and ended in contact: status, first line, force, samples, going on."""

from __future__ import annotations

import pytest
from machine_runs import SIGNALS, bench, broken
from struck_machine import PHASES

FINGERS = ("optoforce", "line", "peck")

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("kind", SIGNALS)
@pytest.mark.parametrize("touch", FINGERS)
def test_whatever_ends_the_program_the_machine_stands_and_the_line_says_how_to_go_on(
    touch: str, kind: str, phase: str
) -> None:
    with bench(touch) as machine:
        run = machine.run(strike=(kind, phase))
    assert not broken(kind, run), run


@pytest.mark.parametrize("number", range(20))
def test_after_a_kill_in_contact_resume_ends_what_was_begun(number: int) -> None:
    with bench(FINGERS[number % 3], seed=number) as machine:
        killed = machine.run(strike=("SIGKILL", "midway"))
        assert not broken("SIGKILL", killed), killed
        resumed = machine.run("--resume")
    assert resumed.status == 0 and resumed.wrong == 0 and resumed.strongest < 5.5, resumed
    assert resumed.kept > killed.kept


@pytest.mark.parametrize("kind", ["alarm 1", "port gone", "open"])
def test_a_machine_that_is_lost_near_the_end_of_the_plan_is_said_first(kind: str) -> None:
    with bench("peck") as machine:
        run = machine.run(strike=(kind, "midway"))
    assert not broken(kind, run), run
