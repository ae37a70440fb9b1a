"""Faults while exploring: the procedure goes on or ends with a reason, and what was measured is kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from faulty_finger import faulty

from explore3d.scene.mesh_files import load_mesh
from hw.move import Move
from hw.simulated.finger import SimulatedFinger
from mapping.arrays import FloatArray
from mapping.base.base import Base
from mapping.surface import Surface
from mapping.trace import Trace
from planners.drive import drive
from planners.explore.discover import Discover
from planners.explore.explore import Explore
from planners.explore.locate import Locate
from planners.paths.limits import Limits
from planners.paths.travel import Ways, routed
from planners.plan import Outcome, Parted, Plan

R = 0.005
MESHES = Path(__file__).resolve().parents[2] / "assets" / "meshes"
PLATE, WIRE = (load_mesh(MESHES / f"{name}.ply", "m") for name in ("tile", "wire_on_tile"))
UP = np.array([0.0, 0.0, 1.0])
AXIS = np.array([[-0.007468129, -0.01003007, 0.0], [0.015468129, 0.00603007, 0.0]])
EMPTY = Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), R)
REASONS = {"done", "budget", "nothing found", "finger refuses", "lost", "misplaced"}


def at(path: list[list[float]], approach: FloatArray) -> Move:
    return Move(np.array(path), approach)


def finger(object: Surface = WIRE) -> SimulatedFinger:
    return SimulatedFinger(object=object, tip_radius=R, rate=1000.0, white=5e-5, correlated=1e-5, seed=2)


def plans() -> dict[str, Plan]:
    explore = Explore(base=Base(PLATE), tip_radius=R, smallest=4e-4, time_budget=400.0)
    low, high = np.array([-0.028, -0.018, -0.008]), np.array([0.028, 0.018, 0.008])
    return {
        "explore": explore.plan(),
        "discover": Discover(low=low, high=high, tip_radius=R, smallest=4e-4).plan(),
        "locate": Locate(base=Base(PLATE), tip_radius=R, smallest=4e-4).plan(),
    }


def ended(name: str, fault: str, moments: set[int]) -> tuple[list[tuple[Move, Trace]], Outcome]:
    touch = finger()
    limits = Limits.of(touch.workspace, None if name == "discover" else Base(PLATE), R)
    return drive(plans()[name], faulty(touch.execute, moments, fault), check=limits.violation, empty=EMPTY)


@pytest.mark.parametrize("fault", ["cut short", "some nan"])
def test_exploring_survives_a_fault_at_the_beginning_in_the_midst_and_late(fault: str) -> None:
    record, outcome = ended("explore", fault, {0, 7, 14, 17, 18, 23, 26, 30, 31, 32})
    assert outcome.reason in REASONS and outcome.detail
    assert outcome.reason == "done" and outcome.value.tracks, outcome.detail
    # the ridge may come in pieces, but they lie where it is
    for track in outcome.value.tracks:
        beside = np.cross(track.points - AXIS[0], (AXIS[1] - AXIS[0]) / np.linalg.norm(AXIS[1] - AXIS[0]))
        assert np.linalg.norm(beside, axis=1).max() < 1e-3
    assert len(record) > 20 and all(np.isfinite(trace.centers).all() for _, trace in record)


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault", ["loses contact", "cut short", "no data", "nan readings", "some nan", "refuses", "shifted"]
)
@pytest.mark.parametrize("name", ["explore", "discover", "locate"])
def test_no_moment_of_a_fault_is_fatal(name: str, fault: str) -> None:
    rng = np.random.default_rng(5)
    for moment in range(0, 48, 4):
        record, outcome = ended(name, fault, {moment, moment + 1, *rng.integers(0, 60, 3).tolist()})
        assert outcome.reason in REASONS, (moment, outcome)
        assert record


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["loses contact", "nan readings"])
@pytest.mark.parametrize("name", ["discover", "locate"])
def test_finding_the_base_survives_faults(name: str, fault: str) -> None:
    _, outcome = ended(name, fault, {0, 3, 5})
    assert outcome.reason == "done" and outcome.value is not None, outcome.detail


@pytest.mark.parametrize("name", ["explore", "discover", "locate"])
@pytest.mark.parametrize("moment", [0, 6, 20])
def test_a_finger_that_is_gone_ends_the_plan_with_what_it_felt(name: str, moment: int) -> None:
    record, outcome = ended(name, "gone", {moment})
    if name == "locate" and moment >= 6:
        assert outcome.reason == "done"  # it needs no more sweeps than that
        return
    assert outcome.reason in ("finger refuses", "lost") and outcome.detail
    assert len(record) == moment


def test_a_finger_that_never_touches_anything_ends_every_plan() -> None:
    for name, plan in plans().items():
        record, outcome = drive(plan, lambda move: EMPTY, empty=EMPTY)
        assert outcome.reason in REASONS and outcome.reason != "done", name
        assert len(record) < 1000


def test_a_plan_whose_moves_are_all_forbidden_ends() -> None:
    limits = Limits.of(finger().workspace, Base(PLATE), R)

    def mad() -> Plan:
        while True:
            yield at([[9.0, 9.0, 9.0]], -UP)

    record, outcome = drive(mad(), finger().execute, check=limits.violation, empty=EMPTY)
    assert not record and outcome.reason == "finger refuses" and "workspace" in outcome.detail


def ball() -> Base:
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.04)
    return Base(Surface(mesh.vertices, mesh.faces))


def test_travel_leads_round_the_body_and_is_free() -> None:
    base = ball()
    before = at([[0.0, 0.0, 0.045]], -UP)
    after = at([[0.001, 0.0, -0.045]], UP)
    touch = SimulatedFinger(object=base.surface, tip_radius=R)
    limits = Limits.of(touch.workspace, base, R)
    assert "the way from the move before" in str(limits.violation(after, before))
    ways = Ways(base, R, touch.workspace.low, touch.workspace.high, 0.1)
    travel = ways.round(before, after)
    assert travel is not None and travel.purpose == "travel" and travel.length < 0.3
    assert limits.violation(travel, before) is None and limits.violation(after, travel) is None
    assert ways.round(before, at([[0.01, 0.0, 0.046]], -UP)) is None  # the straight way is free


def test_a_routed_plan_sends_what_was_felt_to_the_plan_alone() -> None:
    base = ball()
    sent: list[Trace] = []

    def two() -> Plan:
        sent.append((yield at([[0.0, 0.0, 0.045]], -UP)))
        sent.append((yield at([[0.0, 0.001, -0.045]], UP)))
        return Outcome("done")

    answers = (Trace([float(k)], np.zeros((1, 3)), [k], R) for k in range(6))
    plan = routed(two(), Ways(base, R, np.array([-1.0] * 3), np.array([1.0] * 3), 0.25))
    moves, trace = [next(plan)], None
    with pytest.raises(StopIteration):
        while True:
            trace = next(answers)
            moves.append(plan.send(trace))
    assert [move.purpose for move in moves] == ["sweep", "travel", "sweep"]
    assert [each.t.tolist() for each in sent] == [[0.0], [2.0]]
    assert isinstance(sent[1], Parted) and sent[1].moves == tuple(moves[1:])


def test_no_plan_of_a_closed_body_breaks_a_limit() -> None:
    import trimesh

    box = trimesh.creation.box(extents=[0.05, 0.04, 0.03])
    base = Base(Surface(box.vertices, box.faces))
    touch = SimulatedFinger(object=base.surface, tip_radius=5e-3)
    limits = Limits.of(touch.workspace, base, 5e-3)
    ways = Ways(base, 5e-3, touch.workspace.low, touch.workspace.high, 0.1)
    complaints: list[str] = []
    plan = routed(Explore(base=base, tip_radius=5e-3, smallest=3e-4).survey.plan(), ways)
    empty = Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), 5e-3)
    record, outcome = drive(plan, touch.execute, check=limits.violation, note=complaints.append, empty=empty)
    assert not complaints and outcome.reason == "done"
    assert any(move.purpose == "travel" for move, _ in record)
