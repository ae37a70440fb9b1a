"""Long recordings as means: of tables in pieces, of logs, and what is said of them."""

from __future__ import annotations

import gzip
import importlib
import json
from pathlib import Path

import numpy as np
import pytest
from in_process import explore3d_main

from explore3d.errors import UserError
from explore3d.log import inspect
from explore3d.log.load import load_logs
from explore3d.log.own.writer import LogWriter
from explore3d.log.text import read_pieces
from hw.move import Move
from mapping.trace import Trace

TIP = 5e-3
ROWS, SAMPLES = 12, 1030


def raster(seed: int = 0) -> np.ndarray:
    """(N, 3) m: rows to and fro over a plate with a wire across it, a sample every 20 um, noise of 1 um."""
    x = 20e-6 * np.arange(SAMPLES)
    radius = 0.2e-3
    wire = np.sqrt(np.maximum((TIP + radius) ** 2 - (x - 10e-3) ** 2, 0.0)) + radius - TIP
    noise = 1e-6 * np.random.default_rng(seed).standard_normal((ROWS, SAMPLES))
    lines = []
    for k in range(ROWS):
        line = np.column_stack([x, np.full(SAMPLES, 1e-3 * k), np.maximum(wire, 0.0) + noise[k] + TIP])
        lines.append(line[:: 1 - 2 * (k % 2)])
    return np.concatenate(lines)


