"""Scenes: what is read, what is refused, and in which words."""

from __future__ import annotations

import tomllib
from math import inf
from pathlib import Path

import pytest

from explore3d.errors import SceneError
from explore3d.scene.scene import load_scene, parse_scene
from explore3d.scene.to_toml import scene_text
from mapping.model.conformity import Tolerance

SCENES = Path(__file__).parents[3] / "assets" / "scenes"
TEXT = (SCENES / "wire_on_plate.toml").read_text()


def refusal(text: str, path: str = "here/wire.toml") -> str:
    with pytest.raises(SceneError) as caught:
        parse_scene(text, path)
    return str(caught.value)


def test_lengths_are_metres_and_paths_absolute() -> None:
    scene = load_scene(SCENES / "wire_on_plate.toml")
    assert scene.tip.radius == pytest.approx(0.01)
    assert scene.finger.rate == 5000.0
    assert scene.finger.noise.white == pytest.approx(0.2e-3)
    assert scene.finger.noise.angle == pytest.approx(0.017453, rel=1e-4)
    assert scene.finger.object == SCENES.parent.resolve() / "meshes" / "wire_on_plate.ply"
    assert scene.truth[0].kind == "ridge"
    assert scene.explore.time_budget == 600.0


def test_a_byte_order_mark_is_no_part_of_a_scene(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbf" + TEXT.encode())
    assert load_scene(path).title == load_scene(SCENES / "wire_on_plate.toml").title


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_resolved_scene_reads_back_the_same(path: Path) -> None:
    scene = load_scene(path)
    again = parse_scene(scene.resolved, "/elsewhere/copy.toml", files_from=[SCENES.parent])
    assert again.model_dump() == scene.model_dump()
    assert "region" in scene.resolved or scene.model.region is None


def test_what_is_left_out_has_the_documented_default() -> None:
    text = 'schema = "explore3d/scene/1"\ntip.radius = 1\nmodel.region = {low = [0, 0, 0], high = [1, 1, "1 cm"]}\n'
    scene = parse_scene(text + 'finger.object = "a.ply"\nsurvey.smallest_feature = "1 mm"', "s.toml")
    assert scene.seed == 1
    assert scene.sweep_speed == 0.03  # nothing is said of the noise
    assert scene.detection.algorithm == 3
    assert scene.model.region is not None
    assert scene.model.region.high == (1.0, 1.0, 0.01)
    assert scene.base_surface() is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("radius =", "raduis =", "tip.raduis: unknown key; did you mean 'radius'? possible: radius"),
        ("[survey]", "[servey]", "servey: unknown key; did you mean 'survey'?"),
        ("white =", "wihte =", "finger.noise.wihte: unknown key; did you mean 'white'?"),
        ('kind = "ridge"', 'sort = "ridge"', "truth[0].sort: unknown key; did you mean"),
        ('radius = "10 mm"', 'radius = "-10 mm"', "tip.radius: should be greater than 0; found '-10 mm'"),
        ('radius = "10 mm"', "radius = 0", "tip.radius: should be greater than 0; found 0"),
        ('radius = "10 mm"', 'radius = "10"', "tip.radius: unit missing in '10'; write for example \"10 mm\""),
        ('radius = "10 mm"', 'radius = "10 N"', "tip.radius: 'N' is a unit of force, not of length"),
        ('radius = "10 mm"', "radius = nan", "tip.radius: expected a finite length; found nan"),
        ('radius = "10 mm"', "radius = true", "tip.radius: expected a length"),
        ('radius = "10 mm"', "", "tip.radius: missing; it must be given"),
        ('white = "0.2 mm"', 'white = "-1 um"', "finger.noise.white: should be greater than or equal to 0"),
        ('rate = "5 kHz"', 'rate = "5 mm"', "finger.rate: 'mm' is a unit of length, not of rate"),
        ('kind = "simulated"', 'kind = "robot"', "finger.kind: unknown kind 'robot'; possible: given, grbl, simulated"),
        ("algorithm = 3", "algorithm = 5", "detection.algorithm: should be less than or equal to 4; found 5"),
        ("seed = 1", "seed = -1", "seed: should be greater than or equal to 0; found -1"),
        ('units = "m"', 'units = "mmm"', "model.units: unknown unit of length 'mmm'; did you mean 'mm'?"),
        ("scene/1", "scene/2", "schema: should be 'explore3d/scene/1'; found 'explore3d/scene/2'"),
        ('kind = "ridge"', 'kind = "rigde"', "truth[0].kind: should be 'ridge', 'bump'"),
        ("[tip]", "[tip", "not valid TOML: "),
    ],
)
def test_a_mistake_is_named_in_one_line_with_its_place(old: str, new: str, message: str) -> None:
    assert old in TEXT
    text = refusal(TEXT.replace(old, new, 1))
    assert text.startswith(f"here/wire.toml: {message}")
    assert "\n" not in text


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('kind = "ridge"\nsize = "height"', "tolerance[0]: give limit (at most), least (at least), or both"),
        ('kind = "ridge"\nsize = "depth"\nlimit = 1', "tolerance[0].size: should be 'height', 'width' or 'length'"),
        ('kind = "wire"\nsize = "height"\nlimit = 1', "tolerance[0].kind: should be 'any', 'ridge'"),
        ('kind = "any"\nsize = "height"\nlimit = "-1 mm"', "tolerance[0].limit: should be greater than 0"),
        (
            'kind = "any"\nsize = "height"\nlimit = 1\nleast = 2',
            "tolerance[0]: least must lie below limit; found least",
        ),
        (
            'kind = "bump"\nsize = "length"\nlimit = 1',
            "tolerance[0]: a bump has no length; possible with length: any, ",
        ),
    ],
)
def test_a_tolerance_that_says_nothing_is_refused(keys: str, message: str) -> None:
    assert refusal(f"{TEXT}\n[[tolerance]]\n{keys}\n").startswith(f"here/wire.toml: {message}")


