"""The circle: explored, displayed, explored again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from explore3d.bench.display import bench_circle, circle, circle_lines
from explore3d.bench.scenes import DRAWN_KINDS, FIRST_BUILT_WITH


def size(kind: str, name: str, inside: bool) -> dict[str, Any]:
    return {"kind": kind, "size": name, "displayed": 1e-3, "felt": [0.9e-3, 1e-3, 1.1e-3, False], "inside": inside}


def test_what_is_in_the_store_is_not_run_again(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked = []

    def trial(body: str, seed: int) -> dict[str, Any]:
        asked.append((body, seed))
        return {"displayed": 1, "found": 1, "invented": 0, "sizes": [size(body, "height", seed == 0)]}

    monkeypatch.setattr(circle, "circle_trial", trial)
    store = tmp_path / "circle.jsonl"
    some = list(bench_circle(["pit"], range(2), store))
    both = list(bench_circle(["pit", "bump"], range(2), store))
    assert asked == [("pit", 0), ("pit", 1), ("bump", 0), ("bump", 1)]
    assert len(some) == 2 and len(both) == 4 and len(store.read_text().splitlines()) == 4
    assert list(bench_circle(["ridge"], range(1), store, seconds=-1.0)) == []


def test_the_table_counts_each_size_by_its_kind() -> None:
    found = [size("ridge", "height", True), size("ridge", "length", False)]
    lost = [size("pit", "width", False)]
    records = [
        {"displayed": 1, "found": 1, "invented": 0, "sizes": found},
        {"displayed": 1, "found": 0, "invented": 2, "sizes": lost},
    ]
    lines = list(circle_lines(records))
    assert lines[2:] == [
        "| ridge | 2 | 1 of 1 |  | 0 of 1 | 50 % |",
        "| pit | 1 |  | 0 of 1 |  | 0 % |",
        "| all | 3 | 1 of 1 | 0 of 1 | 0 of 1 | 33 % |",
        "features displayed: 2",
        "features found: 1",
        "features invented: 2",
    ]


@pytest.mark.parametrize("name", DRAWN_KINDS)
def test_drawn_bodies_differ_from_seed_to_seed_and_have_one_feature(name: str) -> None:
    one, same, other = (DRAWN_KINDS[name](np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert len(one.truth) == 1 and one.truth[0].kind == name
    assert np.array_equal(one.object.vertices, same.object.vertices)
    assert not np.array_equal(one.object.vertices, other.object.vertices)


@pytest.mark.slow
def test_a_bump_that_is_displayed_is_found_again() -> None:
    record = circle.circle_trial("bump", FIRST_BUILT_WITH)
    assert record["displayed"] == record["found"] == 1 and record["invented"] == 0 and record["left_out"] == []
    height, width = record["sizes"]
    assert height["size"] == "height" and width["size"] == "width"
    low, median, high, censored = height["felt"]
    assert not censored and low < median < high
    assert abs(median - height["displayed"]) < 5.0 * (high - low)
