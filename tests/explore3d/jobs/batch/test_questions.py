"""The questions of docs/batch.md, asked of a store; and how long an answer takes of 100,000 rows."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from explore3d.analysis import FEATURE_COLUMNS, parquet_bytes
from explore3d.jobs.batch.places import Folder
from explore3d.jobs.batch.store import RUN_COLUMNS, Store

PAGE = (Path(__file__).parents[4] / "docs" / "batch.md").read_text()
QUESTIONS = [each for each in re.findall(r"```sql\n(.*?)```", PAGE, re.DOTALL)[0].split(";\n") if each.strip()]
MOST_SECONDS = 0.1


def feature(run: str, number: int, height: float, kind: str = "ridge") -> dict[str, Any]:
    known = {"run": run, "id": f"{kind}-{number}", "kind": kind, "kept": True, "height": height, "width": 1e-3}
    return dict.fromkeys(FEATURE_COLUMNS) | known | {"height_low": 0.9 * height, "probability": 0.999}


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    known = {"seconds": 1.0, "noise_white": 1e-6, "noise_correlated": 0.0, "detection_limit": 5e-6}
    done = dict.fromkeys(RUN_COLUMNS) | known | {"status": "done", "object": "ring"}
    with_two, empty = (
        done | {"run": "a", "log": "a.csv", "features": 2},
        done | {"run": "b", "log": "b.csv", "features": 0},
    )
    dropped = feature("a", 1, 1e-5, "bump") | {"kept": False, "why_dropped": "hardly spoken for", "id": None}
    whole = Store(Folder(tmp_path / "store"))
    whole.add(with_two, [feature("a", 1, 0.2e-3), feature("a", 2, 0.05e-3), feature("a", 1, 2e-5, "bump"), dropped])
    whole.add(empty, [])
    whole.add(dict.fromkeys(RUN_COLUMNS) | {"run": "c", "log": "c.csv", "status": "refused", "reason": "empty"}, [])
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_ten_questions_are_answered(store: Path) -> None:
    duckdb = pytest.importorskip("duckdb")
    assert len(QUESTIONS) == 10
    answers = [duckdb.sql(question).fetchall() for question in QUESTIONS]
    assert [row[1] for row in answers[0]] == [row[1] for row in answers[1]] == ["ridge-1"]
    assert answers[2] == [("done", 2, 2.0), ("refused", 1, None)] and answers[3] == [("c.csv", "refused", "empty")]
    assert ("ring", "ridge", 2, 0.125e-3) in [(a, b, c, pytest.approx(d)) for a, b, c, d in answers[4]]
    assert answers[5] == [("b.csv", 5e-6)] and len(answers[6]) == 2
    assert answers[7] == [("a.csv", "ridge-1", 0.2e-3)] and answers[8] == [("bump", "hardly spoken for", 1)]
    assert answers[9] == [(pytest.approx(2e-5), 1)]


def test_the_question_in_polars_is_answered(store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("polars")
    exec(re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)[-1], {})
    assert "ridge-1" in capsys.readouterr().out


@pytest.mark.parametrize("library", ["polars", pytest.param("duckdb", marks=pytest.mark.slow)])
def test_an_answer_of_a_hundred_thousand_rows_takes_less_than_a_tenth_of_a_second(library: str, tmp_path: Path) -> None:
    module = pytest.importorskip(library)
    rng = np.random.default_rng(0)
    rows = [
        feature(f"{k // 10:016x}", k % 10, float(height), ("ridge", "bump")[k % 2])
        for k, height in enumerate(rng.exponential(0.05e-3, 100_000))
    ]
    (tmp_path / "features").mkdir()
    for part in range(4):
        content = parquet_bytes(FEATURE_COLUMNS, rows[part::4])
        (tmp_path / "features" / f"pack-{part}.parquet").write_bytes(content)
    pattern, seconds = f"{tmp_path}/features/*.parquet", []
    for _ in range(3):
        began = time.process_time()  # of all threads: a busy machine does not lengthen it as it does the clock's
        if library == "duckdb":
            found = len(module.sql(QUESTIONS[0].replace("store/features/*.parquet", pattern)).fetchall())
        else:
            tall = (
                (module.col("kind") == "ridge") & (module.col("height") > 0.1e-3) & (module.col("probability") > 0.99)
            )
            found = len(module.scan_parquet(pattern).filter(module.col("kept") & tall).select("run", "id").collect())
        seconds.append(time.process_time() - began)
    assert found == sum(row["kind"] == "ridge" and row["height"] > 0.1e-3 for row in rows)
    assert min(seconds) < MOST_SECONDS
    print(library, seconds)
