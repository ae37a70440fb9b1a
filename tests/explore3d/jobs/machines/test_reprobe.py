"""Touching one place of an earlier session again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scene_files import write_scene_file

from explore3d.errors import UserError
from explore3d.jobs.machines.reprobe import reprobe
from explore3d.jobs.run import scene_finger
from explore3d.log.own.reader import read_log
from explore3d.log.own.writer import LogWriter
from explore3d.scene.scene import load_scene
from hw.move import Move
from mapping import ObjectModel
from mapping.base import Base

MESHES = Path(__file__).parents[4] / "assets" / "meshes"
R = 0.01
SCENE = f"""
schema = "explore3d/scene/1"
seed = 1
[tip]
radius = {R}
[model]
mesh = "{MESHES}/tile.ply"
units = "m"
[finger]
kind = "simulated"
object = "{MESHES}/tile.ply"
units = "m"
rate = 1000.0
[survey]
smallest_feature = 3e-4
speed = 0.03
force = 1.0
"""


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """One sweep along x, felt where sample 200 is 0.1 mm too high."""
    write_scene_file(tmp_path / "scene.toml", SCENE)
    scene = load_scene(tmp_path / "scene.toml")
    move = Move([[-0.01, 0.002, R], [0.01, 0.002, R]], [0.0, 0.0, -1.0], speed=0.03)
    with scene_finger(scene) as finger, LogWriter(tmp_path / "log.mcap", tip_radius=R) as log:
        trace = finger.execute(move)
        centers = trace.centers.copy()
        centers[200, 2] += 1e-4
        object.__setattr__(trace, "centers", centers)
        log.write(move, trace)
    return tmp_path


def test_a_mishap_is_told_from_what_is_there(session: Path) -> None:
    x = -0.01 + 200 * 3e-5
    found = reprobe(session, (x, 0.002, 0.0))
    assert found.sample == 200
    assert found.offsets == pytest.approx(-1e-4 / found.neighbours, abs=1e-12)
    assert np.array_equal(found.approach, [0.0, 0.0, -1.0])
    untouched = reprobe(session, (x + 1e-3, 0.002, 0.0), touches=2)
    assert untouched.offsets == pytest.approx([0.0, 0.0], abs=1e-12)


def test_whether_it_moved_is_said_by_the_sessions_own_noise(session: Path) -> None:
    place = (-0.01 + 200 * 3e-5, 0.002, 0.0)
    assert reprobe(session, place).offset_sd is None  # nothing says how much noise there was
    for white, correlated, said in (
        (2e-4, 0.0, "no sign that it moved: "),
        (1e-6, 1e-6, "it differs by more than noise: "),
    ):
        base = Base(load_scene(session / "scene.toml").base_surface())
        noise = {"white": white, "correlated": correlated, "length": 1e-3}
        ObjectModel.attach(base, [], provenance={"noise": noise}).save(session)
        found = reprobe(session, place)
        n = found.neighbours
        assert found.offset_sd == pytest.approx(np.sqrt(white**2 * (1 / n + 1 / 3) + 2 * correlated**2))
        assert found.record()["offset_sd"] == found.offset_sd
        assert any(line.startswith(said) for line in found.lines())


def test_the_touches_are_a_log_of_their_own(session: Path) -> None:
    one, two = reprobe(session, (0.0, 0.002, 0.0)), reprobe(session, (0.0, 0.002, 0.0))
    assert [one.log.name, two.log.name] == ["reprobe-1.mcap", "reprobe-2.mcap"]
    assert np.allclose(read_log(one.log).trace.centers, one.felt)
    assert len(read_log(session / "log.mcap").trace) == 667


def test_a_place_that_was_never_touched_is_refused(session: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"nothing was recorded near \[0.0, 0.0, 90.0\] mm.* mm away"):
        reprobe(session, (0.0, 0.0, 0.09))
    with pytest.raises(UserError, match="give the folder of a session"):
        reprobe(tmp_path / "nowhere", (0.0, 0.0, 0.0))
    assert not list(session.glob("reprobe-*"))