def written(path: Path, points: np.ndarray, head: str = "x [mm],y [mm],z [mm]", more: list[str] | None = None) -> Path:
    more = [""] * len(points) if more is None else more
    rows = [f"{x:.5f},{y:.5f},{z:.6f}{m}" for (x, y, z), m in zip((1e3 * points).tolist(), more, strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


@pytest.mark.parametrize("size", [20_000, 32 * 2**20])
def test_a_table_in_pieces_becomes_the_means_of_its_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    monkeypatch.setattr(read_pieces, "__defaults__", (None, size))
    points = raster()
    log = load_logs([written(tmp_path / "scan.csv", points)], tip_radius=TIP, average=100)
    about = log.metadata["average"]
    assert len(log.trace) == 10 * ROWS == about["samples"] and about["rows"] == len(points)
    assert [int(number) for number in np.unique(log.trace.sweep)] == list(range(ROWS))
    for k, (_, sweep) in enumerate(log.trace.sweeps()):
        assert sweep.centers[:, 1] == pytest.approx(1e-3 * k)  # of one row each
        assert sweep.centers[0] == pytest.approx(points[SAMPLES * k : SAMPLES * k + 100].mean(axis=0), abs=1e-8)
    (line,) = log.metadata["read_as"]
    assert "averaged: 120 samples are the means of 100 each" in line and "white noise falls to 0.1 of it" in line
    assert about["spacing"] == pytest.approx(2e-3, rel=0.01)
    assert about["smallest_crest"] == pytest.approx(about["spacing"] ** 2 / (2 * TIP))
    assert log.complete and not log.recovered


def test_no_mean_goes_over_a_gap_and_short_stretches_are_told(tmp_path: Path) -> None:
    points = raster()[:SAMPLES]
    kept = np.concatenate([points[:315], points[330:345], points[420:]])  # two gaps, fifteen samples between them
    log = load_logs([written(tmp_path / "scan.csv", kept)], tip_radius=TIP, average=100)
    assert log.metadata["average"]["rows_left_out"] == 15
    assert "15 of 940 rows are left out, in stretches of fewer than half of 100" in log.recovered
    x = log.trace.centers[:, 0]
    assert (x[x < points[330, 0]] < points[315, 0]).all() and (x[x > points[330, 0]] > points[420, 0]).all()


def test_a_column_of_sweeps_its_labels_and_marks_are_heeded_over_all_pieces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(read_pieces, "__defaults__", (None, 30_000))
    points = raster()
    points[:, 1] = 0.0  # nothing but the label tells the rows apart
    more = [f",line {k // 500},{int(k % 1000 != 7)}" for k in range(len(points))]
    path = written(tmp_path / "scan.csv", points, "x [mm],y [mm],z [mm],sweep,valid", more)
    log = load_logs([path], tip_radius=TIP, average=50)
    number = len(points) // 500 + 1
    assert [int(each) for each in np.unique(log.trace.sweep)] == list(range(number))
    assert "13 of 12,360 rows are left out: invalid" in log.recovered


def test_rows_in_no_order_are_refused(tmp_path: Path) -> None:
    points = raster()[:SAMPLES]
    order = np.random.default_rng(0).permutation(len(points))
    path = tmp_path / "scan.csv"
    path.write_text("x [mm],z [mm]\n" + "\n".join(f"{1e3 * x:.5f},{1e3 * z:.6f}" for x, _, z in points[order]))
    assert len(load_logs([path], tip_radius=TIP).trace) == len(points)
    with pytest.raises(UserError, match=r"scan\.csv: field average: the rows are in no order .* sort the rows first"):
        load_logs([path], tip_radius=TIP, average=10)


@pytest.mark.parametrize("kind", ["gz", "npy", "map"])
def test_other_files_are_averaged_too(tmp_path: Path, kind: str) -> None:
    points, settings = raster(), {"units": "m"}
    if kind == "gz":
        path = tmp_path / "scan.csv.gz"
        path.write_bytes(gzip.compress(written(tmp_path / "scan.csv", points).read_bytes()))
        settings = {}
    elif kind == "npy":
        path = tmp_path / "scan.npy"
        np.save(path, points)
    else:
        path = tmp_path / "map.npy"
        np.save(path, points[:, 2].reshape(ROWS, SAMPLES))
        settings |= {"pixel": "20 um"}
    log = load_logs([path], tip_radius=TIP, average=100, **settings)
    assert len(log.trace) == 10 * ROWS and len(np.unique(log.trace.sweep)) == ROWS


def test_a_log_is_averaged_with_its_moves_and_forces(tmp_path: Path) -> None:
    points = raster()
    path = tmp_path / "log.mcap"
    with LogWriter(path, tip_radius=TIP) as log:
        for k in range(ROWS):
            line = points[SAMPLES * k : SAMPLES * (k + 1)]
            t = 1e-3 * np.arange(SAMPLES) + 2.0 * k
            normals, force = np.tile([0.0, 0.0, 1.0], (SAMPLES, 1)), np.tile([0.0, 0.0, 2.0], (SAMPLES, 1))
            trace = Trace(t, line, np.full(SAMPLES, k), TIP, normals=normals, contacts=line, force=force)
            log.write(Move(line[[0, -1]], [0.0, 0.0, -1.0], speed=0.02), trace)
    found, whole = load_logs([path], average=100), load_logs([path])
    assert len(found.trace) == 10 * ROWS and found.trace.force is not None and found.trace.normals is not None
    assert found.trace.force[:, 2] == pytest.approx(2.0)
    moves = [event.data for event in found.events if event.kind == "move"]
    assert [(move["first"], move["samples"]) for move in moves] == [(10 * k, 10) for k in range(ROWS)]
    assert found.sha256 == whole.sha256 and found.complete
    assert found.trace.t[0] == pytest.approx(whole.trace.t[:100].mean())


def test_what_does_not_fit_names_the_runs_that_would(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path / "scan.csv", raster())
    memory = importlib.import_module("explore3d.log.own.memory")
    monkeypatch.setattr(memory, "free_memory", lambda: 2e6)  # enough to read 12360 rows, not to make a model of them
    with pytest.raises(
        UserError, match=r"the model of about 6,180 samples takes about .* possible: --average 5, which"
    ):
        load_logs([path], tip_radius=TIP, average=2)
    assert len(load_logs([path], tip_radius=TIP, average=5).trace) == 12 * 206
    monkeypatch.setattr(memory, "free_memory", lambda: 1e6)
    with pytest.raises(UserError, match=r"scan\.csv: to read its .* possible: --average 10, which reads it in pieces"):
        load_logs([path], tip_radius=TIP)


@pytest.mark.slow
def test_the_command_averages_says_so_and_keeps_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = written(tmp_path / "scan.csv", raster()), tmp_path / "out"
    words = ("analyze", path, "--tip-radius", "5 mm", "--out", out, "--average", "10")
    assert explore3d_main(monkeypatch, *words) == 0
    said = capsys.readouterr().out
    assert "averaged: 1,236 samples are the means of 10 each" in said and "ridge-1: " in said
    model = json.loads((out / "model.json").read_text())
    assert model["provenance"]["average"]["length"] == 10 and model["provenance"]["samples"] == 1236
    assert "means of 10 each" in (out / "report.html").read_text()
    found = inspect(path, tip_radius=TIP, average=10)
    assert found.samples == 1236 and "means of 10 each" in found.read_as
    for wrong in ("0", "-3", "many"):
        assert explore3d_main(monkeypatch, *words[:-1], wrong) == 2
        assert "--average" in capsys.readouterr().err
