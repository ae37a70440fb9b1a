"""Ends of lines: what a slide off one tells, and what sweeps across it tell together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from explore3d.bench.scenes.exploring import SCENES, WIRE, BenchScene, line, wires
from hw.simulated.finger import SimulatedFinger
from mapping.base.base import Base
from mapping.instrument.noise import Noise
from planners.follow.axis_track import AxisEnd
from planners.follow.end_finder import MOST_PASSES, Crest, EndFinder
from planners.paths.strokes import Strokes

R = 0.01
SCENE = wires(line(0.05))
END = np.array([0.025, 0.0, 0.0])
WAY = np.array([1.0, 0.0, 0.0])
WIDE = float(np.sqrt(2.0 * R * WIRE))
CREST = Crest(WIRE, 5e-6, WIDE, 1.0)
WANTED = (25e-6, 30e-6)


def found(
    end: AxisEnd,
    seed: int,
    *,
    scene: BenchScene = SCENE,
    slides: bool = False,
    pecks: int = 0,
    lying: float = 0.0,
    crest: Crest = CREST,
) -> tuple[AxisEnd, int]:
    """The end after a slide or after sweeps across, of so many pecks each, and the number of the sweeps.

    Every sweep's heights lie off by a constant of a standard deviation (m).
    """
    rng = np.random.default_rng(seed)
    finger = SimulatedFinger(object=scene.object, tip_radius=R, rate=2000.0, white=1e-4, correlated=1e-5, seed=seed)
    base = Base(scene.base)
    finder = EndFinder(Strokes(base, R), base, Noise(1e-4, 1e-5, 1e-3))
    plan = finder.slide(end, crest) if slides else finder.sharpen(end, crest, WANTED)
    move, count = next(plan), 0
    while True:
        trace = finger.execute(move)
        trace = replace(trace, centers=trace.centers + np.array([0.0, 0.0, lying * rng.standard_normal()]))
        count += 1
        try:
            move = plan.send(trace.select(np.linspace(0, len(trace) - 1, pecks).astype(int)) if pecks else trace)
        except StopIteration as done:
            return (done.value if slides else done.value[0]), count


def supposed(along: float, across: float) -> AxisEnd:
    """The wire's end, supposed to be so far off, m."""
    return AxisEnd(END + np.array([along, across, 0.0]), 1e-4, "end", WAY)


def test_a_slide_finds_the_end_as_near_as_its_standard_deviation_says() -> None:
    rough = AxisEnd(END - [1.5e-3, 0.0, 0.0], np.inf, "end", WAY, reach=3e-3)
    ends = [found(rough, seed, slides=True)[0] for seed in range(12)]
    scores = [float(end.point[0] - END[0]) / end.sd for end in ends]
    # twelve draws: the standard error of their standard deviation is 0.2
    assert abs(np.mean(scores)) < 0.9 and 0.45 < np.std(scores) < 1.65


def test_a_slide_finds_an_end_beyond_where_crossings_bracketed_it() -> None:
    """As that of a groove, whose edge lifts the ball half a disturbance before: no slide of one was believed."""
    rough = AxisEnd(END - [4e-3, 0.0, 0.0], np.inf, "end", WAY, reach=2e-3)
    end, _ = found(rough, seed=1, slides=True)
    assert end.reason == "end" and abs(end.point[0] - END[0]) < 4.0 * end.sd


def test_sweeps_across_tell_the_end_along_the_line_and_across_as_well_as_asked() -> None:
    scores = []
    for seed in range(8):
        end, count = found(supposed(1e-4, -2e-4), seed)
        assert end.sd <= WANTED[0] and end.across_sd <= WANTED[1] and count < 20
        scores.append((end.point - END)[:2] / [end.sd, end.across_sd])
    # sixteen draws: the standard error of their standard deviation is 0.18
    assert np.abs(np.mean(scores, axis=0)).max() < 1.1 and 0.45 < np.std(scores) < 1.6


def test_sweeps_that_lie_off_their_base_tell_an_end_as_the_model_does() -> None:
    """The model gives every sweep an offset and a slope; taken for the line's, 0.02 mm moved its end by 0.04 mm."""
    ends = [found(supposed(1e-4, -1e-4), seed, lying=20e-6)[0] for seed in range(6)]
    scores = [(end.point - END)[:2] / [end.sd, end.across_sd] for end in ends]
    # twelve draws: the standard error of their standard deviation is 0.2
    assert np.sqrt(np.mean(np.square(scores))) < 1.6


