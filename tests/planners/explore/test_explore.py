"""Exploratory procedures on simulated bodies whose features are known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hw.errors import FingerError
from hw.move import Move
from hw.simulated.finger import SimulatedFinger
from mapping.base.base import Base
from mapping.detection.crossing import Crossing
from mapping.geometry.templates.shapes import cap_height
from mapping.instrument.noise import Noise
from mapping.instrument.stated import StatedNoise
from mapping.surface import Surface
from mapping.trace import Trace
from planners.budget import Spent, within
from planners.drive import drive
from planners.explore.explore import Explore, Found
from planners.explore.surveyor import Surveyor
from planners.follow.axis_track import AxisEnd, AxisTrack, course, polyline_distance
from planners.follow.bump import BumpSizer
from planners.follow.sense import Sense
from planners.follow.template_fit import crest_shape, dip_shape, edge_shape, end_shape, fit_shape
from planners.paths.limits import Limits
from planners.paths.strokes import Strokes, tangential
from planners.plan import Outcome, Plan, Refused

R = 0.01
WIRE = 0.65e-3
PLATE = Surface([[0, 0, 0], [0.08, 0, 0], [0.08, 0.06, 0], [0, 0.06, 0]], [[0, 1, 2], [0, 2, 3]])


def tube(axis: np.ndarray, radius: float, sides: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """A closed-ended tube around a polyline that is not vertical anywhere."""
    along = np.gradient(axis, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    up = np.tile([0.0, 0.0, 1.0], (len(axis), 1))
    side = np.cross(along, up)
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = axis[:, None] + radius * (
        np.cos(angle)[None, :, None] * up[:, None] + np.sin(angle)[None, :, None] * side[:, None]
    )
    caps = []
    for tip, way in ((0, -1.0), (-1, 1.0)):
        for k in range(1, 6):
            lift = np.pi / 2 * k / 6
            shrunk = axis[tip] + np.cos(lift) * (rings[tip] - axis[tip]) + way * np.sin(lift) * radius * along[tip]
            caps.append(shrunk)
    stack = np.concatenate([np.array(caps[4::-1]), rings, np.array(caps[5:])])
    vertices = np.concatenate([stack.reshape(-1, 3), axis[[0, -1]] + radius * along[[0, -1]] * [[-1.0], [1.0]]])
    k, i = (grid.ravel() for grid in np.meshgrid(np.arange(len(stack) - 1), np.arange(sides), indexing="ij"))
    a, b = k * sides + i, k * sides + (i + 1) % sides
    first, last = len(vertices) - 2, len(vertices) - 1
    i = np.arange(sides)
    ends = [
        np.column_stack([np.full(sides, first), i, (i + 1) % sides]),
        np.column_stack(
            [np.full(sides, last), i + (len(stack) - 1) * sides, (i + 1) % sides + (len(stack) - 1) * sides]
        ),
    ]
    return vertices, np.concatenate(
        [np.column_stack([a, b, b + sides]), np.column_stack([a, b + sides, a + sides]), *ends]
    )


def with_tubes(*axes: np.ndarray) -> Surface:
    vertices, faces = [PLATE.vertices], [PLATE.faces]
    for axis in axes:
        v, f = tube(axis + np.array([0, 0, WIRE / 2]), WIRE / 2)
        faces.append(f + sum(len(part) for part in vertices))
        vertices.append(v)
    return Surface(np.concatenate(vertices), np.concatenate(faces))


def explore(body: Surface, *, seed: int = 0, **settings: Any) -> tuple[Found, SimulatedFinger, Outcome]:
    finger = SimulatedFinger(object=body, tip_radius=R, rate=1500.0, seed=seed, white=1e-4, correlated=1e-5)
    procedure = Explore(base=Base(PLATE), tip_radius=R, smallest=3e-4, **settings)
    limits = Limits.of(finger.workspace, procedure.base, R)
    _, outcome = drive(procedure.plan(), finger.execute, check=limits.violation)
    return outcome.value, finger, outcome


def straight() -> np.ndarray:
    return np.linspace([0.02, 0.021, 0.0], [0.06, 0.037, 0.0], 5)


def worst_distance(track: AxisTrack, axis: np.ndarray) -> float:
    return max(polyline_distance(point, axis) for point in track.points)


@pytest.fixture(scope="module")
def wire() -> tuple[Found, SimulatedFinger, Outcome]:
    return explore(with_tubes(straight()))


def test_a_wire_is_followed_to_both_of_its_ends(wire: tuple[Found, SimulatedFinger, Outcome]) -> None:
    found, _, outcome = wire
    assert outcome.reason == "done"
    assert len(found.tracks) == 1 and not found.bumps
    track = found.tracks[0]
    ends = sorted((track.points[[0, -1]]).tolist())
    assert np.linalg.norm(np.array(ends) - straight()[[0, -1]], axis=1).max() < 3e-4
    assert worst_distance(track, straight()) < 2.5e-4
    assert track.height == pytest.approx(WIRE, rel=0.08)
    assert all(end.sd < 1e-4 / 1.645 for end in track.ends)


def test_a_wire_swept_lengthwise_by_the_survey_is_found_all_the_same() -> None:
    axis = np.linspace([0.02, 0.03, 0.0], [0.06, 0.03, 0.0], 5)
    found, _, _ = explore(with_tubes(axis))
    assert len(found.tracks) == 1
    assert not found.tracks[0].step and found.tracks[0].sign > 0
    assert found.tracks[0].length == pytest.approx(0.04, abs=5e-4)


def test_a_ring_is_recognised_by_returning_to_its_beginning() -> None:
    angle = np.linspace(0, 2 * np.pi, 73)
    ring = np.column_stack([0.04 + 0.015 * np.cos(angle), 0.03 + 0.015 * np.sin(angle), 0 * angle])
    found, _, _ = explore(with_tubes(ring))
    assert len(found.tracks) == 1 and found.tracks[0].closed
    assert worst_distance(found.tracks[0], ring) < 3e-4
    assert found.tracks[0].length == pytest.approx(2 * np.pi * 0.015, rel=0.03)


def test_two_ridges_eight_millimetres_apart_stay_two() -> None:
    axes = [np.linspace([0.02, y, 0.0], [0.06, y, 0.0], 5) for y in (0.026, 0.034)]
    found, _, _ = explore(with_tubes(*axes))
    assert len(found.tracks) == 2
    rows = sorted(float(np.median(track.points[:, 1])) for track in found.tracks)
    assert rows == pytest.approx([0.026, 0.034], abs=2e-4)


def test_a_ball_is_a_bump_at_its_place() -> None:
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.001)
    vertices = np.concatenate([PLATE.vertices, np.add(ball.vertices, [0.041, 0.029, 0.0])])
    body = Surface(vertices, np.concatenate([PLATE.faces, ball.faces + len(PLATE.vertices)]))
    found, _, _ = explore(body)
    assert not found.tracks and len(found.bumps) == 1
    assert np.linalg.norm(found.bumps[0].point - [0.041, 0.029, 0.0]) < 2e-4
    assert found.bumps[0].height == pytest.approx(0.001, rel=0.05)


def test_a_wide_dent_that_the_survey_crossed_once_is_told_by_what_goes_round_it() -> None:
    x, y = (np.linspace(0.0, side, round(side / 2e-3) + 1) for side in (0.08, 0.06))
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    share = np.clip(np.linalg.norm(places - [0.04, 0.02], axis=1) / 0.018, 0.0, 1.0)
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1), indexing="ij"))
    a = i * len(y) + j
    b = a + len(y)
    faces = np.concatenate([np.column_stack([a, b, b + 1]), np.column_stack([a, b + 1, a + 1])])
    body = Surface(np.column_stack([places, -1e-3 * (1.0 + np.cos(np.pi * share))]), faces)
    found, finger, _ = explore(body, shortest_ridge=0.025)
    assert not found.tracks and not found.bumps
    assert found.actions == ["look into: part (the body differs from its model there)"]
    assert finger.clock < 25.0


def test_nothing_is_found_on_a_bare_plate_and_nothing_but_the_survey_is_done() -> None:
    found, finger, outcome = explore(PLATE)
    assert outcome.reason == "nothing found"
    assert not found.tracks and not found.bumps and not found.crossings
    surveyed = sum(move.duration for move in Explore(base=Base(PLATE), tip_radius=R, smallest=3e-4).survey.sweeps())
    assert 0.7 * surveyed < finger.clock < 1.05 * surveyed  # strips may be wider than planned before the noise is known
    assert found.left_out


def test_the_same_seed_gives_the_same_exploration(wire: tuple[Found, SimulatedFinger, Outcome]) -> None:
    again, _, _ = explore(with_tubes(straight()))
    assert np.array_equal(wire[0].tracks[0].points, again.tracks[0].points)


def test_the_time_budget_ends_it_and_what_was_found_is_kept() -> None:
    found, finger, outcome = explore(with_tubes(straight()), time_budget=35.0)
    assert outcome.reason == "budget"
    assert finger.clock <= 35.0 + 1e-6
    assert isinstance(found, Found)


def faulty(execute: Callable[[Move], Trace], broken: set[int], fault: str) -> Callable[[Move], Trace]:
    count = 0

    def wrapped(move: Move) -> Trace:
        nonlocal count
        count += 1
        trace = execute(move)
        if count not in broken:
            return trace
        if fault == "refused":
            raise FingerError("not now")
        return trace.select(slice(0, 0 if fault == "no data" else len(trace) // 3))

    return wrapped


@pytest.mark.parametrize(
    "fault", ["refused", *(pytest.param(f, marks=pytest.mark.slow) for f in ("no data", "cut short"))]
)
def test_faults_while_exploring_do_not_stop_it(fault: str) -> None:
    finger = SimulatedFinger(object=with_tubes(straight()), tip_radius=R, rate=1500.0, white=1e-4)
    plan = Explore(base=Base(PLATE), tip_radius=R, smallest=3e-4).plan()
    _, outcome = drive(plan, faulty(finger.execute, {3, 19, 22, 25}, fault))
    assert outcome.reason == "done"
    assert len(outcome.value.tracks) >= 1
    assert max(track.length for track in outcome.value.tracks) > 0.03


def test_a_finger_that_refuses_everything_ends_the_plan_with_its_reason() -> None:
    def refuse(move: Move) -> Trace:
        raise FingerError("door open")

    record, outcome = drive(Explore(base=Base(PLATE), tip_radius=R, smallest=3e-4).plan(), refuse)
    assert record == [] and outcome.reason == "finger refuses" and "door open" in outcome.detail


@pytest.mark.parametrize(
    ("shape", "sign"),
    [
        (crest_shape(WIRE / 2, R), 1.0),
        (dip_shape(R), -1.0),
        (end_shape(1.0, R), 1.0),
        (end_shape(-1.0, R), -1.0),
        (edge_shape(R), 1.0),
    ],
)
def test_a_shape_fit_without_noise_is_exact_and_with_noise_as_good_as_it_says(shape: Callable, sign: float) -> None:
    s = np.linspace(-0.008, 0.008, 1600)
    truth = sign * shape(s - 0.7e-3, 6e-4)
    exact = fit_shape(s, truth, shape, sign, 5e-4, (-3e-3, 3e-3), Noise(0.0))
    assert exact.place == pytest.approx(0.7e-3, abs=2e-6)
    assert exact.height == pytest.approx(sign * 6e-4, rel=1e-2)
    rng = np.random.default_rng(8)
    fits = [
        fit_shape(s, truth + 1e-4 * rng.standard_normal(1600), shape, sign, 5e-4, (-3e-3, 3e-3), Noise(1e-4))
        for _ in range(40)
    ]
    scores = np.array([(fit.place - 0.7e-3) / fit.sd for fit in fits])
    # 40 draws: the standard error of their standard deviation is 0.11
    assert 0.65 < scores.std() < 1.45 and abs(scores.mean()) < 0.6


def test_a_course_fitted_to_points_of_a_circle_has_its_direction_and_curvature() -> None:
    angle = np.linspace(0, 0.8, 7)
    points = 0.015 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    ahead = course(points, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), R)
    assert ahead.heading == pytest.approx([-np.sin(0.8), np.cos(0.8), 0.0], abs=0.02)
    assert ahead.turn == pytest.approx(1 / 0.015, rel=0.05)


def test_a_walk_round_a_convex_edge_keeps_its_length_and_turns_down() -> None:
    corners = [[0, 0, 0], [0.05, 0, 0], [0.05, 0.05, 0], [0, 0.05, 0], [0.05, 0, -0.05], [0.05, 0.05, -0.05]]
    fold = Surface(corners, [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]])
    walk = Strokes(Base(fold), R).walk(np.array([0.04, 0.02, 0.0]), np.array([1.0, 0.0, 0.0]), 0.02)
    assert walk.points[-1] == pytest.approx([0.05, 0.02, -0.01], abs=1.2e-3)
    assert walk.directions[-1] == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
    assert not walk.cut


def test_a_walk_off_the_border_is_cut() -> None:
    walk = Strokes(Base(PLATE), R).walk(np.array([0.07, 0.03, 0.0]), np.array([1.0, 0.0, 0.0]), 0.03)
    assert walk.cut and walk.along[-1] == pytest.approx(0.01, abs=1e-3)


def test_a_direction_along_the_normal_still_gives_a_tangent() -> None:
    normal = np.array([0.0, 0.6, 0.8])
    tangent = tangential(normal, normal)
    assert abs(tangent @ normal) < 1e-12 and np.linalg.norm(tangent) == pytest.approx(1.0)


def test_limits_name_what_is_wrong_with_a_move() -> None:
    finger = SimulatedFinger(object=PLATE, tip_radius=R)
    limits = Limits.of(finger.workspace, Base(PLATE), R)
    path = np.array([[0.01, 0.03, R], [0.07, 0.03, R]])
    down = np.array([0.0, 0.0, -1.0])
    assert limits.violation(Move(path, down)) is None
    assert "workspace" in str(limits.violation(Move(path + np.array([1.0, 0, 0]), down)))
    assert "m/s" in str(limits.violation(Move(path, down, speed=9.0)))
    assert " N" in str(limits.violation(Move(path, down, force=1e4)))
    assert "80 degrees" in str(limits.violation(Move(path, [np.sin(1.396), 0.0, -np.cos(1.396)])))
    assert "sinks" in str(limits.violation(Move(path - [0, 0, 0.5 * R], down, purpose="travel")))


def test_a_budget_counts_the_way_between_sweeps() -> None:
    path = np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0]])
    spent = Spent(travel_speed=0.1)
    spent.count(Move(path, [0.0, 0.0, -1.0]))
    spent.count(Move(path, [0.0, 0.0, -1.0]))
    assert spent.seconds == pytest.approx(2.0 + 0.3) and spent.metres == pytest.approx(0.09)

    def endless() -> Plan:
        while True:
            yield Move(path, [0.0, 0.0, -1.0])

    record, outcome = drive(within(endless(), Spent(0.1), 5.0), lambda move: Trace.from_profile([0.0], [0.0], R))
    assert outcome.reason == "budget" and len(record) == 4


def test_the_end_shape_of_a_ridge_is_that_of_its_cap() -> None:
    x = np.linspace(0, 0.005, 50)
    assert np.allclose(end_shape(1.0, R)(x, WIRE), cap_height(x, WIRE, WIRE / 2, R))
    assert np.allclose(end_shape(1.0, R)(-x, WIRE), WIRE)


def test_an_end_moved_back_takes_the_points_beyond_it_along() -> None:
    points = np.linspace([0.0, 0.0, 0.0], [0.05, 0.0, 0.0], 6)
    ways = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    ends = tuple(AxisEnd(point, 1e-4, "end", way) for point, way in zip(points[[0, -1]], ways, strict=True))
    track = AxisTrack(points, np.tile([0.0, 0.0, 1.0], (6, 1)), 1.0, False, WIRE, 1e-5, 3.6e-3, ends)
    for index, way in enumerate(ways):
        moved = replace(ends[index], point=ends[index].point - 0.013 * way)
        shorter = track.with_end(index, moved)
        assert shorter.length == pytest.approx(0.037)
        assert shorter.ends[index] is moved


def test_the_noise_that_is_learnt_begins_from_what_is_stated_and_does_not_end_there() -> None:
    true = Noise(1e-4, 1e-5)
    learnt, _, _ = explore(PLATE, shortest_ridge=0.03)
    told, _, _ = explore(PLATE, shortest_ridge=0.03, stated=StatedNoise(true, 0.01))
    misled, _, _ = explore(PLATE, shortest_ridge=0.03, stated=StatedNoise(Noise(3e-4, 1e-5), 0.1))
    assert learnt.noise is not None and told.noise is not None and misled.noise is not None
    assert told.noise.correlated == pytest.approx(true.correlated, rel=0.05)
    assert abs(told.noise.correlated - true.correlated) < abs(learnt.noise.correlated - true.correlated)
    assert misled.noise.white == pytest.approx(true.white, rel=0.05)


def test_what_the_survey_may_have_missed_is_said_where_the_exploration_ends() -> None:
    found, _, outcome = explore(PLATE, shortest_ridge=0.03)
    assert "not inspected for features smaller than a ridge that spans 30 mm" in outcome.detail
    assert len(found.unseen) == 1 and not found.crossings
    _, _, outcome = explore(PLATE)
    assert "not inspected" not in outcome.detail


def test_what_is_lower_than_asked_for_and_hardly_above_the_noise_is_passed_over() -> None:
    def crossing(number: int, height: float, snr: float) -> Crossing:
        place, up, along = np.array([0.01 * number, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
        sd = abs(height) / snr
        kind = "convex" if height > 0 else "concave"
        return Crossing(number, 0.0, place, up, along, kind, height, sd, 1e-4, 1e-3, 0.0, snr, True, 0, 1)

    found = Found(R, asked=1e-4, reported=5.3)
    # as high as asked for; lower by one standard deviation; a dip as deep; lower, but the analysis would report it
    found.crossings = [
        crossing(0, 2e-4, 4.7), crossing(1, 8e-5, 5.0), crossing(2, -8e-5, 5.0), crossing(3, 4e-5, 5.4)
    ]  # fmt: skip
    assert len(found.unexplained()) == 4 and found.passed_over() == 0
    found.crossings += [crossing(4, 4e-5, 4.8), crossing(5, -3e-5, 5.2)]  # what noise makes
    assert [each.sweep for each in found.unexplained()] == [0, 1, 2, 3]
    assert found.passed_over() == 2
    assert replace(found, asked=0.0).passed_over() == 0


def test_a_bump_that_is_not_there_costs_two_sweeps() -> None:
    finger = SimulatedFinger(object=PLATE, tip_radius=R, rate=1500.0, seed=3, white=1e-4)
    base, up, along = Base(PLATE), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    seed = Crossing(
        0, 0.0, np.array([0.04, 0.03, 0.0]), up, along, "convex", 1e-4, 2e-5, 1e-4, 2e-3, 0.0, 5.0, True, 0, 1
    )
    sizer = BumpSizer(Strokes(base, R), Sense(base, Noise(1e-4)), 1e-4)
    record, outcome = drive(sizer.size(seed), finger.execute)
    assert outcome.reason == "lost" and len(record) == 2


class Line(int):
    """A line that is known by its number."""

    length = 2.0


def survey_of(parts: dict[int, list[int]], pressed: list[int]) -> Any:
    """Ten lines, each a sweep but where it is said to be in other parts; what was laid out is put into `pressed`."""

    def press(line):
        pressed.append(line)
        yield from parts.get(line, [line])

    return SimpleNamespace(visible=0.35, lines=lambda visible: map(Line, range(10)), pressed=press)


def test_a_survey_is_worked_out_a_little_ahead_while_its_sweeps_are_made_and_knows_how_long_it_is():
    pressed = list[int]()
    surveyor = Surveyor(survey_of({4: [], 5: [5, 50], 9: []}, pressed), Found(R), 1.0)
    moves, known, planned = list[int](), list[int](), list[int | None]()
    for move in surveyor._laid_out():
        moves.append(move)
        known.append(len(pressed))
        planned.append(surveyor.count.planned)
        surveyor.meanwhile.finish()  # the move is made
        surveyor.count.made += 1
    assert moves == [0, 1, 2, 3, 5, 50, 6, 7, 8] and surveyor.count.planned == surveyor.count.made == 9
    assert known == [2, 3, 4, 6, 6, 8, 8, 9, 10]  # two sweeps ahead, and nothing is laid out between two moves
    assert planned == [10] * 8 + [9]  # one line gives none, one is in two parts, and the last gives none again
    assert surveyor.metres == 20.0


def test_a_survey_whose_finger_works_out_nothing_makes_the_same_sweeps():
    surveyor = Surveyor(survey_of({2: [], 3: [], 4: [], 9: []}, list[int]()), Found(R), 1.0)
    assert list(surveyor._laid_out()) == [0, 1, 5, 6, 7, 8]


@pytest.mark.parametrize(("expected", "before"), [(1e-4, [0, 1]), (None, [0])])
def test_a_survey_that_does_not_stand_is_laid_out_again_while_its_second_sweep_is_made_if_it_should_have_stood(
    monkeypatch, expected, before
):
    survey = survey_of({}, list[int]())
    survey.crossed, survey.base = lambda visible: None, Base(PLATE)
    survey.smallest = 1e-3
    surveyor = Surveyor(survey, Found(R), 1.0, expected=expected)
    monkeypatch.setattr(Surveyor, "_stands", lambda self, done, first: False)
    plan, asked = surveyor.plan(), list[int]()
    move = next(plan)
    while True:
        asked.append(move)
        surveyor.meanwhile.finish()
        try:
            move = plan.send(Refused.because("none is made here", R))
        except StopIteration:
            break
    assert asked == [*before, *range(10)]
    assert surveyor.found.left_out == ["a survey sweep was not carried out"] * 10  # those before are not told
