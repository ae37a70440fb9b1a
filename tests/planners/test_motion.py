"""Motion among a body with an inner corner: what was executed is known, sweeps are split, the finger finds its way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from explore3d.scene.mesh_files import load_mesh
from hw.errors import StoppedError
from hw.move import Move
from hw.simulated.finger import SimulatedFinger
from mapping.arrays import FloatArray
from mapping.base.base import Base
from mapping.surface import Surface
from mapping.trace import Trace
from planners.budget import Spent, within
from planners.drive import drive
from planners.paths.carrier import Carrier
from planners.paths.detour import Detour
from planners.paths.felt_details import DETAIL_ROOM, FeltDetails
from planners.paths.limits import Limits
from planners.paths.reach import reachable
from planners.paths.sound import can_be_left, held_up, resting_at_its_ends, sound_parts
from planners.paths.travel import Ways, dense, gap, routed
from planners.plan import Outcome, Parted, Plan, Refused, executed

R = 0.003
MESHES = Path(__file__).resolve().parents[2] / "assets" / "meshes"
BODY = load_mesh(MESHES / "l_bracket.ply", "m")
BASE = Base(BODY)
ABOVE = np.array([0.0, 0.0, 1.0])
DOWN, LEFT = np.array([0.0, -1.0, 0.0]), np.array([-1.0, 0.0, 0.0])
EMPTY = Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), R)


def sweep(start: list[float], stop: list[float], approach: FloatArray, purpose: str = "sweep") -> Move:
    return Move(1e-3 * np.array([start, stop]), approach, purpose=purpose)


FLOOR = sweep([40, 8.94, 20], [20, 8.94, 20], DOWN)
INTO_WALL = sweep([40, 8.94, 20], [7, 8.94, 20], DOWN)
UNDERSIDE = sweep([20, -2.94, 20], [40, -2.94, 20], -DOWN)


def finger() -> SimulatedFinger:
    return SimulatedFinger(object=BODY, tip_radius=R, rate=500.0)


def driven(*moves: Move) -> tuple[list[Move], list[Trace], list[str]]:
    answers: list[Trace] = []
    complaints: list[str] = []

    def plan() -> Plan:
        for move in moves:
            answers.append((yield move))
        return Outcome("done")

    touch = finger()
    limits = Limits.of(touch.workspace, BASE, R)
    ways = Ways(BASE, R, touch.workspace.low, touch.workspace.high, 0.07)
    plan_to_drive = routed(plan(), ways, limits.violation)
    record, _ = drive(plan_to_drive, touch.execute, check=limits.violation, note=complaints.append, empty=EMPTY)
    return [move for move, _ in record], answers, complaints


def test_a_refused_move_forbids_none_of_those_after_it() -> None:
    inside = sweep([30, 3, 5], [30, 3, 35], DOWN)
    made, answers, complaints = driven(FLOOR, inside, UNDERSIDE, FLOOR)
    assert len(complaints) == 1
    assert [isinstance(each, Refused) for each in answers] == [False, True, False, False]
    assert [move.purpose for move in made] == ["sweep", "travel", "sweep", "travel", "sweep"]


def over_a_floor(size: tuple[float, float, float], at: tuple[float, float, float]) -> Surface:
    """A plate of 60 mm with its top at 0, and a box about a place, mm."""
    from trimesh.creation import box

    floor, other = box(extents=(60, 60, 4)), box(extents=size)
    floor.apply_translation([0, 0, -2])
    other.apply_translation(at)
    return Surface(
        1e-3 * np.concatenate([floor.vertices, other.vertices]), np.concatenate([floor.faces, other.faces + 8])
    )


def test_a_sweep_that_the_finger_could_not_leave_ends_where_it_can() -> None:
    # under the ceiling there is room for the stem, but none to draw back by half a radius
    body = over_a_floor((30, 60, 4), (15, 0, 25.2))
    base, touch = Base(body), SimulatedFinger(object=body, tip_radius=R, rate=500.0)
    limits, carrier = Limits.of(touch.workspace, base, R), Carrier.of(base, R)
    under = sweep([-20, 0, 2.94], [20, 0, 2.94], np.array([0.0, 0.0, -1.0]))
    assert limits.violation(under) is None and not can_be_left(under, carrier)

    def plan() -> Plan:
        yield under
        yield sweep([-20, 10, 2.94], [-10, 10, 2.94], np.array([0.0, 0.0, -1.0]))
        return Outcome("done")

    complaints: list[str] = []
    ways = Ways(base, R, touch.workspace.low, touch.workspace.high, 0.07)
    record, _ = drive(
        routed(plan(), ways, limits.violation), touch.execute, check=limits.violation, note=complaints.append
    )
    sweeps = [move for move, _ in record if move.purpose == "sweep"]
    assert not complaints and len(sweeps) == 2
    assert all(can_be_left(move, carrier) for move in sweeps)
    assert sweeps[0].path[-1, 0] > -2e-3  # nothing of what is open is given up


def test_a_sweep_ends_where_the_ball_keeps_off_what_it_is_drawn_back_towards() -> None:
    # a beam beside the stem: drawn back along the floor's normal the ball comes as near to it as 0.05 radii
    body = over_a_floor((2, 60, 2), (3.3, 0, 7.65))
    base, carrier = Base(body), Carrier.of(Base(body), R)
    along = sweep([0, -10, 2.94], [0, 10, 2.94], np.array([0.0, 0.0, -1.0]))
    assert can_be_left(along, carrier)
    (part,) = sound_parts(along, carrier)
    assert part.length == pytest.approx(along.length)
    drawn = part.path[[0, -1]] - 0.5 * R * part.approach[[0, -1]]
    assert base.foot(drawn, R).height.min() > (DETAIL_ROOM - 0.02) * R - 1e-9


def test_what_was_refused_is_not_asked_again_until_another_move_was_made() -> None:
    inside, backwards = sweep([30, 3, 5], [30, 3, 35], DOWN), sweep([30, 3, 35], [30, 3, 5], DOWN)
    made, answers, complaints = driven(FLOOR, inside, inside, backwards, FLOOR, inside)
    assert len(complaints) == 2 and len(made) == 2
    assert [isinstance(each, Refused) for each in answers] == [False, True, True, True, False, True]


def test_a_plan_that_asks_for_nothing_but_what_was_refused_ends() -> None:
    def plan() -> Plan:
        while True:
            yield sweep([30, 3, 5], [30, 3, 35], DOWN)

    touch = finger()
    limits = Limits.of(touch.workspace, BASE, R)
    ways = Ways(BASE, R, touch.workspace.low, touch.workspace.high, 0.07)
    _, outcome = drive(routed(plan(), ways, limits.violation), touch.execute, check=limits.violation, empty=EMPTY)
    assert outcome.reason == "finger refuses"


def test_a_sweep_into_a_wall_is_made_up_to_the_wall() -> None:
    made, answers, complaints = driven(INTO_WALL)
    assert not complaints and len(made) == 1
    assert isinstance(answers[0], Parted) and executed(INTO_WALL, answers[0]) == tuple(made)
    assert 9.0e-3 < made[0].path[-1, 0] < 9.8e-3 and len(answers[0]) > 400


def test_the_way_out_of_an_inner_corner_leads_sideways() -> None:
    corner = sweep([9.3, 8.94, 10], [9.3, 8.94, 30], DOWN)
    made, _, complaints = driven(corner, UNDERSIDE)
    assert not complaints and [move.purpose for move in made] == ["sweep", "travel", "sweep"]


def test_a_refused_move_costs_nothing() -> None:
    def plan() -> Plan:
        for move in (FLOOR, UNDERSIDE, FLOOR):
            assert len((yield move)) == 0
        return Outcome("done")

    spent = Spent(0.07)
    answers = iter([EMPTY, Refused.because("a wall", R), EMPTY])
    charged = within(plan(), spent, 100.0)
    next(charged)
    with pytest.raises(StopIteration):
        while True:
            charged.send(next(answers))
    assert spent.metres == pytest.approx(0.02 + 0.02 + 0.02)  # two sweeps, and back to the first one's start


def test_a_stem_that_would_touch_is_turned_away() -> None:
    # along the foot, with the finger's axis leant over so that the stem would run into the wall
    leant = np.array([0.8, -0.6, 0.0])
    move = sweep([14, 8.94, 10], [14, 8.94, 30], leant)
    carrier = Carrier.of(BASE, R)
    assert carrier.clearance(move.path, move.approach).max() < 0
    (part,) = sound_parts(move, carrier)
    assert carrier.clearance(part.path, part.approach).min() >= 0
    assert np.arccos(part.approach @ leant).max() <= np.radians(41.0) + 1e-9


def test_what_lies_nearer_to_an_inner_corner_than_the_ball_is_unreachable() -> None:
    x = 1e-3 * np.array([6.5, 8.0, 8.7, 9.1, 12.0, 50.0])
    points = np.column_stack([x, np.full(6, 6e-3), np.full(6, 20e-3)])
    can = reachable(points, np.tile(-DOWN, (6, 1)), Carrier.of(BASE, R))
    assert can.tolist() == [False, False, False, True, True, True]


def test_a_wall_stops_the_simulated_ball() -> None:
    with pytest.raises(StoppedError, match="wall"):
        finger().execute(INTO_WALL)


def test_no_travel_passes_through_the_body() -> None:
    touch = finger()
    touch.execute(FLOOR)
    with pytest.raises(StoppedError, match="runs into the body"):
        touch.execute(sweep([30, 12, 20], [30, -12, 20], DOWN, "travel"))
    assert len(touch.execute(FLOOR)) > 0  # it has drawn back


def test_what_it_cost_to_get_there_is_charged() -> None:
    touch = finger()
    speed = touch.workspace.max_speed
    spent = Spent(speed)

    def plan() -> Plan:
        yield FLOOR
        yield UNDERSIDE
        return Outcome("done")

    limits = Limits.of(touch.workspace, BASE, R)
    ways = Ways(BASE, R, touch.workspace.low, touch.workspace.high, speed)
    record, _ = drive(
        routed(within(plan(), spent, 100.0), ways, limits.violation), touch.execute, check=limits.violation, empty=EMPTY
    )
    assert [move.purpose for move, _ in record] == ["sweep", "travel", "sweep"]
    assert spent.seconds == pytest.approx(touch.clock)


def ring(radius: float, thick: float) -> Base:
    from trimesh.creation import torus

    body = torus(radius, thick, major_sections=48, minor_sections=24)
    return Base(Surface(body.vertices, body.faces))


def test_out_of_a_ring_and_round_it_by_ball_and_stem() -> None:
    body = ring(0.018, 0.007)  # the hole is 22 mm wide, ball and stem behind it 21 mm long
    low, high = body.surface.bounds[0] - 6 * R, body.surface.bounds[1] + 6 * R
    carrier = Carrier.of(body, R)
    detour = Detour(carrier, low, high)
    leant = np.array([0.8, 0.0, -0.6])
    inside, below = np.array([[0.0075, 0.0, 0.0]]), np.array([[-0.018, 0.0, -0.0115]])
    poses = detour.between((inside, leant[None]), (below, np.array([[0.0, 0.0, 1.0]])))
    assert poses is not None
    path, approach = poses
    np.testing.assert_allclose(path[[0, -1]], np.concatenate([inside, below]), atol=1e-12)
    np.testing.assert_allclose(approach[[0, -1]], [leant, [0.0, 0.0, 1.0]], atol=1e-9)
    assert body.foot(path, R).height.min() >= 0.0 and carrier.clearance(path, approach).min() >= 0.0
    # nothing jumps: neither the ball nor the stem's direction
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() <= 0.5 * R + 1e-12
    assert np.arccos(np.clip((approach[1:] * approach[:-1]).sum(axis=1), -1, 1)).max() < np.radians(25.0)


def test_a_closed_cavity_has_no_way_out() -> None:
    from trimesh.creation import icosphere

    inner, outer = icosphere(subdivisions=3, radius=0.012), icosphere(subdivisions=3, radius=0.02)
    faces = np.concatenate([inner.faces[:, ::-1], outer.faces + len(inner.vertices)])
    hollow = Base(Surface(np.concatenate([inner.vertices, outer.vertices]), faces))
    detour = Detour(Carrier(hollow, R, 0.5e-3, 4e-3), np.full(3, -0.05), np.full(3, 0.05))
    assert detour.out(np.zeros(3), DOWN) is None


def test_a_steep_wall_holds_a_ball_up_far_though_it_sinks_into_it_a_little() -> None:
    # against the bracket's wall, pressed down at 10 degrees off it: 0.3 mm into the wall are 1.7 mm up
    lean = np.array([-np.sin(np.radians(10.0)), -np.cos(np.radians(10.0)), 0.0])
    place = 1e-3 * np.array([[8.7, 20.0, 20.0], [9.1, 20.0, 20.0]])
    up = held_up(place, np.tile(lean, (2, 1)), BASE, R)
    assert up == pytest.approx([0.3e-3 / np.sin(np.radians(10.0)), 0.0], rel=1e-6)
    gentle = np.array([-np.sin(np.radians(40.0)), -np.cos(np.radians(40.0)), 0.0])
    assert held_up(place[:1], gentle[None], BASE, R) == pytest.approx([0.3e-3 / np.sin(np.radians(40.0))], rel=1e-6)


def shelf(height: float) -> Base:
    """A floor with its top at z = 0, and the edge of a thin sheet at x = 0 over it, m."""
    from trimesh.creation import box

    floor, sheet = box(extents=(0.1, 0.1, 0.01)), box(extents=(0.05, 0.1, 1e-4))
    floor.apply_translation([0.0, 0.0, -0.005])
    sheet.apply_translation([0.025, 0.0, height])
    return Base(
        Surface(np.concatenate([floor.vertices, sheet.vertices]), np.concatenate([floor.faces, sheet.faces + 8]))
    )


@pytest.mark.parametrize("height", R * np.linspace(2.6, 6.0, 8))
def test_a_stem_passes_a_sharp_edge_without_sinking_into_it(height: float) -> None:
    base, beside = shelf(height), R * np.linspace(-0.7, -0.3, 81)
    carrier, limits = Carrier.of(base, R), Limits.of(finger().workspace, base, R)
    centers = np.column_stack([beside, np.zeros(81), np.full(81, 0.98 * R)])
    free = carrier.is_free(centers, np.tile(-ABOVE, (81, 1)))
    assert (-beside[free]).min() > (0.5 - 0.04) * R
    # and from where it says that it can draw back it may
    sweeps = [Move(np.stack([at - [0.0, 1e-3, 0.0], at]), -ABOVE) for at in centers]
    left = [move for move in sweeps if can_be_left(move, carrier)]
    away = [Move(move.path[-1:] + 0.5 * R * ABOVE, -ABOVE, purpose="travel") for move in left]
    assert left and not any(map(limits.violation, away, left))


def flat_and_hill() -> tuple[Surface, Surface]:
    """A plate of 40 x 40 mm, and the same with a hill 2.4 mm high in its middle."""
    x, y = np.meshgrid(np.linspace(-20e-3, 20e-3, 121), np.linspace(-20e-3, 20e-3, 121), indexing="ij")
    corner = np.arange(120)[:, None] * 121 + np.arange(120)
    a, b, c, d = (each.ravel() for each in (corner, corner + 121, corner + 122, corner + 1))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    flat, hill = (
        Surface(np.column_stack([x.ravel(), y.ravel(), height.ravel()]), faces)
        for height in (np.zeros_like(x), 2.4e-3 * np.exp(-0.5 * (x**2 + y**2) / 3e-3**2))
    )
    return flat, hill


def test_a_way_keeps_out_of_what_a_sweep_felt() -> None:
    flat, hill = flat_and_hill()
    base, down = Base(flat), np.array([0.0, 0.0, -1.0])
    over, left, right = (
        sweep([start, y, 2.94], [stop, y, 2.94], down) for start, stop, y in ((-12, 12, 0), (-12, -6, 0), (6, 12, 0))
    )
    complaints: list[str] = []
    for keep in (False, True):
        touch = SimulatedFinger(object=hill, tip_radius=R, rate=500.0)
        felt = FeltDetails(base, R) if keep else None
        limits = Limits.of(touch.workspace, base, R, felt)
        ways = Ways(base, R, touch.workspace.low, touch.workspace.high, 0.07, felt)

        def plan() -> Plan:
            for move in (over, left, right):  # noqa: UP028  a plan is sent what each move felt
                yield move
            return Outcome("done")

        record, _ = drive(
            routed(plan(), ways, limits.violation), touch.execute, check=limits.violation, note=complaints.append
        )
        moves = [move for move, _ in record]
        # the way between the sweeps beside the hill, as commanded or, where nothing was, straight
        between = moves[-2].path if moves[-2].purpose == "travel" else gap(*moves[-2:], R)
        free = Base(hill).foot(dense(between, 0.1 * R), R).height.min() >= -0.05 * R
        assert free == keep
    assert not complaints


def test_where_a_ball_ran_into_something_no_way_leads_again() -> None:
    base = Base(BODY)
    felt = FeltDetails(base, R)
    ways = Ways(base, R, BODY.bounds[0] - 6 * R, BODY.bounds[1] + 6 * R, 0.07, felt)
    first, then = sweep([50, 8.94, 20], [40, 8.94, 20], DOWN), sweep([20, 8.94, 20], [25, 8.94, 20], DOWN)
    assert ways.round(first, then) is None
    between = 1e-3 * np.array([30, 10.44, 20])
    felt.learn(Refused.because("the travel: the ball runs into the body", R, between), 0.07)
    way = ways.round(first, then)
    assert way is not None
    assert np.linalg.norm(dense(way.path, 0.1 * R) - between, axis=1).min() > DETAIL_ROOM * R / 2


def test_a_plan_is_told_where_the_ball_ran_into_something() -> None:
    answers: list[Trace] = []

    def plan() -> Plan:
        answers.append((yield sweep([40, 12, 20], [3, 12, 20], DOWN, purpose="travel")))
        return Outcome("done")

    drive(plan(), finger().execute, empty=EMPTY)
    assert isinstance(answers[0], Refused) and answers[0].touching is not None
    assert 5e-3 < answers[0].touching[0] < 6e-3 + R


def test_of_a_sweep_that_runs_into_an_unknown_wall_the_rest_is_made() -> None:
    # the ball, which cannot ride up a wall of 0.93 radii, is stopped 4 mm before the middle of it
    base = Base(over_a_floor((60, 60, 1), (0, 0, -2)))
    body = over_a_floor((2, 6, 2.8), (0, 0, 1.4))
    touch = SimulatedFinger(object=body, tip_radius=R, rate=500.0)
    limits, answers = Limits.of(touch.workspace, base, R, FeltDetails(base, R)), list[Trace]()
    over = sweep([-25, 0, 2.94], [25, 0, 2.94], -ABOVE)

    def plan() -> Plan:
        answers.append((yield over))
        return Outcome("done")

    refused: list[str] = []
    ways = Ways(base, R, touch.workspace.low, touch.workspace.high, 0.07, limits.felt)
    drive(
        routed(plan(), ways, limits.violation), touch.execute, check=limits.violation, note=refused.append, empty=EMPTY
    )
    assert "runs into a wall" in refused[0] and len(refused) == 1
    parts = executed(over, answers[0])
    assert [np.round(1e3 * part.path[[0, -1], 0]).tolist() for part in parts] == [[-25.0, -7.0], [-1.0, 25.0]]


def test_a_sweep_ends_where_the_other_wall_of_a_corner_holds_the_ball_up() -> None:
    slope = np.radians(25.0)
    corners = 1e-3 * np.array([[-30, -20, 0], [0, -20, 0], [30, -20, 0], [-30, 20, 0], [0, 20, 0], [30, 20, 0]])
    corners[:, 2] = np.abs(corners[:, 0]) * np.tan(slope)
    base = Base(Surface(corners, [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]))
    along, up = np.array([np.cos(slope), 0.0, -np.sin(slope)]), np.array([np.sin(slope), 0.0, np.cos(slope)])
    path = np.array([[-12e-3], [-0.5e-3]]) * along + 0.98 * R * up
    move, carrier = Move(path, -up), Carrier.of(base, R)
    assert base.foot(path[-1:], R).height[0] < -0.2 * R
    ended = resting_at_its_ends(move, carrier)
    assert np.array_equal(ended.path[0], path[0])
    assert -0.03 * R < base.foot(ended.path[-1:], R).height[0] < 0.0
    assert np.linalg.norm(np.cross(ended.path[-1] - path[-1], up)) < 1e-9
