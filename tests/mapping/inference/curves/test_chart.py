"""The chart of a line on the base: its points lie apart, also where the base ends."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.base.base import Base
from mapping.errors import EmptyWindowError
from mapping.inference.curves.chart import chart_along
from mapping.surface import Surface

TIP = 0.01
UP = np.array([0.0, 0.0, 1.0])


def plate() -> Base:
    corners = 0.03 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def along(start: float, stop: float, y: float = 0.0):
    axis = np.linspace([start, y, 0.0], [stop, y, 0.0], 5)
    return chart_along(axis, np.tile(UP, (5, 1)), plate(), TIP, 1e-3, 0.01, 3.6e-3)


def test_a_chart_goes_on_straight_beyond_both_ends() -> None:
    chart = along(-0.01, 0.01)
    assert chart.points[:, 0].min() == pytest.approx(-0.02) and chart.points[:, 0].max() == pytest.approx(0.02)
    assert (np.diff(chart.s) > 0).all()


def test_a_chart_ends_where_the_base_does_and_its_points_stay_apart() -> None:
    chart = along(0.0, 0.029)
    assert chart.points[:, 0].max() <= 0.03 + 1e-12
    assert (np.diff(chart.s) > 0).all() and np.isfinite(chart.tangents).all()


def test_a_straight_line_goes_on_to_where_a_wall_begins() -> None:
    """Its extension is one leg, which ends in the wall: without it the line's own ends would be the last ones tried."""
    floor = 0.03 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    top = floor[1:3] + np.array([0.0, 0.0, 0.03])
    base = Base(Surface(np.concatenate([floor, top]), [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]))
    axis = np.array([[-0.012, 0.0, 0.0], [0.012, 0.0, 0.0]])
    chart = chart_along(axis, np.tile(UP, (2, 1)), base, TIP, 0.05, 0.017, 3.6e-3)
    assert chart.points[0, 0] == pytest.approx(-0.029)
    # the ball touches the wall from 0.02 on
    assert 0.015 < chart.points[-1, 0] < 0.0201


def test_a_line_that_does_not_lie_over_the_base_has_none() -> None:
    axis = np.linspace([0.05, 0.05, 0.0], [0.06, 0.06, 0.0], 5)
    with pytest.raises(EmptyWindowError, match="does not lie over the base"):
        chart_along(axis, np.tile(UP, (5, 1)), plate(), TIP, 1e-3, 0.01, 3.6e-3)


def test_a_course_that_turns_back_on_itself_has_no_chart() -> None:
    there = np.linspace(-5e-3, 5e-3, 9)
    axis = np.zeros((17, 3))
    axis[:, 0] = np.concatenate([there, there[-2::-1]])
    with pytest.raises(EmptyWindowError, match="turns back"):
        chart_along(axis, np.tile([0.0, 0.0, 1.0], (17, 1)), plate(), TIP, 1.25e-3, 0.0, 1e-3)


def test_arcs_are_as_long_as_the_smooth_curve_and_chords_are_not() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 41)
    circle = 0.01 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    circle[-1] = circle[0]
    chart = chart_along(circle, np.tile(UP, (41, 1)), plate(), TIP, 0.00314, 0.0, 3.6e-3)
    # each second corner is kept, or a point within 4e-5 of a side
    assert chart.closed and chart.arcs[0] == 0.0
    assert chart.arcs[-1] == pytest.approx(2.0 * np.pi * 0.01, rel=1e-4)
    assert chart.length < 0.9965 * 2.0 * np.pi * 0.01
    straight = along(-0.01, 0.01)
    assert straight.arcs == pytest.approx(straight.s - straight.s[0], rel=1e-12)


def test_a_bent_line_goes_on_as_it_ends_and_is_felt_as_itself_where_it_would_run_into_itself() -> None:
    """Two arcs of 250 degrees: a chord of a third of them leaves the line by 84 degrees where it ends, and straight on
    it runs through its own middle. The ball that rests there rests on the line, not beyond its end."""
    turned = np.linspace(np.radians(20.0), np.radians(270.0), 200)
    arc = 3e-3 * np.column_stack([np.cos(turned), 1.0 + np.sin(turned), 0.0 * turned])
    axis = np.vstack([arc, -arc[-2::-1]])
    chart = chart_along(axis, np.tile(UP, (len(axis), 1)), plate(), TIP, 0.25e-3, 0.01, 3.6e-3)
    onward = np.array([np.sin(turned[0]), -np.cos(turned[0]), 0.0])
    assert chart.tangents[3] @ -onward > np.cos(np.radians(10.0))
    s, lateral, _ = chart.coordinates(axis)
    felt = np.linalg.norm(np.diff(axis, axis=0), axis=1).sum()
    assert s[-1] - s[0] == pytest.approx(felt, rel=1e-3) and (np.diff(s) >= 0.0).all()
    assert np.abs(lateral).max() < 0.02e-3
    beyond = axis[0] + 2e-3 * onward
    assert chart.coordinates(beyond[None])[0][0] < s[0]
