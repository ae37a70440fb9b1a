"""run and analyze, whole: a scene becomes an annotated model, and its log becomes the same one."""

from __future__ import annotations

import importlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NoReturn

import pytest
from scene_files import write_scene_file

from explore3d.analysis.result import Analysis
from explore3d.jobs.analyze import analyze
from explore3d.jobs.run import run
from explore3d.log import Recorder, read_log, read_noise
from explore3d.log.own import MAGIC
from explore3d.scene import AnalysisSettings

ASSETS = Path(__file__).resolve().parents[3] / "assets"

SCENE = """
schema = "explore3d/scene/1"
title = "A wire on a tile"
seed = 4

[tip]
radius = "5 mm"

[model]
mesh = "{assets}/meshes/tile.ply"

[finger]
object = "{assets}/meshes/{object}.ply"
rate = "1 kHz"

[finger.noise]
white = "0.05 mm"
correlated = "0.005 mm"

[survey]
smallest_feature = "0.4 mm"

{truth}
"""
WIRE = """
[[truth]]
kind = "ridge"
axis = [[-0.007468129, -0.01003007, 0.0], [0.015468129, 0.00603007, 0.0]]
height = 0.00065
width = 0.00065
length = 0.028
"""


def write_scene(folder: Path, name: str = "wire_on_tile", truth: str = WIRE) -> Path:
    return write_scene_file(folder / f"{name}.toml", SCENE.format(assets=ASSETS, object=name, truth=truth))


@pytest.fixture(scope="module")
def wire(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Analysis]:
    """One run on the wire, shared by the tests that only look at it."""
    folder = tmp_path_factory.mktemp("wire")
    return folder / "out", run(write_scene(folder), folder / "out")


def record(folder: Path) -> dict[str, Any]:
    """model.json without the timings, and without what a run's finger left out, which no log knows."""
    document: dict[str, Any] = json.loads((folder / "model.json").read_text())
    del document["timings"]
    document["left_out"] = [stage for stage in document["left_out"] if stage["stage"] != "dynamics"]
    return document


def test_the_wire_is_found_once_and_where_it_is(wire: tuple[Path, Analysis]) -> None:
    _, analysis = wire
    (row,) = analysis.errors
    assert row.status == "found"
    assert row.found is not None
    assert row.found.kind == "ridge"
    assert row.found.curvature_feature
    assert row.axis_max < 0.1e-3
    assert row.end_error < 0.3e-3
    assert abs(row.length_error) < 0.3e-3
    assert abs(row.height_error) < 0.05e-3


def test_the_analysis_begins_with_the_noise_that_was_measured_while_exploring(wire: tuple[Path, Analysis]) -> None:
    out, _ = wire
    noise = read_noise(read_log(out / "log.mcap").events)
    assert noise is not None
    assert noise.white == pytest.approx(0.05e-3, rel=0.1)
    assert AnalysisSettings.of(None, noise).detection["begin"] == noise
    of_means = AnalysisSettings.of(None, noise).of_means({"white_noise": 0.5})
    assert of_means.detection["begin"].white == 0.5 * noise.white


def test_the_output_folder_holds_scene_log_model_report_and_pictures(wire: tuple[Path, Analysis]) -> None:
    out, _ = wire
    files = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert {"scene.toml", "log.mcap", "model.json", "model.glb", "report.html", "session.json"} <= files
    assert any(name.startswith("pictures/") and name.endswith(".svg") for name in files)
    assert "ridge-1" in (out / "report.html").read_text()


def test_the_error_falls_with_finger_time_down_to_the_finished_model(wire: tuple[Path, Analysis]) -> None:
    _, analysis = wire
    times, errors = zip(*analysis.time_curve, strict=True)
    assert list(times) == sorted(times)
    assert errors[-1] < 0.3e-3
    assert errors[-1] < 0.2 * max(errors)


@pytest.mark.slow
def test_analysing_the_log_of_a_run_gives_the_model_of_the_run(wire: tuple[Path, Analysis], tmp_path: Path) -> None:
    out, _ = wire
    analyze(out / "log.mcap", tmp_path / "again")
    assert record(tmp_path / "again") == record(out)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_model_and_another_seed_another(
    wire: tuple[Path, Analysis], tmp_path: Path
) -> None:
    out, _ = wire
    # the log names the scene and its folder: the very same file is run again
    run(out.parent / "wire_on_tile.toml", tmp_path / "same")
    assert record(tmp_path / "same") == record(out)
    scene = write_scene(tmp_path)
    scene.write_text(scene.read_text().replace("seed = 4", "seed = 5"))
    run(scene, tmp_path / "other")
    assert record(tmp_path / "other")["features"] != record(out)["features"]


def test_a_bare_tile_has_no_feature_and_costs_no_chain(tmp_path: Path) -> None:
    analysis = run(write_scene(tmp_path, "tile", truth=""), tmp_path / "out")
    assert analysis.model.features == ()
    stages = {left.stage for left in analysis.left_out}
    assert {"grammar", "posterior", "estimated surface", "curvature", "error against time"} <= stages
    assert "posterior" not in analysis.timings


@pytest.mark.parametrize("at", ["recorded", "stop_of", "conclude"])
def test_whatever_ends_a_run_after_its_sweeps_it_says_so(
    at: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While the log is closed, between exploration and analysis, and in the analysis."""

    def interrupted(*given: object, **options: object) -> NoReturn:
        raise KeyboardInterrupt

    monkeypatch.setattr(
        Recorder if at == "recorded" else importlib.import_module("explore3d.jobs.run"), at, interrupted
    )
    with pytest.raises(KeyboardInterrupt) as ended:
        run(write_scene(tmp_path, "tile", truth=""), tmp_path / "out")
    said, kept = ended.value.__notes__
    assert said == "stopped after all sweeps, before the report: interrupted (Ctrl-C)"
    assert kept.startswith(f"kept: {tmp_path / 'out' / 'log.mcap'}; go on with: ")


@pytest.mark.slow
def test_runs_killed_at_random_moments_leave_logs_that_are_analysed(tmp_path: Path) -> None:
    scene = write_scene(tmp_path)
    command = [sys.executable, "-m", "explore3d.cli.main", "run", str(scene), "--out"]
    chance = random.Random(7)
    for attempt in range(10):
        out = tmp_path / f"killed-{attempt}"
        process = subprocess.Popen([*command, str(out)], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        log = out / "log.mcap"
        patience = time.monotonic() + 120
        while not (log.exists() and log.stat().st_size > 20_000) and time.monotonic() < patience:
            time.sleep(0.005)
        time.sleep(chance.uniform(0.0, 1.0))
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        # one that is killed while it makes its report has closed its log: nothing was lost
        closed = log.read_bytes().endswith(MAGIC)
        analysis = analyze(log, tmp_path / f"analysed-{attempt}")
        assert len(analysis.trace) > 100
        assert ("recovered" in analysis.recovered) is not closed
