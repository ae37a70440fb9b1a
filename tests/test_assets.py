"""The shipped scenes and meshes: made by their script, small, and as true as their truth tables say."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from explore3d.bench.scenes import BODY_BUILDING_SEEDS, drawn_details
from explore3d.scene.mesh_files import load_mesh
from explore3d.scene.scene import Scene, load_scene
from mapping.arrays import FloatArray
from mapping.surface import Surface

ASSETS = Path(__file__).parents[1] / "assets"
BODIES = ("bowl", "double_ring", "folds", "heat_sink", "holed_plate", "vase")
NAMES = ("bump_of_revolution", "empty_plate", "mug", "step", "wire_on_plate", *BODIES)


def scene(name: str) -> Scene:
    return load_scene(ASSETS / "scenes" / f"{name}.toml")


def known(name: str) -> Surface:
    """The global model's mesh of a scene, which must have one."""
    surface = scene(name).base_surface()
    assert surface is not None
    return surface


@pytest.mark.slow
def test_the_script_makes_exactly_what_is_shipped(tmp_path: Path) -> None:
    shutil.copytree(ASSETS, tmp_path / "assets", ignore=shutil.ignore_patterns("*.ply", "__pycache__"))
    (tmp_path / "assets" / "meshes" / "bodies").mkdir(parents=True, exist_ok=True)
    subprocess.run([sys.executable, tmp_path / "assets" / "make_assets.py"], check=True)
    for path in sorted((ASSETS / "scenes").glob("*.toml")):
        assert (tmp_path / "assets" / "scenes" / path.name).read_bytes() == path.read_bytes(), path.name
    shipped = sorted(path.relative_to(ASSETS) for path in (ASSETS / "meshes").rglob("*.ply"))
    made = sorted(path.relative_to(tmp_path / "assets") for path in (tmp_path / "assets" / "meshes").rglob("*.ply"))
    assert made == shipped
    for path in shipped:
        assert (ASSETS / path).stat().st_size < 1_600_000
        again, here = load_mesh(tmp_path / "assets" / path), load_mesh(ASSETS / path)
        np.testing.assert_array_equal(again.faces, here.faces, path.name)
        # another processor's sine may differ in the last digit
        np.testing.assert_allclose(again.vertices, here.vertices, rtol=0, atol=1e-12, err_msg=path.name)


