"""The detection benches: their bounds, their bookkeeping, and that a stopped one goes on."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from explore3d.bench.detection.detect import (
    DETECTORS,
    TIP_RADIUS,
    Case,
    all_cases,
    bench_detect,
    cells,
    matched_filter_bound,
    simulated_sweep,
)
from explore3d.bench.detection.detect_curves import write_curves

WIRE = Case("wire", 0.065, "white", 0.02, 0)


def test_the_bound_is_that_of_the_theory():
    # theory section 6: the smallest wire found with 95 % at sigma = 0.2 mm is 0.081 mm
    small = [matched_filter_bound(replace(WIRE, size=d / TIP_RADIUS)) for d in (0.079e-3, 0.083e-3)]
    assert small[0] < 0.95 < small[1]
    assert matched_filter_bound(WIRE) > 0.999999
    # d' of an OU process of 0.2 mm over 1 mm: 4.9 for the paper's wire, and u = 4.2
    np.testing.assert_allclose(matched_filter_bound(replace(WIRE, kind="correlated")), 0.76, atol=0.01)


def test_a_simulated_sweep_has_the_feature_where_it_says_and_normals_across_the_path():
    trace, place, extent = simulated_sweep(replace(WIRE, noise=1e-6))
    x, z = trace.centers[:, 0], trace.centers[:, 2]
    assert abs(x[z.argmax()] - place) < 0.02 * extent
    np.testing.assert_allclose(z.max() - TIP_RADIUS, 0.65e-3, rtol=1e-3)
    inner = np.abs(x - place) < 0.8 * extent
    slope = np.gradient(z, x)[inner]
    np.testing.assert_allclose(np.median(trace.normals[inner, 0] / trace.normals[inner, 2] / -slope), 1.0, atol=0.01)


def test_a_stopped_bench_goes_on_where_it_was_and_writes_its_table(tmp_path):
    store = tmp_path / "detect.jsonl"
    cases = [WIRE, replace(WIRE, seed=1)]
    bench_detect(cases[:1], store)
    before = store.read_text()
    assert bench_detect(cases, store, seconds=0.0) == [json.loads(before)]
    records = bench_detect(cases, store)
    assert store.read_text().startswith(before)
    assert len(records) == 2
    written = write_curves(cells(records), tmp_path / "curves")
    assert all(path.stat().st_size for path in written)
    rows = list(csv.DictReader((tmp_path / "curves" / "detect.csv").open()))
    assert [row["detector"] for row in rows] == list(DETECTORS)
    by_height = rows[0]
    assert (by_height["recall"], by_height["sweeps"]) == ("1", "2")
    assert float(by_height["location_rms"]) < 1e-4


def test_the_quick_campaign_is_a_part_of_the_whole():
    whole, quick = list(all_cases(2, False)), list(all_cases(2, True))
    assert set(quick) < set(whole)
    assert len(set(whole)) == len(whole)


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["none", "white", "correlated"])
@pytest.mark.parametrize("body", ["plane", "sphere", "cylinder", "torus"])
def test_smooth_bodies_hold_nothing_without_noise_and_no_more_than_asked_with_it(body, noise):
    from scipy.stats import poisson

    from explore3d.bench.detection.false_alarms import COUNTABLE_ALARM_RATE, run_case

    records = [run_case(body, noise, seed) for seed in range(1 if noise == "none" else 12)]
    found, metres = sum(r["found"] for r in records), sum(r["metres"] for r in records)
    assert found <= (0 if noise == "none" else poisson.ppf(0.999, COUNTABLE_ALARM_RATE * metres))
