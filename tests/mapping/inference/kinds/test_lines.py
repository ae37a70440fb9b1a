"""How freely the axis of a ridge may bend: the trace decides, not the scatter of the crossings that found it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mapping import CourseError
from mapping.base.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.geometry.templates.shapes import chain_height
from mapping.inference.families.problem import Surroundings
from mapping.inference.feature_posterior import pose_problem, refine
from mapping.inference.kinds import lines
from mapping.inference.kinds.ridge import Ridge
from mapping.inference.sampler import find_optima
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

TIP, D = 10e-3, 0.65e-3
UP = np.array([0.0, 0.0, 1.0])
NOISE = Noise(0.1e-3)
CORNERS = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0.0]])
PLATE = Base(Surface(CORNERS, [[0, 1, 2], [0, 2, 3]]))


def crossed(axis: np.ndarray) -> Trace:
    """Seven sweeps across a wire over an axis (K, 3) that runs along x, and a slide off each end."""
    paths = [np.linspace([x, -0.012, 0.0], [x, 0.012, 0.0], 2000) for x in np.linspace(-0.018, 0.018, 7)]
    paths += [np.linspace([side * 0.014, 0.0, 0.0], [side * 0.03, 0.0, 0.0], 1300) for side in (-1.0, 1.0)]
    feet = np.concatenate(paths)
    raised = axis + 0.5 * D * UP
    height = chain_height(feet, np.tile(UP, (len(feet), 1)), raised, 0.5 * D, TIP)
    height += NOISE.white * np.random.default_rng(0).standard_normal(len(feet))
    sweep = np.repeat(np.arange(len(paths)), [len(path) for path in paths])
    return Trace(1e-3 * np.arange(len(feet), dtype=np.float64), feet + np.outer(TIP + height, UP), sweep, TIP)


def guess(axis: np.ndarray, sd: float) -> Feature:
    height, width = Interval.normal(D, 0.05 * D), Interval(D, 0.5 * D, 2 * D)
    length, normals = Interval.normal(0.04, 1e-3), np.tile(UP, (len(axis), 1))
    return Feature("ridge", axis, normals, height, width, length, Support(50.0, 7), True, sd)


def course(bend: float) -> np.ndarray:
    """(60, 3) axis along x, m, that bends by `bend` to the side in its middle."""
    x = np.linspace(-0.02, 0.02, 60)
    return np.column_stack([x, bend * (1.0 - (x / 0.02) ** 2), 0.0 * x])


@pytest.mark.slow
def test_a_bend_that_the_crossings_did_not_ask_for_is_found_in_the_trace() -> None:
    straight = np.linspace([-0.02, 0.1e-3, 0.0], [0.02, 0.1e-3, 0.0], 7)
    found = refine(guess(straight, 0.2e-3), crossed(course(0.3e-3)), np.random.default_rng(0), base=PLATE, noise=NOISE)
    beside = found.axis[:, 1] - 0.3e-3 * (1.0 - (found.axis[:, 0] / 0.02) ** 2)
    assert np.abs(beside[np.abs(found.axis[:, 0]) < 0.02]).max() < 0.05e-3


def test_a_crossing_that_was_pulled_aside_bends_nothing() -> None:
    pulled = course(0.0)[[0, 8, 16, 24, 33, 42, 51, 59]].copy()
    pulled[5:7, 1] += [0.9e-3, -0.4e-3]
    around = Surroundings(crossed(course(0.0)), PLATE, NOISE)
    problem = pose_problem(guess(pulled, 0.06e-3), around)
    names = problem.target.shape.names
    assert [name for name in names if name.startswith("bend")] == ["bend 2"]  # the one that may have been overlooked
    best = find_optima(problem.target, problem.beginnings[:1])[0]
    assert abs(best[names.index("bend 2")]) < 0.06e-3


def test_a_bend_may_have_been_overlooked_by_as_much_as_the_criterion_does_not_ask_for() -> None:
    around = Surroundings(crossed(course(0.0)), PLATE, NOISE)
    straight = np.linspace([-0.018, 0.0, 0.0], [0.018, 0.0, 0.0], 7)
    shape = pose_problem(guess(straight, 0.06e-3), around).target.shape
    number, bins = shape.names.index("bend 2"), len(shape.window)
    # seven crossings of one doubt tell the coefficient of P2, whose mean square is 1/5, to within sqrt(5 / 7) of it
    known = 0.06e-3 * np.sqrt(5.0 / 7.0)
    assert shape.priors[number].sd == pytest.approx(known * np.sqrt(np.log(bins) / 3.0), rel=1e-9)


@pytest.mark.slow
def test_an_arm_that_meets_another_line_ends_where_they_meet() -> None:
    arm = np.linspace([0.0, 0.0, 0.0], [0.02, 0.0, 0.0], 30)
    bar = np.linspace([0.0, -0.02, 0.0], [0.0, 0.02, 0.0], 30)
    paths = [np.linspace([x, -0.012, 0.0], [x, 0.012, 0.0], 2000) for x in np.linspace(-0.012, 0.018, 6)]
    paths += [np.linspace([-0.012, y, 0.0], [0.03, y, 0.0], 2000) for y in (-0.014, -0.005, 0.0, 0.006, 0.015)]
    feet, up = np.concatenate(paths), np.tile(UP, (11 * 2000, 1))
    height = np.maximum(*(chain_height(feet, up, axis + 0.5 * D * UP, 0.5 * D, TIP) for axis in (arm, bar)))
    height += NOISE.white * np.random.default_rng(1).standard_normal(len(feet))
    trace = Trace(
        1e-3 * np.arange(len(feet), dtype=np.float64),
        feet + np.outer(TIP + height, UP),
        np.repeat(np.arange(11), 2000),
        TIP,
    )
    beside = guess(bar[::5] + np.array([0.3e-3, 0.0, 0.0]), 0.1e-3)  # where the detection put the other line
    mine = guess(arm[[0, 7, 15, 22, 29]], 0.1e-3)
    found = refine(mine, trace, np.random.default_rng(0), base=PLATE, noise=NOISE, others=[mine, beside])
    tips = found.axis[[0, -1]] if found.axis[0, 0] < found.axis[-1, 0] else found.axis[[-1, 0]]
    assert np.linalg.norm(tips[0]) < 2e-3 and np.linalg.norm(tips[1] - arm[-1]) < 0.3e-3
    assert np.abs(found.axis[:, 1]).max() < 0.15e-3
    assert not found.length.censored
    for others, widest in (([mine, beside], 3.7e-3), ([mine], np.inf)):
        target = pose_problem(mine, Surroundings(trace, PLATE, NOISE, others)).target
        room = (target.high - target.low)[target.shape.names.index("start")]
        assert 1e-3 < room < widest
    assert room > 8e-3  # where nothing else is, only the sweeps tell where it ends


def test_a_course_of_which_less_than_a_leg_is_left_on_the_base_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    left = SimpleNamespace(length=1e-6, tangents=np.eye(3)[:2], s=np.array([0.0, 1e-6]))
    monkeypatch.setattr(lines, "chart_along", lambda *_, **__: left)
    axis = np.linspace([0.0, 0.0, 0.0], [3.0, 0.0, 0.0], 30)  # legs of a micrometre would take all memory
    around = SimpleNamespace(trace=SimpleNamespace(tip_radius=TIP), base=PLATE)
    sizes = SimpleNamespace(half_width=2e-3, height=D)
    with pytest.raises(CourseError, match="less than a leg"):
        Ridge._chart(SimpleNamespace(has_ends=True), axis, np.tile(UP, (30, 1)), sizes, 30, 8, around, bends=True)
