"""Grooves that cross: the ball rests where trying all of the surface says it does."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray
from mapping.geometry.templates import crossing_heights, groove_heights

TIP, SPACING = 3e-3, 10e-6
REACH = np.arange(-2e-3, 2e-3 + 0.5 * SPACING, SPACING)
X, Y = np.meshgrid(REACH, REACH, indexing="ij")
DROP = np.sqrt(TIP**2 - X**2 - Y**2) - TIP
# The nearest place of a grid is off by up to its half diagonal, on an arc that falls by 0.5 mm / 3 mm there
OFF = 0.5 * np.sqrt(2.0) * SPACING * 0.5e-3 / TIP * 4.0


def grooves(rng: np.random.Generator, count: int, depth: float | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(4, G) how the place 0 lies in random grooves, half widths and depths (G,); some of these end beside it."""
    aside, heading = rng.uniform(-0.5e-3, 0.5e-3, count), rng.uniform(0.0, 2.0 * np.pi, count)
    before, after = rng.uniform(-0.3e-3, 1.5e-3, count), rng.uniform(0.3e-3, 1.5e-3, count)
    depths = rng.uniform(0.02e-3, 0.3e-3, count) if depth is None else np.full(count, depth)
    return np.array([aside, before, after, heading]), rng.uniform(0.2e-3, 0.7e-3, count), depths


def by_trying_all(places: FloatArray, halves: FloatArray, depths: FloatArray) -> float:
    """Height at which a ball over 0 rests on a plate that the grooves were cut into."""
    ground = np.zeros_like(X)
    for (aside, before, after, heading), half, depth in zip(places.T, halves, depths, strict=True):
        u = aside - np.sin(heading) * X + np.cos(heading) * Y
        along = np.cos(heading) * X + np.sin(heading) * Y
        inside = (np.abs(u) < half) & (along > -before) & (along < after)
        ground = np.where(inside, np.minimum(ground, -depth), ground)
    return float((ground + DROP).max())


def alone(place: FloatArray, half: float, depth: float) -> float:
    """Height that one groove leaves, with square ends."""
    aside, before, after, _ = place
    out, none = np.empty((1, 1)), np.zeros((1, 1))
    ends = np.array([[-before, after]])
    groove_heights(none, np.array([[aside]]), np.zeros((2, 0, 1, 1)), none, none, np.zeros((1, 0)), ends, np.zeros(1),
                   np.array([2.0 * half]), np.array([depth]), TIP, out)  # fmt: skip
    return float(out[0, 0])


@pytest.mark.slow
@pytest.mark.parametrize("depth", [None, 0.1e-3])
@pytest.mark.parametrize("count", [2, 3])
def test_grooves_together_leave_what_trying_all_of_the_surface_says(count: int, depth: float | None) -> None:
    rng, disturbed = np.random.default_rng(count), 0
    for _ in range(60):
        places, halves, depths = grooves(rng, count, depth)
        more = np.empty((1, 1))
        crossing_heights(places[:, :, None, None], np.zeros((2, count, 1)), halves[:, None], depths[:, None], TIP, more)
        whole = more[0, 0] + sum(alone(*each) for each in zip(places.T, halves, depths, strict=True))
        assert whole == pytest.approx(by_trying_all(places, halves, depths), abs=OFF)
        disturbed += abs(more[0, 0]) > OFF
    assert disturbed > 5


def test_grooves_that_do_not_meet_leave_what_each_leaves() -> None:
    places = np.array([[0.1e-3, 3e-3], [5e-3, 5e-3], [5e-3, 5e-3], [0.0, 0.5]])
    more = np.empty((1, 1))
    crossing_heights(places[:, :, None, None], np.zeros((2, 2, 1)), np.full((2, 1), 0.5e-3), np.full((2, 1), 1e-4), TIP,
                     more)  # fmt: skip
    assert more[0, 0] == 0.0
