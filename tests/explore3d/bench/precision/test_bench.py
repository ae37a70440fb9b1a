"""The bench: its references hold, what fails is said, and its page is whole."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from in_process import explore3d_main

from explore3d.bench.posterior import APPARATUS_NOISE, crossings
from explore3d.bench.precision import bench, summary, write
from explore3d.bench.precision.inference import _default_emcee
from explore3d.bench.precision.surfaces import BUMP_PLACES, dilated, paralleled
from explore3d.bench.precision.work_precision import LeftOutMethod, Point, Stage, timed
from mapping.inference import sample_posterior

PICTURES = {"a_stage.png", "a_stage.svg"}


def _falls(quick: bool, peers: bool) -> list[Point | LeftOutMethod]:
    points = [Point("a stage", "halving <&>", f"step {k}", 10.0**-k, 2.0 ** (k - 9), 3) for k in range(4)]
    return [*points, LeftOutMethod("a stage", "another", "not installed")]


def _fails(quick: bool, peers: bool) -> list[Point | LeftOutMethod]:
    raise ValueError("no such thing")


def test_the_references_of_the_traced_surface_agree():
    assert np.abs(dilated(BUMP_PLACES[::20]) - paralleled(BUMP_PLACES[::20])).max() < 1e-12


def test_timing_takes_the_median_of_calls_after_the_first():
    calls: list[int] = []
    seconds, repeats, value = timed(lambda: calls.append(1) or len(calls))
    assert (repeats, value, len(calls)) == (3, 4, 4)
    assert seconds < 0.1


def test_page_tables_and_pictures_are_written_and_a_failing_stage_is_said(tmp_path: Path, monkeypatch):
    stages = (Stage("a stage", "error (m)", "truth", "look", _falls), Stage("broken", "error", "truth", "look", _fails))
    monkeypatch.setattr(sys.modules[bench.__module__], "stages", lambda: stages)
    measured = bench(quick=True, peers=False)
    page = write(measured, tmp_path, quick=True).read_text()
    assert "halving &lt;&amp;&gt;" in page
    assert "failed: ValueError: no such thing" in page
    assert 'src="http' not in page
    assert {p.name for p in tmp_path.iterdir()} == {
        "bench.html",
        "bench.csv",
        "bench.json",
        "a_stage.png",
        "a_stage.svg",
    }
    record = json.loads((tmp_path / "bench.json").read_text())
    assert record["stages"][0]["points"][1]["seconds"] == 0.1
    assert summary(measured).startswith("bench: 2 stages, 4 points, 2 omissions listed")
    assert "nothing measured for broken" in summary(measured)


@pytest.mark.slow
def test_every_stage_measures_something_quickly():
    measured = bench(quick=True, peers=False)
    assert all(each.points for each in measured), summary(measured)


def test_a_bench_of_which_a_stage_fails_ends_with_1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    good, bad = Stage("good", "error (m)", "", "", _falls), Stage("broken", "error", "", "", _fails)
    for stages, status in (((good,), 0), ((good, bad), 1)):
        monkeypatch.setattr(sys.modules[bench.__module__], "stages", lambda stages=stages: stages)
        assert explore3d_main(monkeypatch, "bench", "--out", tmp_path / "bench") == status


@pytest.mark.slow
def test_default_moves_sample_what_ours_settled_on():
    """The likeliest section may be another than the one that is posed first, and has other parameters."""
    trace, base, feature = crossings(2)
    posterior = sample_posterior(
        feature, trace, np.random.default_rng(1), base=base, noise=APPARATUS_NOISE, confirm=False
    )
    seen = []
    _default_emcee(trace, base, feature, (20,), lambda draws: seen.append(draws.shape[1]) or 0.0)
    assert seen == [len(posterior.names)]


@pytest.mark.parametrize("command", ["bench", "stability"])
def test_a_folder_that_cannot_be_made_is_said_before_anything_is_measured(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "file").write_text("no folder")
    stages = (Stage("never", "error", "", "", lambda quick, peers: pytest.fail("it was measured")),)
    monkeypatch.setattr(sys.modules[bench.__module__], "stages", lambda: stages)
    monkeypatch.setattr("explore3d.stability.stability", lambda names: pytest.fail("it was asked"))
    assert explore3d_main(monkeypatch, command, "--out", tmp_path / "file" / "out") == 2
    assert capsys.readouterr().err.endswith("file/out: Not a directory\n")
