"""Ergodic sweeps: what they cover, and the heat that they follow."""

from __future__ import annotations

import numpy as np
import pytest

from hw.move import Move
from mapping.base.base import Base
from mapping.detection.coverage import coverage
from mapping.surface import Surface
from mapping.trace import Trace
from planners.drive import dry_run
from planners.survey.ergodic import Ergodic, even_places, steady_heat

R = 0.01
PLATE = Surface([[0, 0, 0], [0.06, 0, 0], [0.06, 0.05, 0], [0, 0.05, 0]], [[0, 1, 2], [0, 2, 3]])
EMPTY = Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), R)


def swept(seconds: float, seed: int = 0) -> list[Move]:
    plan = Ergodic(base=Base(PLATE), tip_radius=R, seconds=seconds).plan(np.random.default_rng(seed))
    return dry_run(plan, EMPTY)[0]


def covered(moves: list[Move]) -> float:
    return coverage(PLATE, np.concatenate([move.path + 0.98 * R * move.approach for move in moves]), 0.004).fraction


def test_it_covers_more_the_longer_it_runs_and_in_the_end_nearly_all() -> None:
    moves = swept(40.0)
    assert covered(moves[:5]) < covered(moves[:10]) < covered(moves)
    assert covered(moves) > 0.95
    assert sum(move.duration for move in moves) == pytest.approx(40.0, abs=3.0)


def test_the_time_it_spends_in_each_quarter_of_the_plate_is_nearly_the_same() -> None:
    points = np.concatenate([move.path[1:] for move in swept(80.0)])
    share, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=2, range=[[0, 0.06], [0, 0.05]])
    assert share.min() / share.sum() > 0.18


def test_the_same_seed_gives_the_same_sweeps_and_another_one_others() -> None:
    first, again, other = swept(6.0), swept(6.0), swept(6.0, seed=1)
    assert all(np.array_equal(a.path, b.path) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[0].path, other[0].path)


def test_places_are_even_and_heat_is_kept_but_spreads() -> None:
    places = even_places(Base(PLATE), 0.004)
    assert len(places) == pytest.approx(0.06 * 0.05 / 0.004**2, rel=0.2)
    source = np.zeros(len(places))
    source[len(places) // 2] = 1.0
    heat = steady_heat(places, 0.004, 0.02)(source)
    assert heat.sum() == pytest.approx(1.0)
    assert heat.argmax() == len(places) // 2
    distance = np.linalg.norm(places - places[len(places) // 2], axis=1)
    rings = [heat[(distance > low) & (distance < low + 0.006)].mean() for low in (0.003, 0.009, 0.015)]
    assert rings[0] > rings[1] > rings[2] > 0
