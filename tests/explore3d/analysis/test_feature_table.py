"""The table of features: the same values as the model's, in CSV and in Parquet; and what quick results leave out."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from in_process import explore3d_main
from small_profiles import TIP, write_profile

from explore3d import load
from explore3d.analysis import FEATURE_COLUMNS, feature_rows, parquet_bytes, run_key
from explore3d.jobs.analyze import analyze
from mapping import Dropped, Feature, Interval, Support, Surface
from mapping.base import Base
from mapping.model import ObjectModel


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("table")
    analyze(write_profile(folder / "a.csv"), folder / "quick", tip_radius=TIP, quick=True)
    return folder


def test_csv_and_parquet_hold_what_the_model_holds(out: Path) -> None:
    model = load(out / "quick")
    table = pq.read_table(out / "quick" / "features.parquet").to_pylist()
    with (out / "quick" / "features.csv").open() as file:
        text = list(csv.DictReader(file))
    assert list(table[0]) == list(text[0]) == list(FEATURE_COLUMNS)
    assert [row["id"] for row in table if row["kept"]] == [feature.id for feature in model] == ["bump-1", "bump-2"]
    for feature, row, words in zip(model, table, text, strict=False):
        assert (row["height"], row["height_low"], row["height_high"]) == (
            feature.height.median,
            feature.height.low,
            feature.height.high,
        )
        assert float(words["height"]) == row["height"] and words["kept"] == "True"
        assert row["probability"] == 1.0 and row["why_dropped"] is None and words["why_dropped"] == ""


def test_quick_results_are_those_of_the_long_way_without_surface_report_and_chains(out: Path) -> None:
    analyze(out / "a.csv", out / "long", tip_radius=TIP, report=False)
    assert not (out / "long" / "report.html").exists() and not (out / "quick" / "pictures").exists()
    quick, long = load(out / "quick"), load(out / "long")
    assert [each.height for each in quick] == [each.height for each in long]
    left = {each.stage: each.reason for each in quick.left_out}
    assert "quick results" in left["estimated surface"]
    assert "estimated surface" not in {each.stage for each in long.left_out}


def test_what_was_dropped_has_a_row_with_its_reason() -> None:
    lost = Dropped("pit", np.zeros(3), -1e-6, 5.0, 2, 0.0, "hardly spoken for")
    rows = feature_rows(replace(_model_of_one(), dropped=(lost,)), "key")
    assert rows[-1]["why_dropped"] == "hardly spoken for" and not rows[-1]["kept"] and rows[-1]["id"] is None
    assert rows[0]["kept"] and rows[-1]["height"] == -1e-6 and rows[-1]["probability"] == 0.5
    assert list(rows[-1]) == list(rows[0]) == list(FEATURE_COLUMNS)
    assert parquet_bytes(FEATURE_COLUMNS, [])  # a log without features has a table, too


def _model_of_one() -> ObjectModel:
    size = Interval(1e-6, 0.9e-6, float("inf"), censored=True)
    feature = Feature(
        "bump", [[0.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]], size, size, size, Support(5.0, 1), True, 0.0, id="bump-1"
    )
    return ObjectModel(
        Base(Surface([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]])), features=(feature,)
    )


def test_a_number_that_is_not_known_is_empty() -> None:
    (row,) = feature_rows(_model_of_one(), "key")
    assert row["height_high"] is None and row["log_odds"] is None and row["probability"] is None


def test_a_runs_key_changes_with_bytes_and_settings_alone() -> None:
    key = run_key("a", {"tip_radius": "2 um", "form": None})
    assert key == run_key("a", {"tip_radius": "2 um"}) and len(key) == 16
    assert len({key, run_key("b", {"tip_radius": "2 um"}), run_key("a", {"tip_radius": "3 um"})}) == 3


def test_the_command_names_the_table_where_there_is_no_report(
    out: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["analyze", out / "a.csv", "--tip-radius", "2 um", "--quick", "--out", out / "told"]
    assert explore3d_main(monkeypatch, *words) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"features: {out / 'told' / 'features.csv'}"


def test_a_table_keeps_what_is_odd_in_it_and_a_reason_of_megabytes() -> None:
    columns = {"value": "float64", "text": "string", "count": "int64"}
    rows = [
        {"value": 0.1 + 0.2, "text": "line\nbreak, \u2028, \u00b5", "count": 2**60},
        {"value": None, "text": "2026-11-23T10:00:00", "count": None},
        {"value": 1e-300, "text": "x" * 2_000_000, "count": 0},
    ]
    assert pq.read_table(io.BytesIO(parquet_bytes(columns, rows))).to_pylist() == rows
