"""Following a line: what is crossed must lie further on."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import numpy as np
import pytest

from mapping.base import Base
from mapping.detection import Crossing
from mapping.instrument import Noise
from mapping.surface import Surface
from mapping.trace import Trace
from planners.follow.ridge_follower import RidgeFollower
from planners.follow.sense import Sense
from planners.paths import Strokes

TIP = 3e-3


def test_a_crossing_that_is_found_again_and_again_leads_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the rim of an unknown gear's bore every sweep met it in one place: 10 000 of them in 12 minutes."""
    corners = 0.05 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    base = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
    up, along = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    here = Crossing(0, 0.0, np.zeros(3), up, along, "concave", -1e-3, 1e-5, 1e-5, 1.6e-3, -1e3, 50.0, True, 0, 100)
    asked = 0

    def again(*args: Any) -> Generator[Any, Any, Crossing]:
        nonlocal asked
        asked += 1
        assert asked < 50
        return here
        yield

    monkeypatch.setattr(RidgeFollower, "_cross", again)
    monkeypatch.setattr(RidgeFollower, "_first", again)
    follower = RidgeFollower(Strokes(base, TIP), Sense(base, Noise(1e-5), 0.01), Noise(1e-5), 1e-4)
    plan = follower.follow(here, [np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])])
    next(plan)
    with pytest.raises(StopIteration) as done:
        while True:
            plan.send(Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), TIP))
    assert done.value.value.value.length < 0.1 * TIP
