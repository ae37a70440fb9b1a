"""Slides off the end of a ridge: what one tells, and what many tell together."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from explore3d.bench.scenes.exploring import WIRE, line, wires
from hw.simulated.finger import SimulatedFinger
from mapping.base.base import Base
from mapping.instrument.noise import Noise
from planners.follow.axis_track import AxisEnd
from planners.follow.end_finder import Crest, EndFinder
from planners.paths.strokes import Strokes

R = 0.01
SCENE = wires(line(0.05))
END = np.array([0.025, 0.0, 0.0])
WIDE = float(np.sqrt(2.0 * R * WIRE))


def slides(count: int, seed: int, sign: float = 1.0, pecks: int = 0) -> tuple[AxisEnd, list[float], float]:
    """The end after some slides, or so many pecks each, its standard deviation after each, and the time they took."""
    finger = SimulatedFinger(object=SCENE.object, tip_radius=R, rate=2000.0, white=1e-4, correlated=1e-5, seed=seed)
    base = Base(SCENE.base)
    finder = EndFinder(Strokes(base, R), base, Noise(1e-4, 1e-5, 1e-3))
    end = AxisEnd(END - [1.5e-3, 0.0, 0.0], np.inf, "end", np.array([1.0, 0.0, 0.0]), reach=3e-3)
    sds = []
    for _ in range(count):
        plan = finder.slide(end, Crest(WIRE, 5e-6, WIDE, sign))
        move = next(plan)
        with pytest.raises(StopIteration) as done:
            trace = finger.execute(move)
            plan.send(trace.select(np.linspace(0, len(trace) - 1, pecks).astype(int)) if pecks else trace)
        end = done.value.value
        sds.append(end.sd)
    return end, sds, finger.clock


def test_many_slides_together_are_as_much_better_than_one_as_independent_ones_would_be() -> None:
    _, sds, _ = slides(9, seed=1)
    assert 2.0 < sds[0] / sds[8] < 4.0
    assert all(after < before for before, after in itertools.pairwise(sds))


def test_the_end_is_as_near_as_its_standard_deviation_says() -> None:
    scores = []
    for seed in range(12):
        end, _, _ = slides(3, seed)
        scores.append(float(end.point[0] - END[0]) / end.sd)
    # twelve draws: the standard error of their standard deviation is 0.2
    assert abs(np.mean(scores)) < 0.9 and 0.45 < np.std(scores) < 1.65


def test_pecks_tell_the_end_as_slides_do() -> None:
    # a sweep of pecks has 25 contacts: a finder that threw them away as too few repeated them until its time was over
    scores = []
    for seed in range(6):
        end, sds, _ = slides(4, seed, pecks=25)
        assert sds[3] < 0.75 * sds[0] < np.inf
        scores.append(float(end.point[0] - END[0]) / end.sd)
    assert np.abs(scores).max() < 3.0


def test_later_slides_are_shorter_for_they_pass_only_over_the_fall_of_the_crest() -> None:
    first, all_of_them = slides(1, seed=2)[2], slides(5, seed=2)[2]
    assert (all_of_them - first) / 4.0 < 0.62 * first


def test_a_slide_that_feels_nothing_leaves_the_end_as_it_was() -> None:
    base = Base(SCENE.base)
    end = AxisEnd(END, 1e-4, "end", np.array([1.0, 0.0, 0.0]))
    plan = EndFinder(Strokes(base, R), base, Noise(1e-4)).slide(end, Crest(WIRE, 5e-6, WIDE, 1.0))
    move = next(plan)
    trace = SimulatedFinger(object=SCENE.object, tip_radius=R, rate=2000.0).execute(move)
    with pytest.raises(StopIteration) as done:
        plan.send(trace.select(slice(0, 0)))
    assert done.value.value is end


def test_whether_an_end_is_round_leaves_the_place_of_a_wire_open_by_a_fiftieth_of_a_millimetre() -> None:
    # laid over each other, the traces over a round and over a square end are shifted by 0.045 mm
    assert 0.35 * 0.7 < Crest(WIRE, 5e-6, WIDE, 1.0).rounding_sd(R) / 0.045e-3 < 0.35 * 1.3
    assert Crest(WIRE, 5e-6, WIDE, -1.0).rounding_sd(R) == 0.0
