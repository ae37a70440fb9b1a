"""The command line: versions, examples, and one-line errors with status 2 that leave nothing behind."""

from __future__ import annotations

import itertools
import json
import math
import re
import shlex
from dataclasses import replace
from functools import cache
from inspect import signature
from pathlib import Path

import pytest
from in_process import explore3d_main
from scene_files import write_scene_file
from typer.testing import CliRunner

from explore3d import __version__
from explore3d.cli.bench import bench
from explore3d.cli.main import command_line
from explore3d.scene import copy_example

SCENES = Path(__file__).parents[3] / "assets" / "scenes"
COMMANDS = [command.callback.__name__ for command in command_line().registered_commands if command.callback]
BENCHES = [command.callback.__name__ for command in bench.registered_commands if command.callback]


def test_the_version_is_the_packages(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert explore3d_main(monkeypatch, "--version") == 0
    assert capsys.readouterr().out == f"explore3d {__version__}\n"


@pytest.mark.parametrize("command", [*COMMANDS, *(f"bench {name}" for name in BENCHES)])
def test_every_commands_help_has_an_example(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert explore3d_main(monkeypatch, *command.split(), "--help") == 0
    assert f"Example: explore3d {command}" in " ".join(capsys.readouterr().out.split())


def test_the_help_lists_every_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert explore3d_main(monkeypatch, "--help") == 0
    out = capsys.readouterr().out
    assert all(re.search(rf"^ +{command} ", out, re.M) for command in COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_loaded_alone_is_the_one_among_all(command: str) -> None:
    alone = command_line(command)
    assert [each.callback.__name__ for each in alone.registered_commands if each.callback] == [command]
    assert not alone.registered_groups
    helps = [CliRunner().invoke(line, [command, "--help"], prog_name="explore3d") for line in (alone, command_line())]
    assert helps[0].output == helps[1].output != ""


STORED = [
    command.callback.__name__
    for command in bench.registered_commands
    if "store" in signature(command.callback).parameters
]


@pytest.mark.parametrize("name", STORED)
def test_a_bench_refuses_a_store_that_cannot_be_written_before_it_begins(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, name: str
) -> None:
    for store, found in ((tmp_path / "absent" / "x.jsonl", f"no folder {tmp_path / 'absent'}"), (tmp_path, "a folder")):
        assert explore3d_main(monkeypatch, "bench", name, "--store", str(store)) == 2
        assert capsys.readouterr().err.strip().endswith(f"found {found}")


def test_bodies_whose_meshes_are_not_there_are_named_and_a_bench_of_none_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    asked = ["bench", "bodies", "--store", tmp_path / "bodies.jsonl", "--bodies", "bunny,spot"]
    assert explore3d_main(monkeypatch, *asked, "--meshes", tmp_path / "nowhere") == 2
    told = capsys.readouterr()
    assert "bunny.off is not in" in told.out and "spot.obj is not in" in told.out
    assert "nothing of bunny, spot is left to explore" in told.err


def variant(folder: Path, old: str, new: str) -> Path:
    """The wire scene with one text replaced, its meshes beside it."""
    text = (SCENES / "wire_on_plate.toml").read_text()
    assert old in text
    return write_scene_file(folder / "scene.toml", text.replace(old, new, 1))


NAN = "OFF\n3 1 0\n0 0 0\nnan 0 0\n0 1 0\n3 0 1 2\n"


@pytest.mark.parametrize(
    ("old", "new", "mesh", "message"),
    [
        ("../meshes/plate.ply", "absent.ply", None, "model.mesh: "),
        ("../meshes/plate.ply", "mesh.off", "OFF\n0 0 0\n", "model.mesh: "),
        ("../meshes/wire_on_plate.ply", "mesh.off", NAN, "finger.object: "),
        ("smallest_feature", "smalest_feature", None, "survey.smalest_feature: unknown key; did you mean"),
        ('radius = "10 mm"', 'radius = "-1 mm"', None, "tip.radius: should be greater than 0"),
        ('radius = "10 mm"', 'radius = "10"', None, "tip.radius: unit missing"),
        ('radius = "10 mm"', 'radius = "10 kHz"', None, "tip.radius: 'kHz' is a unit of rate"),
    ],
)
def test_a_bad_scene_ends_in_one_line_and_leaves_no_folder(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    old: str,
    new: str,
    mesh: str | None,
    message: str,
) -> None:
    if mesh is not None:
        (tmp_path / "mesh.off").write_text(mesh)
    scene = variant(tmp_path, old, new)
    for command in ("run", "plan"):
        assert explore3d_main(monkeypatch, command, scene, "--out", tmp_path / "out" / "deep") == 2
        lines = capsys.readouterr().err.splitlines()
        assert lines[-1].startswith(f"explore3d: {scene}: {message}")
        assert not any("Traceback" in line for line in lines)
        assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    for command in (["run", SCENES / "empty_plate.toml"], ["figures"]):
        assert explore3d_main(monkeypatch, *command, "--out", tmp_path / "file") == 2
        error = capsys.readouterr().err.splitlines()[-1]
        assert error.startswith(f"explore3d: {tmp_path / 'file'}: ")
        assert (tmp_path / "file").read_text() == ""


@pytest.mark.parametrize(
    "arguments",
    [
        ["run"],
        ["run", "a.toml"],
        ["nonsense"],
        ["run", "a.toml", "--out", "b", "--nonsense"],
        ["analyze", "--out", "b"],
    ],
)
def test_a_wrong_call_is_refused_with_status_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: list[str]
) -> None:
    assert explore3d_main(monkeypatch, *arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Traceback" not in captured.err


@pytest.mark.slow
def test_a_plan_is_told_in_words_and_as_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    from explore3d import jobs

    plan_into = cache(jobs.plan_into)  # told twice, planned once
    monkeypatch.setattr(jobs, "plan_into", lambda scene, *others: plan_into(scene, tmp_path / "plan"))
    assert explore3d_main(monkeypatch, "plan", SCENES / "step.toml", "--out", tmp_path / "plan") == 0
    words = capsys.readouterr().out
    assert "no move breaks a limit" in words
    assert (tmp_path / "plan" / "plan.png").read_bytes().startswith(b"\x89PNG")
    assert explore3d_main(monkeypatch, "plan", SCENES / "step.toml", "--json") == 0
    record = json.loads(capsys.readouterr().out)
    assert record == json.loads((tmp_path / "plan" / "plan.json").read_text())
    # the plate is 100 x 60 mm: sweeps whose strips are 2 x reach wide must cover it
    swept = sum(2 * record["reach"] * _length(move["path"]) for move in record["moves"])
    assert swept > 0.95 * 0.100 * 0.060
    assert record["covered"] > 0.99
    assert f"{record['sweeps']} sweeps" in words
    # one that would leave a tenth of the surface is incomplete, as its run would be
    plan = jobs.plan_into(SCENES / "step.toml", None)
    assert plan.account is not None
    short = replace(plan, account=replace(plan.account, swept=0.9, not_inspected=0.1))
    monkeypatch.setattr(jobs, "plan_into", lambda *others: short)
    for options in ([], ["--json"]):
        assert explore3d_main(monkeypatch, "plan", SCENES / "step.toml", *options) == 3
    assert capsys.readouterr().out.startswith("NOT INSPECTED: 10 %")


def _length(path: list[list[float]]) -> float:
    return sum(math.dist(start, stop) for start, stop in itertools.pairwise(path))


def test_the_options_of_analyze_reach_the_library(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from explore3d import jobs, report

    calls: list[tuple[tuple[object, ...], dict[str, object]]] = []
    monkeypatch.setattr(jobs, "analyze_each", lambda *given, **options: calls.append((given, options)) or [])
    monkeypatch.setattr(report, "show", lambda *given: None)
    options = ["--tip-radius", "2 um", "--units", "mm", "--columns", "x=1, z=2", "--frame", "0 mm, 1 mm,5 mm"]
    options += ["--pixel", "1 um", "--part", "/tip", "--average", "20", "--same-object"]
    options += ["--tip-sd", "20 nm", "--form", "line", "--mask", "1mm..2mm", "--in-contact"]
    options += ["--model", "body.ply", "--model-units", "mm", "--force", "curvature", "--tolerances", "drawing.toml"]
    assert explore3d_main(monkeypatch, "analyze", "a.csv", "b.mcap", "--out", tmp_path, *options) == 0
    ((given, named),) = calls
    assert given == ([Path("a.csv"), Path("b.mcap")], tmp_path)
    named.pop("progress")
    named.pop("tell")
    assert named == {
        "tip_radius": "2 um",
        "units": "mm",
        "columns": "x=1, z=2",
        "pixel": "1 um",
        "part": "/tip",
        "tolerances": Path("drawing.toml"),
        "average": 20,
        "tip_sd": "20 nm",
        "form": "line",
        "mask": ["1mm..2mm"],
        "in_contact": True,
        "same_object": True,
        "frame": {"origin": ["0 mm", "1 mm", "5 mm"]},
        "model": Path("body.ply"),
        "model_units": "mm",
        "force": ["curvature"],
        "overwrite": False,
        "report": True,
        "quick": False,
    }


def test_a_bad_log_ends_in_one_line_and_leaves_no_folder(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    (tmp_path / "scan.csv").write_text("x,z\n1,2\n2,3\n")
    (tmp_path / "empty.mcap").write_bytes(b"")
    for name, options in (
        ("picture.png", ["--tip-radius", "1 mm"]),
        ("scan.csv", ["--units", "mm"]),
        ("scan.csv", ["--units", "mm", "--tip-radius", "2"]),
        ("scan.csv", ["--units", "mmm", "--tip-radius", "2 um"]),
        ("empty.mcap", []),
        ("absent.csv", ["--tip-radius", "1 mm"]),
    ):
        out = tmp_path / "out"
        assert explore3d_main(monkeypatch, "analyze", tmp_path / name, "--out", out, *options) == 2, name
        error = capsys.readouterr().err.splitlines()[-1]
        assert error.startswith("explore3d: ")
        assert name in error
        assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bench", "trace", "--triangles", "many"], "--triangles: expected whole numbers"),
        (["bench", "curvature", "--building"], "--building: names the seeds of cells; add --cells"),
        (["bench", "explore", "--store", "s.jsonl", "--scenes", "moon"], "--scenes: unknown 'moon'; possible: "),
        (["bench", "calibration", "--store", "s.jsonl", "--method", "luck"], "--method: expected importance or emcee"),
        (["merge", "absent", "log.mcap", "--out", "m"], "absent"),
    ],
)
def test_benches_and_merging_refuse_what_they_do_not_know(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert explore3d_main(monkeypatch, *arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_the_example_of_emulate_serves_the_mesh_that_init_writes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    from explore3d.cli.hardware import emulate

    words = shlex.split((emulate.__doc__ or "").split("Example: explore3d ")[1].splitlines()[0])
    copy_example("grbl_peck", tmp_path / "tile")
    monkeypatch.chdir(tmp_path)
    assert explore3d_main(monkeypatch, *words, "--seconds", "0.1", "--folder", tmp_path / "ports") == 0
    assert "stage: " in capsys.readouterr().out
