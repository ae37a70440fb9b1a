"""A groove along the edge of a step: the ball rests where trying all of the surface says it does."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray
from mapping.inference.curves import Chart, CurveModes
from mapping.inference.families import GrooveShape, OffsetRims, StepShape
from mapping.inference.joint import JoinedShape
from mapping.inference.likelihood import Window

TIP, WIDTH, RISE = 5e-3, 3e-3, 0.2e-3
X = np.arange(-8e-3, 8e-3, 0.13e-3)


def window() -> Window:
    """Places of one sweep across, each felt at a point."""
    zero, one = np.zeros_like(X), np.ones(len(X), dtype=np.int64)
    feet, normals, tangents = (np.column_stack(each) for each in ((X, zero, zero), (zero, zero, zero + 1.0),
                                                                 (zero + 1.0, zero, zero)))  # fmt: skip
    return Window(feet, normals, tangents, zero, one, X, X, zero, np.array([0, len(X)]), len(X), True)


def chart(at: float, backward: bool) -> Chart:
    """A straight line across the sweep, through x = `at`."""
    s = np.linspace(0.0, 40e-3, 9)
    points = np.column_stack([np.full(9, at), s - 20e-3, np.zeros(9)])[:: -1 if backward else 1]
    way = np.array([0.0, -1.0 if backward else 1.0, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    frames = [np.tile(each, (9, 1)) for each in (way, np.cross(up, way), up)]
    return Chart(s, points, *frames, np.zeros(9), np.zeros(9), False)


def by_trying_all(edge: float, depth: float) -> FloatArray:
    """(n,) heights of the ball over a plate that is RISE higher beyond an edge, and has a groove about 0."""
    x = np.arange(-14e-3, 14e-3, 2e-6)
    ground = np.where(x > edge, RISE, 0.0)
    level = RISE if edge < -0.5 * WIDTH else 0.0
    ground = np.where(np.abs(x) < 0.5 * WIDTH, level - depth, ground)
    near = np.abs(x - X[:, None]) < TIP
    drop = np.sqrt(np.maximum(TIP**2 - (x - X[:, None]) ** 2, 0.0)) - TIP
    return np.asarray(np.where(near, ground + drop, -np.inf).max(axis=1))


@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize("depth", [0.15e-3, 8e-3])
@pytest.mark.parametrize("edge", [-4e-3, -1.2e-3, 0.3e-3, 1.4e-3, 1.8e-3, 4e-3])
def test_a_groove_whose_rims_stand_on_two_levels_is_felt_as_it_is(edge: float, depth: float, backward: bool) -> None:
    place = window()
    lines = chart(0.0, False), chart(edge, backward)
    modes = CurveModes(0, 20e-3, 20e-3, False)
    groove = GrooveShape(place, lines[0], modes, TIP, (), np.zeros(0), np.zeros(0))
    # the chart's lateral side is that of -x where it runs along y
    step = StepShape(place, lines[1], modes, TIP, 1.0 if backward else -1.0, (), np.zeros(0), np.zeros(0))
    sizes = np.array([0.0, 0.0, -1.0, 41e-3, np.log(WIDTH), np.log(depth)]), np.array([0.0, RISE])
    felt = JoinedShape([groove, step], len(X), 1).templates(np.concatenate(sizes)[None])[0]
    true = by_trying_all(edge, depth)
    # places of the ground lie 2 um apart, on arcs that fall by 0.3 at most
    assert np.abs(felt - true).max() < 1e-6
    # each beside the other, which is held
    alone = [shape.templates(own[None])[0] for shape, own in zip((groove, step), sizes, strict=True)]
    beside = GrooveShape(
        place, lines[0], modes, TIP, (), np.zeros(0), np.zeros(0), (), ((step, sizes[1][None], False),)
    )
    assert beside.templates(sizes[0][None])[0] + alone[1] == pytest.approx(felt, abs=1e-15)
    carried = StepShape(place, lines[1], modes, TIP, step.high_side, (), np.zeros(0), np.zeros(0),
                        ((groove, sizes[0][None]),))  # fmt: skip
    assert carried.templates(sizes[1][None])[0] + alone[0] == pytest.approx(felt, abs=1e-15)


def test_an_edge_that_is_a_rim_is_one_wherever_it_is_held() -> None:
    place, modes = window(), CurveModes(0, 20e-3, 20e-3, False)
    groove = GrooveShape(place, chart(0.0, False), modes, TIP, (), np.zeros(0), np.zeros(0))
    step = StepShape(place, chart(2.1e-3, False), modes, TIP, -1.0, (), np.zeros(0), np.zeros(0))
    both = np.array([[0.0, 0.0, -1.0, 41e-3, np.log(WIDTH), np.log(8e-3), 0.0, RISE]])
    more = OffsetRims(groove, step, is_rim=True).heights(both)[0]
    whole = more + groove.templates(both[:, :6])[0] + step.templates(both[:, 6:])[0]
    assert np.abs(whole - by_trying_all(0.0, 8e-3)).max() < 1e-6