def test_an_end_of_a_line_that_bends_is_found_across_it() -> None:
    scene = SCENES["curved"](np.random.default_rng(20))
    axis = scene.truth[0].axis
    way = (axis[-1] - axis[-2]) / np.linalg.norm(axis[-1] - axis[-2])
    left = np.cross([0.0, 0.0, 1.0], way)
    turn = float(np.sign((axis[-10] - axis[-1]) @ left)) / 0.015
    ends = [found(AxisEnd(axis[-1], 1e-4, "end", way, turn=turn), seed, scene=scene)[0] for seed in range(3)]
    scores = [(end.point - axis[-1]) @ left / end.across_sd for end in ends]
    # its course bent on beyond the end it was 5 standard deviations off
    assert np.abs(scores).max() < 3.0


def test_pecks_tell_the_end_as_sweeps_do() -> None:
    # a sweep of pecks has 25 contacts: a finder that threw them away as too few repeated them until its time was over
    for seed in range(3):
        end, _ = found(supposed(0.0, 1e-4), seed, pecks=25)
        assert np.abs((end.point - END)[:2] / [end.sd, end.across_sd]).max() < 3.0


def test_a_line_that_goes_on_is_soon_seen_to_have_no_end_there() -> None:
    supposed_end = AxisEnd(np.zeros(3), 1e-4, "end", WAY)
    end, count = found(supposed_end, seed=1)
    assert end is supposed_end and count < MOST_PASSES / 10


def test_an_end_on_a_twisted_base_is_found_nearly_as_on_a_flat_one() -> None:
    scene = SCENES["helix"](np.random.default_rng(3))
    axis, off = scene.truth[0].axis, []
    # across it the cylinder of 20 mm bends by sin(33.6 degrees)^2 / 20 mm
    crest = replace(CREST, half_width=WIDE / np.sqrt(1.0 + 0.305 * R / 0.02))
    for last, before in ((0, 1), (-1, -2)):
        way = (axis[last] - axis[before]) / np.linalg.norm(axis[last] - axis[before])
        end, _ = found(AxisEnd(axis[last], 1e-4, "end", way), seed=1, scene=scene, crest=crest)
        outward = axis[last] * [1.0, 1.0, 0.0] / np.linalg.norm(axis[last, :2])
        off.append((end.point - axis[last]) @ np.column_stack([way, np.cross(outward, way)]))
    # taken for untwisted they are 0.29 mm off, and 0.10 mm to the side for a ridge as wide as on a flat base
    assert np.linalg.norm(off, axis=1).max() < 0.08e-3


def test_a_slide_that_feels_nothing_leaves_the_end_as_it_was() -> None:
    base = Base(SCENE.base)
    end = AxisEnd(END, 1e-4, "end", WAY)
    plan = EndFinder(Strokes(base, R), base, Noise(1e-4)).slide(end, CREST)
    move = next(plan)
    trace = SimulatedFinger(object=SCENE.object, tip_radius=R, rate=2000.0).execute(move)
    with pytest.raises(StopIteration) as done:
        plan.send(trace.select(slice(0, 0)))
    assert done.value.value is end


def test_an_end_that_no_slide_showed_is_found_by_sweeps_across() -> None:
    rough = AxisEnd(END - [0.8e-3, 0.0, 0.0], np.inf, "end", WAY, reach=2e-3)
    ends = [found(rough, seed)[0] for seed in range(4)]
    assert max(end.sd for end in ends) <= WANTED[0]
    # eight draws: the standard error of their standard deviation is 0.25
    assert np.std([(end.point - END)[:2] / [end.sd, end.across_sd] for end in ends]) < 1.8


def test_sweeps_across_that_feel_nothing_leave_the_end_as_it_was() -> None:
    for sd in (1e-4, np.inf):
        end = AxisEnd(END, sd, "end", WAY)
        assert found(end, seed=1, pecks=1)[0] is end


def test_whether_an_end_is_round_leaves_the_place_of_a_wire_open_by_a_fiftieth_of_a_millimetre() -> None:
    # laid over each other, the traces over a round and over a square end are shifted by 0.045 mm
    assert 0.35 * 0.7 < Crest(WIRE, 5e-6, WIDE, 1.0).rounding_sd(R) / 0.045e-3 < 0.35 * 1.3
    assert Crest(WIRE, 5e-6, WIDE, -1.0).rounding_sd(R) == 0.0
