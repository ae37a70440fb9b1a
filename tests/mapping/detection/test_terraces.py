"""Terraces: edges between levels are found where they are, and what is fine on a terrace is found on it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mapping import FloatArray, Trace
from mapping.base import fit_base
from mapping.detection import Detections, detect
from mapping.geometry.templates import cap_height, groove_height, step_height

TIP, NOISE, LINES = 1e-3, 5e-6, 12


def found(height: Callable[[FloatArray], FloatArray], seed: int = 0) -> Detections:
    """What a raster of lines to and fro across what lies along y shows, over the base that is fitted to it."""
    rng = np.random.default_rng(seed)
    x = np.arange(-30e-3, 30e-3, 5e-5)
    ways = [x if k % 2 == 0 else x[::-1] for k in range(LINES)]
    u, v = np.concatenate(ways), np.repeat(3e-3 * np.arange(LINES), len(x))
    z = TIP + height(u) + rng.normal(0.0, NOISE, len(u))
    trace = Trace(np.arange(len(u)) * 1e-3, np.column_stack([u, v, z]), np.repeat(np.arange(LINES), len(x)), TIP)
    return detect(trace, fit_base(trace))


def places(detections: Detections, *kinds: str) -> list[list[float]]:
    """Of each line, where (m) crossings of the kinds stand, ascending."""
    of = [[c for c in detections.crossings if c.sweep == k and c.kind in kinds] for k in range(LINES)]
    return [sorted(float(c.point[0]) for c in own) for own in of]


@pytest.mark.parametrize("height", [0.05e-3, 0.3e-3, 2e-3])
def test_every_line_crosses_the_step_and_nothing_else(height: float) -> None:
    detections = found(lambda x: step_height(x - 3.3e-3, height, TIP))
    assert len(detections.crossings) == LINES
    # by the middle of its arc, as wide as the ball makes it
    arc = min(np.sqrt(2 * TIP * height), TIP)
    for (place,) in places(detections, "step up", "step down"):
        assert 3.3e-3 - arc < place < 3.3e-3 + 0.2e-3
    for crossing in detections.crossings:
        assert crossing.kind == ("step up" if crossing.sweep % 2 == 0 else "step down")
        assert crossing.height == pytest.approx(height, rel=0.02)


def test_each_edge_of_a_staircase_is_crossed() -> None:
    stairs = (-15e-3, -2e-3, 17e-3)
    detections = found(lambda x: sum(step_height(x - place, 0.2e-3, TIP) for place in stairs))
    for line in places(detections, "step up", "step down"):
        assert line == pytest.approx(stairs, abs=0.7e-3)


def test_a_ridge_and_grooves_on_either_level_are_found_beside_the_edge() -> None:
    def height(x: FloatArray) -> FloatArray:
        ridge = cap_height(x - 15e-3, 0.1e-3, 0.05e-3, TIP)
        return step_height(x, 0.2e-3, TIP) + ridge + groove_height(x + 14e-3, 0.5e-3, TIP)

    detections = found(height)
    assert all(line == pytest.approx([15e-3], abs=0.05e-3) for line in places(detections, "convex"))
    assert all(line == pytest.approx([-14e-3], abs=0.05e-3) for line in places(detections, "concave"))
    assert all(len(line) == 1 for line in places(detections, "step up", "step down"))
    assert len(detections.crossings) == 3 * LINES


@pytest.mark.parametrize("seed", range(3))
def test_a_plateau_too_narrow_for_a_terrace_has_two_edges_however_it_is_noisy(seed: int) -> None:
    detections = found(
        lambda x: np.minimum(step_height(x + 2e-3, 0.3e-3, TIP), step_height(2e-3 - x, 0.3e-3, TIP)), seed
    )
    for line in places(detections, "step up", "step down"):
        assert line == pytest.approx([-2.3e-3, 2.3e-3], abs=0.4e-3)
    assert len(detections.crossings) == 2 * LINES
