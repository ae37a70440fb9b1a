"""Expeditions: a body that is not known, or stands off its model, is found and explored like any other."""

from __future__ import annotations

import gc
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import thread_time

import numpy as np
import pytest
from scene_files import write_scene_file

from explore3d.analysis.result import Analysis
from explore3d.errors import UserError
from explore3d.jobs.analyze import analyze
from explore3d.jobs.expedition import Waits
from explore3d.jobs.run import run
from explore3d.log.own.reader import read_log
from explore3d.log.own.record import read_base
from explore3d.scene.mesh_files import load_mesh
from hw.errors import FingerError
from hw.move import Move
from hw.simulated.finger import SimulatedFinger
from mapping.base.pose import Pose
from mapping.trace import Trace

ASSETS = Path(__file__).resolve().parents[3] / "assets"
AXIS = np.array([[-0.007468129, -0.01003007, 0.0], [0.015468129, 0.00603007, 0.0]])

SCENE = """
schema = "explore3d/scene/1"
tip.radius = "5 mm"
seed = 3
[model]
{model}
[finger]
object = "{object}"
rate = "1 kHz"
[finger.noise]
white = "0.05 mm"
correlated = "0.005 mm"
[survey]
smallest_feature = "0.4 mm"
[[truth]]
kind = "ridge"
axis = {axis}
height = 0.00065
width = 0.00065
length = 0.028
"""


def write_scene(folder: Path, model: str, object: Path, axis: np.ndarray = AXIS) -> Path:
    touched = object.relative_to(folder) if object.is_relative_to(folder) else object
    return write_scene_file(folder / "scene.toml", SCENE.format(model=model, object=touched, axis=axis.tolist()))


def moved_tile(folder: Path) -> tuple[Path, Pose]:
    """The tile with its wire, shifted by 3 mm and turned by 2 degrees."""
    x, y, z = np.array([1.0, 2.0, 0.5]) / np.linalg.norm([1.0, 2.0, 0.5])
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(2.0)
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    shift = np.array([0.5e-3, 0.5e-3, 2.9e-3])
    pose = Pose(rotation, shift, np.zeros(3), np.zeros((6, 6)))
    mesh = load_mesh(ASSETS / "meshes" / "wire_on_tile.ply", "m")
    lines = [f"v {a!r} {b!r} {c!r}" for a, b, c in pose.onto(mesh.vertices).tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces.tolist()]
    (folder / "moved.obj").write_text("\n".join(lines) + "\n")
    return folder / "moved.obj", pose


def the_wire_is_found(analysis: Analysis) -> None:
    found = [row for row in analysis.errors if row.status == "found"]
    assert len(found) == 1 and found[0].found is not None and found[0].found.kind == "ridge"
    assert found[0].axis_rms < 1e-4 and found[0].end_error < 5e-4
    assert abs(found[0].height_error) < 2e-5


@pytest.mark.slow
def test_a_wire_on_an_unknown_plate_is_found(tmp_path: Path) -> None:
    region = 'region = { low = ["-28 mm", "-18 mm", "-8 mm"], high = ["28 mm", "18 mm", "8 mm"] }'
    scene = write_scene(tmp_path, region, ASSETS / "meshes" / "wire_on_tile.ply")
    analysis = run(scene, tmp_path / "out")
    assert analysis.base.kind == "plane" and "plane" in analysis.ended
    assert np.abs(analysis.base.surface.vertices[:, 2]).max() < 1e-5
    the_wire_is_found(analysis)
    again = analyze(tmp_path / "out", tmp_path / "again")
    assert again.ended == analysis.ended and again.base.kind == "plane"


@pytest.mark.slow
def test_an_object_three_millimetres_off_its_mesh_is_explored_where_it_stands(tmp_path: Path) -> None:
    object, true = moved_tile(tmp_path)
    model = f'mesh = "{ASSETS}/meshes/tile.ply"\npose = "estimate"'
    analysis = run(write_scene(tmp_path, model, object, true.onto(AXIS)), tmp_path / "out")
    the_wire_is_found(analysis)
    pose = Pose.of(analysis.base)
    tile = load_mesh(ASSETS / "meshes" / "tile.ply", "m").vertices
    off = (pose.onto(tile) - true.onto(tile)) @ true.rotation[:, 2]
    assert np.abs(off).max() < 2e-5
    ridge = analysis.model.features[0]
    assert np.abs(pose.onto(ridge.extra["axis_in_model_frame"]) - ridge.axis).max() < 1e-12
    logged = read_base(read_log(tmp_path / "out" / "log.mcap").events)
    assert logged is not None and logged.pose is not None
    again = analyze(tmp_path / "out", tmp_path / "again")
    assert [f.axis.tolist() for f in again.model.features] == [f.axis.tolist() for f in analysis.model.features]


def test_an_object_that_is_not_there_ends_the_run_in_one_sentence(tmp_path: Path) -> None:
    region = 'region = { low = ["-28 mm", "-18 mm", "12 mm"], high = ["28 mm", "18 mm", "20 mm"] }'
    scene = write_scene(tmp_path, region, ASSETS / "meshes" / "tile.ply")
    with pytest.raises(UserError, match="nothing was felt: no body was touched"):
        run(scene, tmp_path / "out")
    assert not (tmp_path / "out").exists()


