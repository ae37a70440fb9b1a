"""Machines that lie: whatever sensor, probe, controller or cable do, the tip is not pressed harder."""

from __future__ import annotations

import re

import pytest
from fault_campaign import kinds, struck_case
from struck_machine import PHASES


def holds(kind: str, phase: str, touch: str, seed: int = 0, model: bool = True) -> str:
    """Run a case, check what must hold whatever it is, and return what was said."""
    *_, out = struck_case(kind, phase, touch, seed, model)
    assert not out.broken, out
    return out.said


@pytest.mark.parametrize(
    ("kind", "touch", "why"),
    [
        ("frozen", "optoforce", "the same . value"),
        pytest.param("nan", "line", "no number", marks=pytest.mark.slow),
        pytest.param("sign", "optoforce", "jumped|pulls", marks=pytest.mark.slow),
        pytest.param("open", "peck", "nothing was felt|open again", marks=pytest.mark.slow),
        pytest.param("power cycle", "peck", "restarted", marks=pytest.mark.slow),
    ],
)
def test_what_lies_midway_stops_the_machine_and_is_named(kind: str, touch: str, why: str) -> None:
    said = holds(kind, "midway", touch)
    assert re.search(why, said), said


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize(("touch", "kind"), [(t, k) for t in ("optoforce", "line", "peck") for k in kinds(t)])
def test_the_campaign(touch: str, kind: str, phase: str, seed: int) -> None:
    holds(kind, phase, touch, seed)
