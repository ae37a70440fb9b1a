"""Until where a tip may go before it must have felt something."""

from __future__ import annotations

import numpy as np
import pytest

from hw.grbl.expected import ExpectedSurface
from mapping.surface import Surface

TIP, BEYOND = 2e-3, 0.5e-3
SIDE, HIGH, WIDE = 20e-3, 0.65e-3, 0.5e-3
DOWN, AWAY, TOWARDS = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])


def plate_with_a_bar() -> Surface:
    """z = 0, and upon it a bar over x from 0 to WIDE."""
    section = ((-SIDE, 0.0), (0.0, 0.0), (0.0, HIGH), (WIDE, HIGH), (WIDE, 0.0), (SIDE, 0.0))
    corners = [[x, y, z] for x, z in section for y in (-SIDE, SIDE)]
    strips = range(0, 10, 2)
    return Surface(corners, [[k, k + 2, k + 1] for k in strips] + [[k + 1, k + 2, k + 3] for k in strips])


EXPECTED = ExpectedSurface(plate_with_a_bar(), TIP, BEYOND)


def bound(point: list[float], direction: np.ndarray) -> float:
    return float(EXPECTED.bounds(np.array([point]), direction[None])[0])


@pytest.mark.parametrize("height", [5e-3, TIP + 1e-9, TIP - 1e-6, TIP - 0.4e-3])
def test_a_tip_above_or_a_little_in_a_body_may_go_so_far_beyond_it(height: float) -> None:
    assert bound([-10e-3, 0.0, height], DOWN) == pytest.approx(height - TIP + BEYOND, abs=1e-8)


def test_what_a_tip_has_passed_is_not_in_its_way() -> None:
    # it stands beside the bar, lower than that is high, and leaves it: it was refused as if it had gone through the bar
    beside = [-1.6e-3, 0.0, TIP + 0.3e-3]
    assert bound(beside, AWAY) == np.inf
    # towards the bar it touches where its centre is a leg of the triangle over the edge from it
    touching = np.sqrt(TIP**2 - (beside[2] - HIGH) ** 2)
    assert bound(beside, TOWARDS) == pytest.approx(-beside[0] - touching + BEYOND, abs=1e-6)
