"""Beginning in an empty folder: examples, and a scene for somebody's own mesh."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import trimesh
from in_process import explore3d_main

from explore3d import MeshFileError, UserError
from explore3d.jobs import plan_scene
from explore3d.scene import begin_scene, copy_example, examples, load_scene

MESHES = Path(__file__).parents[3] / "assets" / "meshes"


def test_the_examples_are_listed_with_their_titles(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert explore3d_main(monkeypatch, "examples") == 0
    lines = capsys.readouterr().out.splitlines()
    folder = Path(lines[-1].partition(": ")[2])
    assert (folder / "robot_fingertip.py").is_file()
    assert "wire_on_plate       A 0.65 mm wire on a tilted plate" in lines
    assert explore3d_main(monkeypatch, "examples", "--json") == 0
    assert [each["name"] for each in json.loads(capsys.readouterr().out)] == [line.split()[0] for line in lines[:-2]]
    assert explore3d_main(monkeypatch, "examples", "nonsense") == 2
    assert "example 'nonsense': there is none of that name; possible: " in capsys.readouterr().err


@pytest.mark.parametrize("name", examples())
def test_a_copied_example_says_what_the_original_says(name: str, tmp_path: Path) -> None:
    written = copy_example(name, tmp_path / "mine")
    copy, original = load_scene(written[0]), load_scene(examples()[name].scene)
    assert copy.title == original.title and copy.truth == original.truth
    mine, theirs = copy.object_surface(), original.object_surface()
    assert (mine.vertices == theirs.vertices).all() and (mine.faces == theirs.faces).all()
    assert {path.parent for path in written} == {tmp_path / "mine"}


def test_nothing_is_written_over(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "wire_on_plate.ply").write_text("mine")
    assert explore3d_main(monkeypatch, "init", tmp_path, "--example", "wire_on_plate") == 2
    assert "wire_on_plate.ply: is there already" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["wire_on_plate.ply"]


@pytest.mark.parametrize(
    ("tip", "units", "said"),
    [
        ("-5 mm", "mm", "tip_radius: should be greater than 0; found '-5 mm'"),
        ("0 mm", "mm", "tip_radius: should be greater than 0; found '0 mm'"),
        ("5 mm", "MM", "unknown unit of length 'MM'; did you mean 'mm'?"),
    ],
)
def test_what_is_wrong_with_an_option_is_said_of_that_option(tip: str, units: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=re.escape(said)):
        begin_scene(tmp_path / "mine", MESHES / "tile.ply", units, tip)
    assert not (tmp_path / "mine").exists()


def test_a_unit_a_thousand_times_too_large_is_noticed_before_anything_is_planned(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    mesh = tmp_path / "plate.off"
    trimesh.creation.box((100.0, 60.0, 5.0)).export(mesh)  # in mm, by its numbers
    told = ["init", tmp_path / "mine", "--mesh", mesh, "--tip-radius", "5 mm", "--units"]
    assert explore3d_main(monkeypatch, *told, "m") == 0
    assert "the sweeps over 100 m x 60 m x 5 m take about 10 years" in capsys.readouterr().out
    scene = tmp_path / "mine" / "scene.toml"
    for command in (["plan", scene], ["run", scene, "--out", tmp_path / "out"]):
        assert explore3d_main(monkeypatch, *command) == 2
        said = capsys.readouterr().err
        assert "scene.toml: model.units: the sweeps over 100 m x 60 m x 5 m" in said and "found 'm'" in said
    assert not (tmp_path / "out").exists()
    assert explore3d_main(monkeypatch, *told[:1], tmp_path / "right", *told[2:], "mm") == 0
    assert "take about" not in capsys.readouterr().out


@pytest.mark.parametrize("finger", ["simulated", "grbl"])
def test_a_scene_for_an_own_mesh_can_be_planned(finger: str, tmp_path: Path) -> None:
    path = begin_scene(tmp_path / "mine", MESHES / "tile.ply", "m", "5 mm", finger)
    scene = load_scene(path)
    assert scene.finger.kind == finger and scene.tip.radius == 5e-3
    assert (tmp_path / "mine" / "tile.ply").read_bytes() == (MESHES / "tile.ply").read_bytes()
    assert plan_scene(path).moves


def test_a_machine_is_given_what_it_touches_from_above(tmp_path: Path) -> None:
    box = trimesh.creation.box((60.0, 40.0, 8.0))
    box.export(tmp_path / "part.stl")
    path = begin_scene(tmp_path / "mine", tmp_path / "part.stl", "mm", "3 mm", "grbl")
    model = load_scene(path).base_surface()
    assert model is not None
    assert model.bounds[0, 2] == pytest.approx(-0.004)  # ways lead round the whole of it
    plan = plan_scene(path)
    assert {tuple(each.approach[0]) for each in plan.moves if each.purpose == "sweep"} == {(0.0, 0.0, -1.0)}
    assert plan.account is not None
    assert plan.account.area == pytest.approx(0.06 * 0.04)


@pytest.mark.parametrize("radius", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_a_peck_s_way_leads_over_an_inner_corner(radius: int, tmp_path: Path) -> None:
    outline = [(0, 0), (60, 0), (60, 6), (6, 6), (6, 50), (0, 50)]
    corners = [(x, y, z) for y in (0, 40) for x, z in outline]
    ends = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [*ends, *((c + 6, b + 6, a + 6) for a, b, c in ends)]
    faces += [each for i in range(6) for j in [(i + 1) % 6] for each in ((j, i, i + 6), (j, i + 6, j + 6))]
    trimesh.Trimesh(corners, faces, process=False).export(tmp_path / "bracket.stl")
    path = begin_scene(tmp_path / "mine", tmp_path / "bracket.stl", "mm", f"{radius} mm", "grbl")
    plan = plan_scene(path)
    assert not plan.violations
    assert plan.account is not None
    # pecks half a millimetre apart leave 1.7 % between them with the tip of 1 mm, which is told; 5 % would end the plan
    assert not plan.account.refused and not plan.account.short


def test_a_body_that_no_machine_can_touch_from_above_is_refused(tmp_path: Path) -> None:
    trimesh.Trimesh([[0, 0, 0], [9, 0, 0], [0, 9, 0]], [[0, 2, 1]], process=False).export(tmp_path / "under.stl")
    with pytest.raises(MeshFileError, match="no face of it can be touched from above"):
        begin_scene(tmp_path / "mine", tmp_path / "under.stl", "mm", "3 mm", "grbl")
    assert not (tmp_path / "mine").exists()


def test_a_port_of_ones_own_has_no_simulated_object(tmp_path: Path) -> None:
    scene = load_scene(begin_scene(tmp_path, MESHES / "tile.ply", "m", "5 mm", "grbl", "/dev/ttyUSB7"))
    assert scene.finger.object is None and scene.finger.machine is not None
    assert scene.finger.machine.port == "/dev/ttyUSB7"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--mesh", "absent.ply", "--units", "mm", "--tip-radius", "5 mm"], "absent.ply: no such mesh file"),
        (["--mesh", MESHES, "--units", "mm", "--tip-radius", "5 mm"], "a folder, not a mesh file"),
        (["--mesh", MESHES / "tile.ply", "--units", "furlong", "--tip-radius", "5 mm"], "unknown unit of length"),
        (["--mesh", MESHES / "tile.ply", "--units", "m", "--tip-radius", "5"], "unit missing"),
        (["--mesh", MESHES / "tile.ply", "--units", "m", "--tip-radius", "5 mm", "--finger", "toe"], "no such finger"),
        (["--mesh", MESHES / "tile.ply", "--example", "mug"], "one of them"),
        (["--example", "nonsense"], "there is none of that name"),
        ([], "--mesh FILE or --example NAME is missing"),
    ],
)
def test_what_a_scene_cannot_begin_from_is_said_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    options: list[object],
    message: str,
) -> None:
    assert explore3d_main(monkeypatch, "init", tmp_path / "mine", *options) == 2
    error = capsys.readouterr().err
    assert message in error and len(error.splitlines()) == 1
    assert not (tmp_path / "mine").exists()
