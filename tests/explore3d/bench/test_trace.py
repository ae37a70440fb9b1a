"""The trace bench times every method on the same queries and says how far they disagree."""

from __future__ import annotations

import importlib.util

import pytest

from explore3d.bench import trace as bench
from explore3d.errors import UserError


def test_every_case_is_timed_and_printed_on_a_line(monkeypatch):
    monkeypatch.setattr(bench, "_in_own_process", bench._timed)
    lines = list(bench.trace_table(bench.bench_trace([200], [0.05, 0.5], ["grid", "scattered"], side=8, peers=False)))
    assert len(lines) == 1 + 4
    assert all(line.startswith("explore3d") for line in lines[1:])


def test_a_peer_that_is_not_installed_is_named_before_anything_runs(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"OpenCAMLib.*pip install explore3d\[peers\]"):
        bench.bench_trace([200], peers=True)


@pytest.mark.parametrize("ratio", [0.05, 0.5])
def test_the_drop_cutter_of_opencamlib_agrees_with_our_heights(monkeypatch, ratio):
    pytest.importorskip("opencamlib")
    monkeypatch.setattr(bench, "PEER_SECONDS", 0.2)
    timing = bench._timed("OpenCAMLib BallCutter", 2000, ratio, "grid", 16)
    assert 8 <= timing.answered <= timing.queries == 256
    assert timing.error <= 1e-12


def test_the_mesh_is_a_closed_sheet_of_about_so_many_triangles():
    mesh = bench.bump_mesh(20_000)
    assert abs(len(mesh.faces) - 20_000) < 300
    assert mesh.vertices[:, 2].max() == pytest.approx(1.0)
