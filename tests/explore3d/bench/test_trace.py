"""The trace bench times every method on the same meshes and queries and says how far they disagree."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from explore3d.bench import trace as bench


@pytest.fixture
def here(monkeypatch):
    """Everything in this process: starting others takes seconds."""
    monkeypatch.setattr(bench, "_in_own_process", lambda work, *case: work(*case))
    monkeypatch.setattr(bench, "REPEATS", 1)


def test_every_case_is_timed_on_both_meshes_and_the_ranges_are_told(here):
    timings = list(bench.bench_trace([200], [0.05, 0.5], ["grid", "scattered"], side=8))
    assert len({(t.mesh, t.ratio, t.layout) for t in timings}) == len(timings) == 8
    assert all(t.queries == t.answered == 64 and t.two_cores > 0.0 for t in timings)
    lines = list(bench.trace_table(timings))
    assert len(lines) == 1 + 8 + 2
    assert all(line.startswith("explore3d") for line in lines[1:-2])
    rates = [t.rate for t in timings if t.mesh == "irregular"]
    assert f"explore3d {min(rates):.3g} to {max(rates):.3g} points/s" in lines[-1]


def test_a_peer_that_is_not_installed_is_named_and_left_out(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    methods, missing = bench.trace_methods(peers=True)
    assert methods == ["explore3d"]
    assert any("OpenCAMLib" in line and "pip install 'explore3d[peers]'" in line for line in missing)
    assert bench.trace_methods(peers=False) == (["explore3d"], [])


@pytest.mark.parametrize(
    ("method", "module", "most"),
    [("OpenCAMLib BallCutter", "opencamlib", 1e-12), ("coal, advancing", "coal", 1e-7)],
)
def test_an_exact_peer_agrees_with_our_heights(here, method, module, most):
    pytest.importorskip(module)
    timings = list(bench.bench_trace([800], [0.05, 0.5], ["grid"], 12, [method], peer_seconds=0.2))
    for timing in timings:
        assert 8 <= timing.answered <= timing.queries == 144
        assert timing.error <= most


def test_rays_meet_the_body_where_a_ball_of_hardly_any_size_does(here):
    pytest.importorskip("open3d")
    # a ball of the radius r rests r / cos a above ground that is steep by the angle a, whose tangent is 2.6 at most; a
    # ray's single precision loses some 1e-6 of the body
    for timing in bench.bench_trace([800], [1e-3], ["scattered"], 12, ["Open3D rays, no ball"]):
        assert timing.error < 2.0


def test_a_slow_peer_is_asked_an_even_share_and_told_at_its_pace():
    asked = []

    def answer(which):
        asked.append(which)
        return np.zeros(len(which)), 0.5, 0.01 * len(which)

    found = bench._of_a_share(answer, 1000, 1.0)
    assert [len(which) for which in asked] == [8, 100]
    assert len(np.unique(found.which)) == 100
    assert found.queries == pytest.approx(10.0)
    assert found.seconds == pytest.approx(10.5)


@pytest.mark.parametrize("kind", ["regular", "irregular"])
def test_the_mesh_is_a_sheet_over_the_whole_square_of_about_so_many_triangles(kind):
    mesh = bench.TRACED_MESHES[kind](20_000)
    assert abs(len(mesh.faces) - 20_000) < 600
    assert mesh.vertices[:, 2].max() == pytest.approx(1.0, abs=0.01)
    assert (mesh.face_normals[:, 2] > 0.0).all()
    assert np.abs(mesh.face_areas * mesh.face_normals[:, 2]).sum() == pytest.approx(bench.GROUND_SIDE**2)
