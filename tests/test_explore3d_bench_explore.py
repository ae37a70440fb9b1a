"""The exploration bench: its bodies, its resumption, and the acceptance in small."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from explore3d import bench_explore
from explore3d.bench_scenes import SCENES, WIRE, tube


def test_every_tube_is_closed_and_has_the_volume_of_a_capsule() -> None:
    axis = np.linspace([0.0, 0.0, 0.0], [0.02, 0.0, 0.0], 9)
    vertices, faces = tube(axis, np.tile([0.0, 0.0, 1.0], (9, 1)), 0.003, sides=96, rings=24)
    volume = np.einsum("fi,fi->", vertices[faces[:, 0]], np.cross(vertices[faces[:, 1]], vertices[faces[:, 2]])) / 6
    assert volume == pytest.approx(np.pi * 0.003**2 * 0.02 + 4 / 3 * np.pi * 0.003**3, rel=0.01)


@pytest.mark.parametrize("name", sorted(SCENES))
def test_the_wires_of_a_scene_rest_on_its_base(name: str) -> None:
    scene = SCENES[name]()
    top = scene.object.vertices[:, 2].max()
    assert top == pytest.approx(WIRE if scene.truth else 0.0, abs=1e-5)
    assert len(scene.base.faces) < len(scene.object.faces) or not scene.truth


def test_the_bench_goes_on_where_it_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_explore, "one_run", lambda body, strategy, seed: {"finger_seconds": seed})
    out = tmp_path / "bench.jsonl"
    first = list(bench_explore.bench(["empty"], ["explore"], 2, out))
    assert [record["seed"] for record in first] == [0, 1]
    more = list(bench_explore.bench(["empty"], ["explore"], 3, out))
    assert [record["seed"] for record in more] == [2]
    assert len([json.loads(text) for text in out.read_text().splitlines()]) == 3


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["straight", "curved", "o-ring", "two", "edge"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_exploring_finds_every_ridge_and_its_ends(scene: str, seed: int) -> None:
    result = bench_explore.one_run(SCENES[scene](), "explore", seed)
    assert result["found"] == result["true"]
    assert result["missed"] == result["invented"] == result["mistyped"] == 0
    assert result["end_error"] is None or result["end_error"] < 0.5e-3
    assert result["axis_rms"] < 0.1e-3


@pytest.mark.slow
def test_on_an_empty_plate_exploring_is_no_more_than_the_survey() -> None:
    result = bench_explore.one_run(SCENES["empty"](), "explore", 0)
    assert result["outcome"] == "nothing found" and result["invented"] == 0
    assert result["finger_seconds"] < 75.0