@pytest.mark.parametrize("name", BODIES)
def test_details_are_drawn_where_the_scene_of_a_body_has_them(name: str) -> None:
    """Whatever places are drawn by must not change: the shipped meshes would be of other details than their script's.

    The script itself takes longer, and is run by the slow test above.
    """
    drawn = drawn_details(known(name), 3e-3, np.random.default_rng(BODY_BUILDING_SEEDS[0]))
    assert [each.kind for each in drawn] == [truth.kind for truth in scene(name).truth]
    for each, truth in zip(drawn, scene(name).truth, strict=True):
        np.testing.assert_allclose(each.course, truth.axis, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_faces_look_outward_and_none_is_degenerate(name: str) -> None:
    for surface in (scene(name).object_surface(), known(name)):
        assert surface.face_areas.min() > 0
        edges = np.concatenate([surface.faces[:, [i, (i + 1) % 3]] for i in range(3)])
        assert len(np.unique(edges, axis=0)) == len(edges), "two faces run the same way along an edge"


def test_the_plain_plate_is_its_own_model() -> None:
    assert scene("empty_plate").finger.object == scene("empty_plate").model.mesh
    assert scene("empty_plate").truth == ()


def plate_frame(points: FloatArray) -> FloatArray:
    """Object frame to plate frame (u, v, outward): the tilt of 45 degrees about x taken back."""
    h = np.sqrt(0.5)
    return np.asarray(points @ np.array([[1, 0, 0], [0, h, -h], [0, h, h]]))


def test_the_plate_is_flat_and_tilted_by_45_degrees() -> None:
    plate = known("wire_on_plate")
    np.testing.assert_allclose(plate.face_normals, [[0, -np.sqrt(0.5), np.sqrt(0.5)]] * len(plate.faces), atol=1e-12)
    np.testing.assert_allclose(np.ptp(plate_frame(plate.vertices), axis=0), [0.2, 0.15, 0.0], atol=1e-12)


def test_the_wire_is_round_straight_and_lies_on_the_plate() -> None:
    (truth,) = scene("wire_on_plate").truth
    points = plate_frame(scene("wire_on_plate").object_surface().vertices[len(known("wire_on_plate").vertices) :])
    ends = plate_frame(np.array(truth.axis))
    assert ends[:, 2] == pytest.approx([0, 0], abs=1e-9)
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(truth.length, abs=2e-9)
    s = (points - ends[0]) @ along
    assert s.min() == pytest.approx(0, abs=2e-9)
    assert s.max() == pytest.approx(0.080, abs=2e-9)
    assert points[:, 2].max() == pytest.approx(truth.height, abs=1e-12)
    assert points[:, 2].min() == pytest.approx(0, abs=1e-12)
    across = points - ends[0] - [0, 0, truth.height / 2] - s[:, None] * along
    radius = np.linalg.norm(across, axis=1)
    np.testing.assert_allclose(radius[radius > 1e-6], 0.325e-3, atol=2e-9)


def parts(surface: Surface) -> list[FloatArray]:
    """The vertices of each connected component, in the order of the file."""
    edges = np.concatenate([surface.faces[:, [0, 1]], surface.faces[:, [1, 2]]]).T
    graph = coo_array((np.ones(edges.shape[1]), edges), shape=(len(surface.vertices),) * 2)
    label = connected_components(graph, directed=False)[1]
    return [surface.vertices[label == number] for number in dict.fromkeys(label)]


def test_the_wires_facets_lie_less_than_a_micrometre_inside_the_round() -> None:
    assert 0.325e-3 * (1 - np.cos(np.pi / 64)) < 1e-6
    wire = parts(scene("mug").object_surface())[1]
    rings = wire[:-2].reshape(121, -1, 3)
    chords = 0.5 * (rings[1:] + rings[:-1])[:, 10]  # the crest, in the middle between two rings
    assert (np.linalg.norm(chords[:, :2], axis=1) - 0.040).min() > 0.8e-3 - 1e-6
    side = 0.5 * (rings[:, 10] + rings[:, 11])  # in the middle of the facet beside the crest
    axis = 0.5 * (rings[:, 0] + rings[:, 20])  # two vertices at -60 and +60 degrees: 0.2 mm above the axis
    axis[:, :2] *= 1 - 0.2e-3 / np.linalg.norm(axis[:, :2], axis=1, keepdims=True)
    assert np.linalg.norm(side - axis, axis=1).min() > 0.4e-3 - 1e-6


def test_the_paper_s_bump_has_its_height_over_the_plane() -> None:
    bump = scene("bump_of_revolution")
    (truth,) = bump.truth
    vertices = bump.object_surface().vertices
    u = np.linalg.norm(vertices[:, :2], axis=1)
    np.testing.assert_allclose(vertices[:, 2], 1 / (1 + 15 * u**2), atol=1e-12)
    assert vertices[:, 2].max() == truth.height == 1.0
    assert bump.tip.radius == 1.0
    plane = known("bump_of_revolution")
    np.testing.assert_array_equal(plane.vertices[:, 2], 0.0)
    assert np.abs(plane.vertices[:, :2]).max() * np.sqrt(2) < u.max(), "the bump must reach past the plane's corners"


def test_the_bump_s_facets_miss_its_surface_by_less_than_half_a_millimetre() -> None:
    surface = scene("bump_of_revolution").object_surface()
    middle = surface.vertices[surface.faces].mean(axis=1)
    u = np.linalg.norm(middle[:, :2], axis=1)
    d = 1 + 15 * u**2
    assert np.abs((middle[:, 2] - 1 / d) / np.hypot(1, 30 * u / d**2)).max() < 0.5e-3


def test_the_step_stands_on_the_flat_plate() -> None:
    (truth,) = scene("step").truth
    stepped, flat = scene("step").object_surface(), known("step")
    height = np.where(stepped.vertices[:, 0] > 0.007, 1e-3, 0.0)
    off_edge = stepped.vertices[:, 0] != 0.007
    np.testing.assert_array_equal(stepped.vertices[off_edge, 2], height[off_edge])
    assert truth.height == pytest.approx(1e-3)
    np.testing.assert_allclose(np.array(truth.axis), [[0.007, -0.03, 0], [0.007, 0.03, 0]])
    np.testing.assert_array_equal(stepped.bounds[:, :2], flat.bounds[:, :2])


def test_the_mug_without_details_is_the_mug_s_model() -> None:
    """Off the details, each face of the object is a face of the model: the base explains it to the last digit."""
    plain, full = known("mug"), scene("mug").object_surface()
    corners = {tuple(np.round(np.sort(t.ravel()), 12)) for t in plain.vertices[plain.faces]}
    same = sum(tuple(np.round(np.sort(t.ravel()), 12)) in corners for t in full.vertices[full.faces])
    assert same > 0.98 * len(plain.faces)


def test_the_mug_s_details_are_where_the_truth_says() -> None:
    ridge, groove, *bumps = scene("mug").truth
    wall, wire, *caps = parts(scene("mug").object_surface())
    for truth, detail in zip((ridge, *bumps), (wire, *caps), strict=True):
        assert np.linalg.norm(detail[:, :2], axis=1).max() - 0.040 == pytest.approx(truth.height, abs=1e-9)
        apart = np.linalg.norm(detail[:, None, :] - np.array(truth.axis), axis=2).min(axis=1)
        assert truth.width is not None
        assert apart.max() < 1.6 * truth.width
    length = np.linalg.norm(np.diff(np.array(ridge.axis), axis=0), axis=1).sum()
    assert length == pytest.approx(ridge.length, rel=1e-4)
    radius = np.linalg.norm(wall[:, :2], axis=1)
    assert radius.min() - 0.040 == pytest.approx(groove.height, abs=1e-9)
    floor = wall[radius < 0.0399]
    assert (floor[:, 2].min(), floor[:, 2].max()) == pytest.approx((0.03, 0.07))
    edge = np.array(groove.axis)[0, :2] / 0.040
    across = floor[:, :2] @ np.array([-edge[1], edge[0]])
    assert np.ptp(across) * 0.040 / (0.040 - 0.25e-3) == pytest.approx(groove.width, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "genus"),
    [("bowl", 0), ("folds", 0), ("holed_plate", 1), ("vase", 1), ("double_ring", 2), ("heat_sink", 0)],
)
def test_a_body_is_closed_and_has_its_handles(name: str, genus: int) -> None:
    for surface in (scene(name).object_surface(), known(name)):
        assert not surface.open_sides.any()
        edges = len(surface.faces) * 3 // 2
        assert len(surface.vertices) - edges + len(surface.faces) == 2 - 2 * genus
