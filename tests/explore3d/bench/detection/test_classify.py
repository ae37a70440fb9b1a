"""Every kind of feature on a simulated object: found, rightly named, nothing invented."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from explore3d.bench.detection import classify
from explore3d.bench.detection.classify import bench_classify, classify_table, trial
from explore3d.bench.scenes.kinds import BODIES_BY_KIND

KINDS = [
    "bump",
    "ridge",
    "groove",
    "pit",
    "step",
    "junction Y",
    "junction T",
    "O-ring",
    "crossing",
    "curved ridge",
    "empty",
]


@pytest.mark.parametrize("body", ["bump", pytest.param("junction Y", marks=pytest.mark.slow)])
def test_a_kind_is_told_at_the_noise_of_the_apparatus(body: str) -> None:
    assert trial(body, "apparatus", "two ways", 0)["right"]


@pytest.mark.slow
@pytest.mark.parametrize("pattern", ["two ways", "followed"])
@pytest.mark.parametrize("noise", ["none", "apparatus"])
@pytest.mark.parametrize("body", KINDS)
def test_every_kind_is_told(body: str, noise: str, pattern: str) -> None:
    results = [trial(body, noise, pattern, seed) for seed in range(5)]
    # one false alarm in a hundred metres of path is asked for: one in about fifteen of these tests
    assert sum(result["right"] for result in results) >= (5 if noise == "none" else 4)


def test_the_bench_goes_on_where_it_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[int] = []

    def one(body: str, noise: str, pattern: str, seed: int) -> dict[str, object]:
        done.append(seed)
        return {"true": 1, "found": 1, "typed": 1, "invented": 0, "right": True, "seconds": 0.1}

    monkeypatch.setattr(classify, "trial", one)
    store = tmp_path / "classify.jsonl"
    list(bench_classify(["bump"], ["apparatus"], ["two ways"], range(2), store))
    records = list(bench_classify(["bump"], ["apparatus"], ["two ways"], range(4), store))
    assert done == [0, 1, 2, 3] and len(records) == 4
    assert len([json.loads(text) for text in store.read_text().splitlines()]) == 4
    assert classify_table(records).splitlines()[1] == "bump,apparatus,two ways,4,1,1,0,1,0.1"


@pytest.mark.parametrize("name", sorted(BODIES_BY_KIND))
def test_every_body_has_the_truth_that_it_is_named_for(name: str) -> None:
    kinds = {true.kind for true in BODIES_BY_KIND[name]().truth}
    expected = {"junction Y": "ridge", "junction T": "ridge", "O-ring": "ridge", "crossing": "ridge"}
    expected |= {"curved ridge": "ridge", "fine groove": "groove"}
    assert kinds == (set() if name == "empty" else {expected.get(name, name)})


def test_two_slight_crossings_by_the_rim_of_a_pit_are_the_pits_own() -> None:
    # at the placement of seed 3 two sweeps touch the rim; a groove was drawn through both
    result = classify.trial("pit", "none", "two ways", 3)
    assert result["right"], result
