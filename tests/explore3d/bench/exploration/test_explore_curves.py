"""Curves of the exploration bench: summaries, times at equal error, files."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from explore3d.bench.exploration.explore_curves import Summary, leads, seconds_at, summaries, write_curves


def run(strategy: str, seconds: float, error: float | None, **more: Any) -> dict[str, Any]:
    record = {"scene": "straight", "strategy": strategy, "noise": "apparatus", "seed": 0, "finger_seconds": seconds}
    record |= {"planning_seconds": 1.0, "modelling_seconds": 2.0, "end_error": error, "axis_rms": 1e-5}
    return record | {"true": 1, "found": 1, "mistyped": 0, "missed": 0, "invented": 0} | more


def row(seconds: float, error: float) -> Summary:
    return Summary("straight", f"raster {seconds}", 1, 1, seconds, 1.0, error, error, 0.0)


def test_times_at_an_error_lie_on_straight_lines_in_the_logarithms() -> None:
    rows = [row(100.0, 1e-4), row(400.0, 0.5e-4)]
    seconds, at_least = seconds_at(1e-4 / np.sqrt(2.0), rows)
    assert seconds == pytest.approx(200.0) and not at_least
    assert seconds_at(1e-3, rows) == (100.0, False)
    assert seconds_at(1e-6, rows) == (400.0, True)


def test_a_strategy_that_missed_the_feature_gives_no_line_to_interpolate_on() -> None:
    assert seconds_at(1e-4, [row(50.0, np.inf), row(100.0, 0.9e-4)]) == (100.0, False)


def test_half_of_the_runs_missing_a_feature_is_no_finite_error() -> None:
    records = [run("explore", 50.0, 1e-5), run("explore", 50.0, None, found=0, missed=1)]
    (summary,) = summaries(records)
    assert summary.right == 1 and np.isinf(summary.error) and np.isinf(summary.worst)


def test_the_lead_is_the_other_family_s_time_over_the_explorer_s() -> None:
    records = [run("explore", 50.0, 0.5e-4), run("raster 4 mm", 250.0, 1e-4), run("raster 1 mm", 1000.0, 0.5e-4)]
    (lead,) = leads(summaries(records))
    assert lead.family == "raster" and lead.ratio == pytest.approx(20.0) and not lead.at_least


def test_the_files_hold_the_table_and_a_picture_of_each_scene(tmp_path: Path) -> None:
    records = [run("explore", 50.0, 0.5e-4), run("raster 4 mm", 250.0, 1e-4), run("random 90 s", 90.0, None, missed=1)]
    files = {path.name: path for path in write_curves(records, tmp_path / "curves")}
    assert set(files) == {"explore.csv", "explore.json", "explore_straight.png"}
    assert next(csv.DictReader(files["explore.csv"].open()))["strategy"] == "explore"
    assert json.loads(files["explore.json"].read_text())["leads"][0]["ratio"] == pytest.approx(5.0)
    assert files["explore_straight.png"].read_bytes().startswith(b"\x89PNG")
