"""A ball that rests on a wall beside a feature tells nothing of it, and a line ends where the ball meets one."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray, Surface, Trace
from mapping.base import Base, LaidTrace, between_walls, on_walls
from mapping.inference.curves import chart_along
from mapping.inference.likelihood import gather

TIP = 3e-3
UP = np.array([0.0, 0.0, 1.0])


def corner(height: float = 30e-3) -> Base:
    """A floor, and a wall along y at its end x = 0: up if its height is positive, else down from an edge."""
    y = 20e-3
    rim = [[[0.0, side, height], [0.0, side, 0.0], [40e-3, side, 0.0]] for side in (-y, y)]
    return Base(Surface(np.array(rim).reshape(6, 3), [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]))


def test_balls_on_a_wall_that_rises_are_told_from_those_on_the_floor() -> None:
    crest = np.linspace([5e-3, 0, 0], [20e-3, 0, 0], 20)
    centers = np.array([[8e-3, 1e-3, TIP], [3.2e-3, 0, TIP], [TIP, 0, 3.2e-3], [TIP, 1e-3, 9e-3]])
    told = on_walls(corner().foot(centers, TIP), crest, np.tile(UP, (20, 1)))
    assert told.tolist() == [False, False, True, True]


def test_a_face_that_falls_away_is_no_wall() -> None:
    crest = np.linspace([1e-3, 0, 0], [20e-3, 0, 0], 20)
    centers = np.array([[8e-3, 1e-3, TIP], [-2.9e-3, 0, 0.5e-3], [-TIP, 0, -5e-3]])
    assert not on_walls(corner(-30e-3).foot(centers, TIP), crest, np.tile(UP, (20, 1))).any()


def test_a_line_ends_where_a_ball_on_it_meets_the_wall_that_it_runs_into() -> None:
    line = np.linspace([-5e-3, 0, 0], [30e-3, 0, 0], 71)
    kept = line[between_walls(line, np.tile(UP, (71, 1)), corner(), TIP)]
    assert 3e-3 <= kept[0, 0] <= 3.5e-3 and kept[-1, 0] == 30e-3
    turned = line[::-1][between_walls(line[::-1], np.tile(UP, (71, 1)), corner(), TIP)]
    assert np.array_equal(turned[::-1], kept)
    edge = line[between_walls(line, np.tile(UP, (71, 1)), corner(-30e-3), TIP)]
    assert np.array_equal(edge, line)


def test_on_a_base_that_turns_by_less_than_a_wall_nothing_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(self: Base, centers: FloatArray, tip_radius: float) -> None:
        raise AssertionError(f"{len(centers)} places are laid on it")

    monkeypatch.setattr(Base, "foot", refused)
    roof = Surface(np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0.3], [1, 1, 0.3], [2, 0, 0], [2, 1, 0]]) * 1e-2,
                   [[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]])  # fmt: skip
    line = np.linspace([0, 5e-3, 0], [20e-3, 5e-3, 0], 30)
    assert between_walls(line, np.tile(UP, (30, 1)), Base(roof), TIP) == slice(0, 30)


def test_a_chart_does_not_climb_the_wall() -> None:
    axis = np.linspace([5e-3, 0, 0], [20e-3, 0, 0], 10)
    chart = chart_along(axis, np.tile(UP, (10, 1)), corner(), TIP, 0.5e-3, 9e-3, 1.5e-3)
    assert np.abs(chart.points[:, 2]).max() < 1e-9 and 2.9e-3 < chart.points[:, 0].min() < 3.6e-3


def test_a_feature_is_judged_without_the_samples_on_the_wall() -> None:
    rise = np.linspace(20e-3, TIP, 100)
    down = np.column_stack([np.full(100, TIP), np.zeros(100), rise])
    along = np.column_stack([np.linspace(TIP, 25e-3, 200), np.zeros(200), np.full(200, TIP)])
    centers = np.concatenate([down, along])
    trace = Trace(np.arange(300) * 1e-3, centers, np.zeros(300, dtype=int), TIP)
    base = corner()
    crest = np.linspace([4e-3, 0, TIP], [10e-3, 0, TIP], 20)
    samples = gather(LaidTrace.of(trace, base), base, crest, np.tile(UP, (20, 1)), 5e-3)
    assert len(samples.feet.height) > 50 and samples.feet.points[:, 2].max() < 1e-9 and samples.flat
