"""The scaling bench: exponents, its store, and one small size end to end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from explore3d.bench import scaling as bench_scaling
from explore3d.bench.scaling import Cost, exponents, scaling_lines
from explore3d.bench.scenes.long_log import wire_axes, write_long_log
from explore3d.log.own.reader import read_log


def test_exponents_are_those_of_the_costs():
    costs = [Cost("samples", 10**k, 3e-6 * 10**k, int(2e3 * 10 ** (0.5 * k))) for k in range(4, 9)]
    costs += [Cost("features", n, 5.0 + 0.1 * n, 1000) for n in (0, 10, 50, 200)]
    fitted = exponents(costs)
    assert fitted["samples"] == pytest.approx((1.0, 0.5), abs=1e-3)
    assert fitted["features"] == pytest.approx((1.0, 0.0), abs=1e-3)
    assert "samples: time ~ n^1.00" in list(scaling_lines(iter(costs)))[-1]


def test_small_logs_do_not_count_and_what_features_cannot_tell_is_said():
    costs = [Cost("samples", 10**k, max(1.0, 1e-6 * 10**k), 1000) for k in (4, 5, 6, 7)]
    costs += [Cost("triangles", 1000, 1.0, 1000)]
    costs += [Cost("features", n, 5.0 - 0.001 * n, 1000) for n in (0, 10, 50)]
    told = list(scaling_lines(iter(costs)))
    assert "samples: time ~ n^1.00, memory ~ n^0.00" in told
    assert "triangles: too few sizes to fit" in told
    assert told[-1].endswith("features: time ~ n^nan, memory ~ n^0.00")


def test_wires_do_not_touch_each_other():
    for count in (1, 4, 50, 200):
        axes = wire_axes(count, 0.8, 0.09)
        assert len(axes) == count
        middles = np.array([axis.mean(axis=0) for axis in axes])
        apart = np.linalg.norm(middles[:, None] - middles[None], axis=2) + np.eye(count)
        assert apart.min() > 7.2e-3  # twice the half width of a wire's trace


def test_a_long_log_holds_what_was_asked_for(tmp_path: Path):
    write_long_log(tmp_path / "log.mcap", 20_000, wires=1)
    trace = read_log(tmp_path / "log.mcap").trace
    assert len(trace) == 20_000
    assert trace.centers[:, 2].max() > 10e-3 + 0.5e-3


@pytest.mark.slow
def test_finished_sizes_are_not_run_again(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(bench_scaling, "TRIANGLE_COUNTS", (100, 200))
    first = list(bench_scaling.bench_scaling(tmp_path / "store.jsonl", ["triangles"]))
    assert [cost.size for cost in first] == [100, 200]
    assert all(cost.found > 0 and cost.memory > 1e7 for cost in first)
    again = list(bench_scaling.bench_scaling(tmp_path / "store.jsonl", ["triangles"]))
    assert again == first


def test_a_surface_under_sweeps_is_timed_and_has_no_holes():
    cost = bench_scaling.measure("surface", 3_000)
    assert cost.found == 0
    assert cost.seconds > 0.0 and cost.stages["meshing all samples"] > 0.0


def test_a_ball_follows_the_corrugated_plate_everywhere():
    trace = bench_scaling.corrugated_sweeps(2_000, 4)
    row = trace.centers[trace.sweep == 0]
    x = np.linspace(-1e-3, row[-1, 0] + 1e-3, 20_000)
    ground = np.column_stack([x, np.zeros_like(x), bench_scaling.SWEPT_HEIGHT * np.sin(2 * np.pi / 8e-3 * x)])
    nearest = np.array([np.linalg.norm(ground - centre, axis=1).min() for centre in row[::25]])
    np.testing.assert_allclose(nearest, trace.tip_radius, rtol=1e-6)


def test_borders_of_a_mesh_are_counted_with_its_holes():
    grid = np.arange(25).reshape(5, 5)
    a, b, c, d = (
        grid[i, j].ravel()
        for i, j in [(np.s_[:-1], np.s_[:-1]), (np.s_[1:], np.s_[:-1]), (np.s_[1:], np.s_[1:]), (np.s_[:-1], np.s_[1:])]
    )
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    assert bench_scaling._borders(faces) == 1
    assert bench_scaling._borders(np.delete(faces, 5, axis=0)) == 2
