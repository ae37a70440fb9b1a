"""The exploration bench: its bodies, its resumption, and the acceptance in small."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from explore3d import UserError
from explore3d.bench.exploration import exploring as bench_explore
from explore3d.bench.scenes.bodies import tube
from explore3d.bench.scenes.exploring import SCENES, misplaced
from explore3d.jobs.expedition import explorer
from explore3d.jobs.plan import plan_scene
from explore3d.jobs.run import run, scene_finger
from explore3d.scene.scene import load_scene
from mapping.geometry.mesh.nearest import NearestPoint
from mapping.surface import Surface


def test_every_tube_is_closed_and_has_the_volume_of_a_capsule() -> None:
    axis = np.linspace([0.0, 0.0, 0.0], [0.02, 0.0, 0.0], 9)
    vertices, faces = tube(axis, np.tile([0.0, 0.0, 1.0], (9, 1)), 0.003, sides=96, rings=24)
    volume = np.einsum("fi,fi->", vertices[faces[:, 0]], np.cross(vertices[faces[:, 1]], vertices[faces[:, 2]])) / 6
    assert volume == pytest.approx(np.pi * 0.003**2 * 0.02 + 4 / 3 * np.pi * 0.003**3, rel=0.01)


@pytest.mark.parametrize("name", sorted(SCENES))
def test_the_features_of_a_scene_lie_on_its_base_within_what_the_finger_can_reach(name: str) -> None:
    scene = SCENES[name](np.random.default_rng(0))
    nearest = NearestPoint(scene.base)
    # the free-form body's triangles cut some hundredths of a millimetre off it; a misplaced body is also turned
    off = 6e-3 if scene.misplaced else 1e-4
    for feature in scene.truth:
        assert nearest.query(feature.axis).distance.max() < off
    high = scene.base.bounds[1]
    tallest = max((feature.height for feature in scene.truth), default=0.0)
    assert (scene.object.bounds[1] <= high + max(tallest, 0.0) + off).all()
    assert scene.shortest_ridge is None or all(span(f.axis) > scene.shortest_ridge for f in scene.truth)


@pytest.mark.parametrize("name", sorted(SCENES))
def test_a_bench_scene_has_meshes_that_a_scene_file_may_have(name: str) -> None:
    scene = bench_explore.bench_scene(SCENES[name](np.random.default_rng(1)), "explore", 1)
    with scene_finger(scene) as finger:
        assert finger.tip_radius == scene.tip.radius
    assert (scene.base_surface() is None) == (name in ("unknown fold", "unknown form"))


def test_a_mesh_in_memory_is_refused_as_one_in_a_file_is() -> None:
    body = SCENES["groove"](np.random.default_rng(1))
    faces = body.object.faces.copy()
    faces[-8:] = faces[-8:, ::-1]  # the groove's walls look into the plate
    turned = replace(body, object=Surface(body.object.vertices, faces))
    with pytest.raises(UserError, match="join an outer side to an inner one"):
        scene_finger(bench_explore.bench_scene(turned, "explore", 1))


def test_a_misplaced_body_is_moved_with_its_features_by_3_mm_and_2_degrees() -> None:
    straight = SCENES["edge"](np.random.default_rng(0))
    moved = misplaced(straight, np.random.default_rng(1))
    before, after = straight.object.vertices, moved.object.vertices
    assert np.linalg.norm((after - before).mean(axis=0)) == pytest.approx(3e-3, rel=1e-9)
    rotation = np.linalg.lstsq(before - before.mean(axis=0), after - after.mean(axis=0), rcond=None)[0]
    assert np.degrees(np.arccos(0.5 * (np.trace(rotation) - 1.0))) == pytest.approx(2.0, rel=1e-6)
    gap = NearestPoint(moved.object).query(moved.truth[0].axis).distance
    assert gap == pytest.approx(NearestPoint(straight.object).query(straight.truth[0].axis).distance, abs=1e-9)


def test_another_seed_places_the_features_elsewhere() -> None:
    first, second = (SCENES["straight"](np.random.default_rng(seed)).truth[0].axis for seed in (0, 1))
    assert np.linalg.norm(first.mean(axis=0) - second.mean(axis=0)) > 1e-3


def span(axis: np.ndarray) -> float:
    return float(np.linalg.norm(axis[:, None] - axis[None], axis=2).max())


def test_the_bench_goes_on_where_it_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_explore, "one_run", lambda body, strategy, seed, noise: {"finger_seconds": seed})
    out = tmp_path / "bench.jsonl"
    first = list(bench_explore.bench_exploring(["empty"], ["explore"], 2, out))
    assert [record["seed"] for record in first] == [0, 1]
    more = list(bench_explore.bench_exploring(["empty"], ["explore"], 3, out))
    assert [record["seed"] for record in more] == [2]
    assert len([json.loads(text) for text in out.read_text().splitlines()]) == 3


RIDGES = ("groove", "straight", "curved", "o-ring", "junction", "two", "edge", "helix", "wrong pose", "free form")


@pytest.mark.slow
@pytest.mark.parametrize("scene", RIDGES)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_exploring_finds_every_ridge_and_its_ends(scene: str, seed: int) -> None:
    result = bench_explore.one_run(SCENES[scene](np.random.default_rng(seed)), "explore", seed)
    assert result["found"] == result["true"]
    assert result["missed"] == result["invented"] == result["mistyped"] == 0
    assert result["end_error"] is None or result["end_error"] < 0.5e-3
    assert result["axis_rms"] < 0.1e-3


@pytest.mark.slow
def test_on_an_empty_plate_exploring_is_no_more_than_the_survey(tmp_path: Path) -> None:
    result = bench_explore.one_run(SCENES["empty"](np.random.default_rng(0)), "explore", 0)
    assert result["outcome"] == "nothing found" and result["invented"] == 0
    (scene,) = bench_explore.write_bench_scenes(["empty"], 1, tmp_path)
    assert result["finger_seconds"] == pytest.approx(plan_scene(scene).seconds, rel=0.01)


@pytest.mark.parametrize("name", ["two", "unknown fold", "wrong pose"])
def test_a_written_bench_scene_explores_as_the_one_in_memory(name: str, tmp_path: Path) -> None:
    body = SCENES[name](np.random.default_rng(1))
    held = bench_explore.bench_scene(body, "explore", 1)
    files = list(bench_explore.write_bench_scenes([name], 2, tmp_path, "apparatus"))
    scene = load_scene(files[1])
    assert scene.text == held.text
    for mine, other in ((scene.base_surface(), held.base_surface()), (scene.object_surface(), held.object_surface())):
        assert (mine is None) == (other is None)
        assert mine is None or other is None or np.array_equal(mine.vertices, other.vertices)
    with scene_finger(scene) as finger, scene_finger(held) as clone:
        one, two = explorer(scene, finger.workspace), explorer(held, clone.workspace)
    assert {**one.explore.keywords, "region": None} == {**two.explore.keywords, "region": None}
    assert (one.locate is None, one.discover is None) == (two.locate is None, two.discover is None)


@pytest.mark.slow
def test_the_bench_gives_what_the_command_gives(tmp_path: Path) -> None:
    body = SCENES["o-ring"](np.random.default_rng(0))
    (scene,) = bench_explore.write_bench_scenes(["o-ring"], 1, tmp_path)
    analysis = run(scene, tmp_path / "out", report=False)
    of_the_command = bench_explore.errors(analysis.model, body)
    of_the_bench = bench_explore.one_run(body, "explore", 0)
    assert of_the_command["found"] == 1
    assert {name: of_the_bench[name] for name in of_the_command} == of_the_command
