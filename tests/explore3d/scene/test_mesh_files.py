"""Mesh files of every format become the same Surface; broken ones an error in one line that names the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from explore3d.errors import MeshFileError, SceneError, UnitError
from explore3d.scene.begin import begin_scene
from explore3d.scene.mesh_files import FORMATS, load_mesh, mesh_text
from mapping import Surface

TRIANGLE = "OFF\n3 1 0\n0 0 0\n10 0 0\n0 20 0\n3 0 1 2\n"
PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(256))
PLY = "ply\nformat ascii 1.0\nelement vertex {n}\nproperty double x\nproperty double y\nproperty double z\n"


def written(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_coordinates_are_scaled_by_the_files_unit(tmp_path: Path) -> None:
    surface = load_mesh(written(tmp_path, "a.off", TRIANGLE), "mm")
    np.testing.assert_array_equal(surface.vertices, [[0, 0, 0], [0.01, 0, 0], [0, 0.02, 0]])
    np.testing.assert_array_equal(surface.faces, [[0, 1, 2]])


@pytest.mark.parametrize("kind", [kind for kind in FORMATS if kind not in ("gltf",)])
def test_every_format_gives_the_same_box(tmp_path: Path, kind: str) -> None:
    import trimesh

    box = trimesh.creation.box((1.0, 2.0, 3.0))
    surface = load_mesh(written(tmp_path, f"box.{kind}", box.export(file_type=kind)))
    assert len(surface.vertices) == 8
    assert len(surface.faces) == 12
    np.testing.assert_allclose(surface.bounds, [[-0.5, -1, -1.5], [0.5, 1, 1.5]])
    assert surface.face_areas.sum() == pytest.approx(22.0)


def test_a_file_of_ours_keeps_all_its_digits_and_its_order() -> None:
    path = Path(__file__).parents[3] / "assets" / "meshes" / "flat.ply"
    surface = load_mesh(path)
    assert surface.vertices[0].tolist() == [-0.05, -0.03, 0.0]
    assert surface.faces[0].tolist() == [0, 25, 26]


def test_nothing_is_merged_or_dropped(tmp_path: Path) -> None:
    text = "OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 1 0\n3 0 1 2\n3 0 1 1\n"
    surface = load_mesh(written(tmp_path, "odd.off", text))
    assert (len(surface.vertices), len(surface.faces)) == (4, 2)


def test_larger_polygons_are_split(tmp_path: Path) -> None:
    text = "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
    assert load_mesh(written(tmp_path, "quad.off", text)).face_areas.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("empty.off", "OFF\n0 0 0\n", "the mesh is empty"),
        ("none.obj", "", "the mesh is empty"),
        ("none.ply", "", "not a readable PLY mesh"),
        ("points.ply", PLY.format(n=1) + "end_header\n0 0 0\n", "the mesh is empty"),
        ("nan.off", TRIANGLE.replace("10 0 0", "nan 0 0"), "must be finite; 1 of 3 are not, the first is vertex 1"),
        ("inf.off", TRIANGLE.replace("10 0 0", "inf 0 0"), "must be finite"),
        ("index.off", TRIANGLE.replace("3 0 1 2", "3 0 1 7"), "face index outside"),
        ("cut.off", TRIANGLE[:20], "not a readable OFF mesh"),
        ("picture.ply", PNG, "not a readable PLY mesh"),
        ("picture.off", PNG, "not a readable OFF mesh"),
        ("picture.glb", PNG, "not a readable GLB mesh"),
        ("picture.stl", PNG, "the mesh is empty"),
        ("picture.png", PNG, "possible: glb, gltf, obj, off, ply, stl"),
    ],
)
def test_a_broken_file_is_named_in_one_line(tmp_path: Path, name: str, content: str | bytes, message: str) -> None:
    path = written(tmp_path, name, content)
    with pytest.raises(MeshFileError) as caught:
        load_mesh(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_a_folder_and_a_wrong_unit_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(MeshFileError, match="no such mesh file"):
        load_mesh(tmp_path / "absent.ply")
    with pytest.raises(MeshFileError, match="a folder, not a mesh file"):
        load_mesh(tmp_path)
    with pytest.raises(UnitError, match="unknown unit of length 'mmm'"):
        load_mesh(written(tmp_path, "a.off", TRIANGLE), "mmm")


def test_a_closed_solid_turned_inside_out_is_named_and_a_solid_with_a_hollow_is_not(tmp_path: Path) -> None:
    import trimesh

    outer, inner = trimesh.creation.box((60, 40, 20)), trimesh.creation.box((30, 20, 10))
    inner.invert()
    hollow = trimesh.util.concatenate([outer, inner])
    load_mesh(written(tmp_path, "hollow.stl", hollow.export(file_type="stl")), "mm")
    outer.invert()
    with pytest.raises(MeshFileError, match="closed and its faces look inwards"):
        load_mesh(written(tmp_path, "inverted.stl", outer.export(file_type="stl")), "mm")
    lid_off = trimesh.Trimesh(outer.vertices, outer.faces[2:], process=False)
    load_mesh(written(tmp_path, "bin.ply", lid_off.export(file_type="ply")), "mm")  # a bin, felt from inside


def test_a_wrong_unit_a_hole_and_doubled_faces_are_seen_in_one_line(tmp_path: Path) -> None:
    import trimesh

    box = trimesh.creation.box((60, 40, 20))
    path = written(tmp_path, "box.stl", box.export(file_type="stl"))
    assert mesh_text(load_mesh(path, "mm")) == "60 mm x 40 mm x 20 mm, 12 faces, closed"
    assert mesh_text(load_mesh(path, "m")).startswith("60 m x 40 m x 20 m")
    apart = next(k for k in range(1, 12) if not set(box.faces[k]) & set(box.faces[0]))
    holed = Surface(box.vertices, np.delete(box.faces, [0, apart], axis=0))
    assert mesh_text(holed).endswith("10 faces, open, with 2 borders")
    doubled = Surface(box.vertices, np.concatenate([box.faces, box.faces[:1]]))
    assert mesh_text(doubled).endswith("13 faces, closed; 3 edges with more than two faces")


def test_a_tip_out_of_proportion_is_told_in_fitting_units_and_the_units_are_doubted(tmp_path: Path) -> None:
    import trimesh

    box = trimesh.creation.box((0.06, 0.04, 0.02))
    path = written(tmp_path, "metres.ply", box.export(file_type="ply"))
    with pytest.raises(SceneError, match=r"tip\.radius: 5 mm for a body of 60 µm .* are the units of both the right"):
        begin_scene(tmp_path / "mine", path, "mm", "5 mm")