def test_a_tolerance_has_a_limit_on_either_side_or_on_both() -> None:
    scene = parse_scene(f'{TEXT}\n[[tolerance]]\nkind = "any"\nsize = "width"\nleast = "2 mm"\n', "s.toml")
    assert scene.tolerances == (Tolerance("any", "width", inf, 0.002),)


def test_further_mistakes_are_counted_and_unknown_keys_come_first() -> None:
    text = refusal(TEXT.replace("radius =", "raduis ="))
    assert text.startswith("here/wire.toml: tip.raduis: unknown key")
    assert text.endswith("(and 1 more)")


def test_a_box_must_have_a_volume() -> None:
    text = refusal(TEXT.replace('mesh = "../meshes/plate.ply"', "region = {low = [0, 0, 1], high = [1, 1, 1]}"))
    assert "model.region: low must lie below high in x, y and z" in text


def test_neither_mesh_nor_region_is_refused() -> None:
    assert "model: give mesh, region, or both" in refusal(TEXT.replace('mesh = "../meshes/plate.ply"', ""))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such scene file"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe", "not a readable scene file"),
        (b"", "schema: missing; it must be given"),
    ],
)
def test_a_file_that_is_no_scene_is_named(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "scene.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    with pytest.raises(SceneError, match="a folder, not a scene file"):
        load_scene(tmp_path)


def test_a_bad_mesh_is_named_with_scene_and_field(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(TEXT.replace("../meshes/plate.ply", "absent.ply").replace("../meshes/wire_on_plate.ply", "e.off"))
    (tmp_path / "e.off").write_text("OFF\n0 0 0\n")
    scene = load_scene(path)
    with pytest.raises(SceneError) as caught:
        scene.base_surface()
    assert str(caught.value) == f"{path}: model.mesh: {tmp_path / 'absent.ply'}: no such mesh file"
    with pytest.raises(SceneError, match=r"finger\.object: .*e\.off: the mesh is empty"):
        scene.object_surface()


def test_a_scene_cannot_be_changed() -> None:
    scene = load_scene(SCENES / "wire_on_plate.toml")
    with pytest.raises(ValueError, match="frozen"):
        scene.tip.radius = 1.0  # type: ignore[misc]


def test_written_toml_reads_back_whatever_stands_in_it() -> None:
    tables = {
        "text": 'quotes " and \\ and \n newline, ü, \u0001, \x7f',
        "number": 1e-300,
        "whole": 3,
        "flag": False,
        "points": [[1.0, 2.0], [3.0, 4.0]],
        "none": [],
        "table": {"a": 1, "inner": {"b": [True]}, "list": [{"c": 1}, {"c": 2, "deep": {"d": "x"}}]},
        "after": {"e": "f"},
    }
    assert tomllib.loads(scene_text(tables)) == tables
