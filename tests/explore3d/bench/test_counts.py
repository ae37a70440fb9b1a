"""The bench of stated numbers of details: what accounts say together, and plates whose answer is plain."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from explore3d.bench.posterior import bench_counts, counts_table
from explore3d.bench.posterior.counts import COUNTED_SNR, WHITE, CountCase, counted, drawn, run_counts, stated_counts
from explore3d.bench.scenes import FIRST_BUILT_WITH

ACCOUNT = (("two ridges", 0.8), ("one ridge", 0.2))


def test_accounts_of_several_neighbourhoods_multiply() -> None:
    plain = drawn(np.random.default_rng(0))
    pair = replace(plain, details=replace(plain.details, account=ACCOUNT))
    assert stated_counts([]) == {0: 1.0}
    assert stated_counts([plain, plain]) == {2: 1.0}
    assert stated_counts([pair, pair]) == pytest.approx({1: 0.2, 2: 0.8})
    assert stated_counts([pair, pair, plain]) == pytest.approx({2: 0.2, 3: 0.8})
    assert stated_counts([pair] * 4) == pytest.approx({2: 0.04, 3: 0.32, 4: 0.64})


def test_what_leaves_too_little_to_be_counted_is_not_laid_down() -> None:
    enough = 1.1 * COUNTED_SNR * WHITE
    high, low, hidden = np.diag([enough, 0.5 * enough, 0.0])
    np.testing.assert_array_equal(counted(np.array([high, low])), [high])
    np.testing.assert_array_equal(counted(np.array([high, high, hidden])), [high])  # neither of both leaves anything
    assert len(counted(np.zeros((0, 3)))) == 0


def test_what_is_in_the_store_is_not_run_again(tmp_path: Path) -> None:
    store = tmp_path / "counts.jsonl"
    (case,) = bench_counts(store, 1, building=True)
    size = store.stat().st_size
    assert bench_counts(store, 1, building=True) == [case] and store.stat().st_size == size
    assert case.seed == FIRST_BUILT_WITH and sum(case.stated.values()) == pytest.approx(1.0)


def test_the_table_holds_stated_numbers_against_true_ones() -> None:
    cases = [CountCase(k, 2 if k < 3 else 1, {1: 0.25, 2: 0.75}, 1.0) for k in range(4)]
    lines: list[str] = []
    counts_table(cases, lines.append)
    assert "stated  20 to  30 %:     4 numbers, mean  25.0 %, came true  25.0 %" in lines[0]
    assert "stated  70 to  80 %:     4 numbers, mean  75.0 %, came true  75.0 %" in lines[1]
    assert lines[-1].startswith("4 plates: the likeliest number is right in 3, too low in 0, too high in 1")


def test_a_number_that_the_trace_contradicts_is_left_open() -> None:
    case = run_counts(FIRST_BUILT_WITH + 269)  # two details, told as one
    assert case.left_open and case.true not in case.stated
    assert not run_counts(FIRST_BUILT_WITH + 3).left_open
    lines: list[str] = []
    counts_table([case, CountCase(1, 2, {2: 0.95, 1: 0.05}, 1.0)], lines.append)
    assert not any("came true   0.0 %" in line and "stated  90" in line for line in lines)
    assert "too low in 1, too high in 0; in 1 it is left open, of which 0 right" in lines[-1]
