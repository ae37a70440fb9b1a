"""The curvature bench: bodies with true curvatures, a line for each case, and files."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from explore3d.bench import curvature as bench
from explore3d.bench.scenes import CURVED_BODIES, SAMPLINGS, curved_body


@pytest.mark.parametrize("body", bench.BODIES_OF_KNOWN_CURVATURE)
def test_a_body_measures_two_and_its_curvatures_are_those_of_a_fine_fit(body):
    known = bench.BODIES_OF_KNOWN_CURVATURE[body](10_000)
    assert np.ptp(known.surface.vertices, axis=0).max() == pytest.approx(bench.BODY_SIZE, rel=1e-3)
    line = bench.measure("plain jet, degree 4, 48 points", body, 10_000, 0.0)
    assert line.median < 2e-3
    assert line.valid == 1.0


def test_lines_become_a_table_csv_json_and_a_picture(tmp_path):
    lines = [
        bench.measure(method, body, 400, 0.0)
        for body in bench.BODIES_OF_KNOWN_CURVATURE
        for method in ("plain jet, degree 4, 48 points", "libigl, 2 rings")
    ]
    assert len(list(bench.curvature_table(lines))) == 5
    files = bench.write_bench(lines, tmp_path / "new")
    rows = list(csv.DictReader(files[0].open()))
    assert [row["method"] for row in rows] == [line.method for line in lines]
    assert json.loads(files[1].read_text())[0]["median"] == lines[0].median
    assert files[2].read_bytes().startswith(b"\x89PNG")


def test_a_peer_that_is_not_installed_is_named_with_the_way_to_get_it(monkeypatch):
    monkeypatch.setitem(bench.PEERS, "pymeshlab, quadric", "no_such_module")
    methods, missing = bench.available()
    assert "pymeshlab, quadric" not in methods
    assert "explore3d[peers]" in missing[0]


@pytest.mark.parametrize(
    ("noise", "median"),
    [
        pytest.param(0.0, 6e-4, marks=pytest.mark.slow),
        pytest.param(1e-4, 3.7e-3, marks=pytest.mark.slow),
        pytest.param(1e-3, 3e-2, marks=pytest.mark.slow),
        pytest.param(1e-2, 0.13, marks=pytest.mark.slow),
    ],
)
def test_a_torus_is_as_exact_at_every_noise(noise, median):
    found = bench.measure("explore3d", "torus", 10_000, noise)
    assert found.median <= median
    assert found.valid > 0.999


@pytest.mark.parametrize("body", CURVED_BODIES)
@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_a_curved_body_lies_on_its_surface_and_faces_outward(body, sampling):
    still = curved_body(body, sampling, 0.0, 3)
    value, outward, _ = CURVED_BODIES[body](still.surface.vertices)
    assert np.abs(value).max() < 1e-12
    corner = still.surface.faces[:, 0]
    assert (np.einsum("fk,fk->f", still.surface.face_normals, outward[corner]) > 0).mean() > 0.99
    assert len(np.unique(still.surface.faces)) == len(still.surface.vertices)
    largest = {"sphere": 1.0, "ellipsoid": 4.0, "torus": 3.5, "saddle": 1.0, "bump": 30.0}[body]
    assert np.maximum(still.k1, -still.k2).max() <= largest * (1 + 1e-6)
    shaken = curved_body(body, sampling, 1e-3, 3)
    assert np.abs(shaken.k1 - still.k1).max() < 0.2 * largest


def test_the_truth_keeps_all_its_digits_where_both_curvatures_are_one():
    sphere = curved_body("sphere", "irregular", 0.0, 3)
    np.testing.assert_allclose([sphere.k1, sphere.k2], 1.0, rtol=0, atol=2e-15)


def test_the_seeds_that_are_reported_are_not_those_of_tuning():
    assert not set(bench.CURVATURE_SEEDS) & set(bench.CURVATURE_TUNING_SEEDS)


def test_cells_for_building_have_their_own_seeds(monkeypatch):
    used = []
    monkeypatch.setattr(bench, "measure_cell", lambda body, sampling, noise, methods, seeds: used.append(seeds) or [])
    assert list(bench.bench_cells(["explore3d"], 2)) == []
    assert set(used) == {bench.CURVATURE_SEEDS[:2]}
    used.clear()
    assert list(bench.bench_cells(["explore3d"], 2, building=True)) == []
    assert set(used) == {bench.CURVATURE_TUNING_SEEDS[:2]}


@pytest.mark.slow
def test_a_cell_compares_all_methods_at_the_same_vertices(tmp_path):
    cells = bench.measure_cell("saddle", "thin", 1e-3, ["explore3d", "jets alone", "libigl, 2 rings"], [1, 5])
    ours, jets, libigl = cells
    assert ours.median < libigl.median
    assert ours.p95 < libigl.p95
    assert 0.8 < ours.coverage < 1.0
    assert 0.0 < bench.measure_cell("torus", "thin", 1e-2, ["explore3d"], [1])[0].by_libigl < 0.3
    assert jets.by_libigl == 0.0
    assert np.isnan(libigl.coverage)
    assert len(list(bench.cell_table(cells))) == 4
    assert "p95 at most the best peer's: 1 of 1 cells" in list(bench.cell_verdicts(cells))
    files = bench.write_cells(cells, tmp_path)
    assert json.loads(files[1].read_text())[2]["coverage"] is None