class LooseFinger(SimulatedFinger):
    def execute(self, move: Move) -> Trace:
        raise FingerError("the cable is loose; plug it in")


def test_a_finger_that_refuses_every_move_says_why_nothing_was_felt(tmp_path: Path) -> None:
    tile = ASSETS / "meshes" / "tile.ply"
    scene = write_scene(tmp_path, f'mesh = "{tile}"', tile)
    with pytest.raises(UserError, match="nothing was felt: the cable is loose; plug it in"):
        run(scene, tmp_path / "out", finger=LooseFinger(object=load_mesh(tile, "m"), tip_radius=5e-3))


class MillimetreFinger(SimulatedFinger):
    def execute(self, move: Move) -> Trace:
        trace = super().execute(move)
        return replace(trace, centers=1e3 * trace.centers)


class BackwardsFinger(SimulatedFinger):
    def execute(self, move: Move) -> Trace:
        trace = super().execute(move)
        return replace(trace, t=trace.t[::-1])


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (MillimetreFinger, "outside of its own workspace.* in millimetres instead of metres"),
        (BackwardsFinger, "run backwards"),
    ],
)
def test_a_finger_that_returns_nonsense_stops_the_run_at_its_first_sweep(
    tmp_path: Path, kind: type[SimulatedFinger], wrong: str
) -> None:
    tile = ASSETS / "meshes" / "tile.ply"
    scene = write_scene(tmp_path, f'mesh = "{tile}"', tile)
    with pytest.raises(UserError, match=wrong):
        run(scene, tmp_path / "out", finger=kind(object=load_mesh(tile, "m"), tip_radius=5e-3))
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_an_object_that_stands_too_far_off_is_not_explored(tmp_path: Path) -> None:
    object, _ = moved_tile(tmp_path)
    model = f'mesh = "{ASSETS}/meshes/tile.ply"\npose = "estimate"\nshift = "1 mm"'
    analysis = run(write_scene(tmp_path, model, object), tmp_path / "out")
    assert "the scene allows 1 mm" in analysis.ended
    assert any(left.stage == "pose" for left in analysis.left_out)


def busy(seconds: float) -> None:
    """Take so much CPU time in this thread."""
    end = thread_time() + seconds
    while thread_time() < end:
        pass


def nothing() -> Trace:
    return Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), 5e-3)


def test_work_beside_a_move_makes_the_finger_wait_only_as_far_as_it_takes_longer():
    def execute(move: Move) -> Trace:
        busy(0.02)
        return nothing()

    move = Move(np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0]]), np.array([0.0, 0.0, -1.0]), speed=0.1)  # 0.1 s
    waits, done = Waits(execute, 0.1), list[float]()

    def piece(seconds: float) -> None:
        busy(seconds)
        done.append(seconds)

    for pieces in ((0.04, 0.04), (0.15, 0.03), ()):
        for seconds in pieces:
            waits.meanwhile.later(partial(piece, seconds))
        waits(move)
    waits.ended()
    # the second move begins 0.01 m from where the first one ended, and takes 0.2 s; the last piece was not begun late
    assert done == [0.04, 0.04, 0.15, 0.03]
    assert waits.each[2] == pytest.approx(0.0, abs=5e-3) and waits.worked == pytest.approx(0.26, rel=0.1)
    assert waits.carrying_out == pytest.approx(0.06, rel=0.4)
    waits = Waits(execute)  # no time is known to pass on the way to a move
    for seconds in (0.15, 0.03):
        waits.meanwhile.later(partial(piece, seconds))
    waits(move)
    assert waits.meanwhile.waiting  # it was too late for the last piece
    waits(move)
    assert waits.each[1] == pytest.approx(0.05, rel=0.2) and not waits.meanwhile.waiting
    assert waits.planning == pytest.approx(0.18 + waits.each[0], rel=0.1)


def test_waits_are_what_the_program_takes_between_moves_and_not_what_the_finger_does():
    def execute(move: Move) -> Trace:
        busy(0.05)
        return nothing()

    waits = Waits(execute)
    for seconds in (0.1, 0.02, 0.04, 0.02):
        busy(seconds)
        waits(Move(np.zeros((2, 3)), np.array([[0.0, 0.0, -1.0]] * 2)))
    busy(0.03)
    waits.ended()
    told = waits.computing(0.5)
    assert told.planning == pytest.approx(0.21, rel=0.1) and waits.carrying_out == pytest.approx(0.2, rel=0.1)
    assert told.median_wait == pytest.approx(0.02, rel=0.2) and told.worst_wait == pytest.approx(0.04, rel=0.2)
    assert "71 % of the finger's time" in told.sentence(1.0)


def test_what_is_loaded_before_the_first_move_is_searched_for_garbage_after_the_last_one_alone():
    frozen = list[int]()
    waits = Waits(lambda move: frozen.append(gc.get_freeze_count()))  # type: ignore[arg-type, return-value]
    waits(Move(np.zeros((2, 3)), np.array([[0.0, 0.0, -1.0]] * 2)))
    waits.ended()
    assert frozen[0] > gc.get_freeze_count() == 0
