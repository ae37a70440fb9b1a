"""--json: every command says its result as JSON on stdout, and nothing else."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from in_process import explore3d_main
from two_features import two_features

from explore3d.bench.precision import bench
from explore3d.bench.precision.work_precision import LeftOutMethod, Point, Stage
from explore3d.cli.main import command_line

MESHES = Path(__file__).parents[3] / "assets" / "meshes"


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """What a command prints, as the values that it stands for."""

    def call(*words: object) -> Any:
        assert explore3d_main(monkeypatch, *words, "--json") == 0
        return json.loads(capsys.readouterr().out)

    return call


def test_every_command_has_it() -> None:
    for command in command_line().registered_commands:
        assert command.callback is not None
        assert "json" in command.callback.__annotations__, command.callback.__name__


def test_init_says_what_it_wrote_and_the_commands_that_follow(told: Any, tmp_path: Path) -> None:
    found = told("init", tmp_path / "a b", "--mesh", MESHES / "tile.ply", "--units", "m", "--tip-radius", "5 mm")
    scene = tmp_path / "a b" / "scene.toml"
    assert found["scene"] == str(scene) and scene.is_file()
    assert found["plan"] == f"explore3d plan '{scene}'"
    assert found["run"] == f"explore3d run '{scene}' --out '{scene.parent / 'out'}'"


def test_export_lists_the_files(told: Any, tmp_path: Path) -> None:
    two_features().save(tmp_path / "model")
    targets = [tmp_path / "lines.csv", tmp_path / "results.qif"]
    found = told("export", tmp_path / "model", "--to", targets[0], "--to", targets[1])
    assert found == {"written": [str(each) for each in targets]} and all(each.is_file() for each in targets)


def test_emulate_names_its_ports(told: Any, tmp_path: Path) -> None:
    words = ("emulate", "grbl", "--mesh", MESHES / "tile.ply", "--tip-radius", "5 mm", "--sensor", "optoforce")
    found = told(*words, "--folder", tmp_path / "ports", "--seconds", "0.2")
    assert set(found) == {"stage", "sensor"} and all(each.startswith(str(tmp_path)) for each in found.values())


def test_stability_has_a_record_of_each_case(told: Any) -> None:
    found = told("stability", "--only", "kink beside")
    (case,) = found["cases"]
    assert case["passed"] and 0.0 <= case["error"] <= case["allowed"] and "kink beside" in case["name"]
    assert found["summary"].startswith("stability: 1 case, 0 failed")


@pytest.mark.slow
def test_figures_list_their_files_and_what_the_algorithms_found(told: Any, tmp_path: Path) -> None:
    found = told("figures", "--out", tmp_path / "figures", "--seeds", "1")
    assert len(found["written"]) > 5 and all(Path(each).is_file() for each in found["written"])
    assert {each["motion"] for each in found["findings"]} == {"rolling", "sliding"}
    assert all(0.0 <= each["convex"] <= 1.0 for each in found["findings"])


def test_bench_says_all_that_it_measured(told: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def measure(quick: bool, peers: bool) -> list[Point | LeftOutMethod]:
        return [Point("contact", "ours", "1", 2.0, 3e-6), LeftOutMethod("contact", "theirs", "not installed")]

    stages = (Stage("contact", "m", "none", "", measure),)
    monkeypatch.setattr(sys.modules[bench.__module__], "stages", lambda: stages)
    found = told("bench", "--quick", "--out", tmp_path)
    (stage,) = found["stages"]
    assert stage["points"][0]["error"] == 3e-6 and stage["omissions"][0]["method"] == "theirs"
    assert Path(found["page"]).is_file() and found["summary"].startswith("bench: 1 stages, 1 points")
    assert explore3d_main(monkeypatch, "bench", "--json", "dynamics") == 2
