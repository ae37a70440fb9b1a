"""The annotated model keeps every value on its way to disk and back, and refuses what it cannot keep."""

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mapping.base.anchor import tangent_frame
from mapping.base.base import Base
from mapping.errors import ModelError
from mapping.feature import Feature, Interval, Support
from mapping.model.object_model import LeftOut, ObjectModel
from mapping.posterior import Posterior
from mapping.surface import Surface

SCHEMA_FILE = Path(__file__).parents[3] / "docs" / "model.schema.json"


def plate(far: float = 0.0) -> Base:
    corners = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.06, 0], [0, 0.06, 0]]) + far
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]), "plane", {"rms": 1e-5})


def ridge(far: float = 0.0) -> Feature:
    rng = np.random.default_rng(3)
    axis = np.array([[0.02, 0.03, 0], [0.05, 0.031, 0], [0.08, 0.03, 0]]) + far
    draws = rng.normal([6.5e-4, 0.06], [1e-5, 2e-4], (200, 2))
    posterior = Posterior(("height", "length"), ("m", "m"), draws, float("nan"), 0.4, "converged", "enough", 0.2, 150.0)
    return Feature(
        "ridge",
        axis,
        np.tile([0.0, 0, 1], (3, 1)),
        Interval.from_draws(draws[:, 0]),
        Interval(6.4e-4, 6.0e-4, 7.0e-4),
        Interval(0.06, 0.0595, float("nan"), censored=True),
        Support(42.0, 17, (3,), None),
        True,
        2.5e-5,
        posterior,
        notes=("leaves the explored region",),
        extra={"chi2": 1.1},
    )


def bump(far: float = 0.0) -> Feature:
    point = Interval(0.0, 0.0, 0.0)
    size = Interval.normal(3e-4, 1e-5)
    return Feature(
        "bump",
        np.array([[0.03, 0.01, 0.0]]) + far,
        np.array([[0.0, 0, 1]]),
        size,
        size,
        point,
        Support(9.0, 3, (3,), 4.5),
        False,
        1e-4,
    )


def model(far: float = 0.0) -> ObjectModel:
    return ObjectModel.attach(
        plate(far),
        [ridge(far), bump(far), bump(far)],
        left_out=(LeftOut("algorithms 1 and 2", "the log has no contact normals"),),
        timings={"detect": 1.25},
        provenance={"tip_radius": 0.01, "scene": {"title": "wire"}, "seed": np.int64(4)},
        reach=np.array([0.0, 1, 2, 2]),
        below=np.array([1e-4, 2e-4, np.inf, 3e-4]),
        above=np.array([0.0, 1e-6, np.inf, 0.0]),
        sigma=np.array([1e-4, 2e-4, np.nan, 3e-4]),
    )


def test_features_get_names_by_kind_in_their_order() -> None:
    assert [feature.id for feature in model().features] == ["ridge-1", "bump-1", "bump-2"]


def test_a_name_is_in_a_model_that_answers_to_it() -> None:
    known = model()
    assert all(each.id in known and each in known for each in known) and len(known) > 0
    assert "ridge-9" not in known and 1 not in known


def test_the_anchor_says_where_on_the_mesh_the_middle_of_the_axis_lies() -> None:
    where = model().features[0].anchor
    assert where is not None
    surface = plate().surface
    rebuilt = where.barycentric @ surface.vertices[surface.faces[where.face]]
    np.testing.assert_allclose(rebuilt, where.position, atol=1e-15)
    np.testing.assert_allclose(where.position, [0.05, 0.031, 0.0], atol=2e-5)
    np.testing.assert_allclose(where.frame @ where.frame.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(where.frame) == pytest.approx(1.0)
    np.testing.assert_allclose(where.frame[2], [0, 0, 1], atol=1e-14)
    assert where.frame[0, 0] > 0.99


def test_a_wished_tangent_along_the_normal_still_gives_a_frame() -> None:
    frame = tangent_frame(np.array([0.0, 1.0, 0.0]), np.array([0.0, 5.0, 0.0]))
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)


def assert_same(first: ObjectModel, second: ObjectModel) -> None:
    np.testing.assert_array_equal(first.base.surface.vertices, second.base.surface.vertices)
    np.testing.assert_array_equal(first.base.surface.faces, second.base.surface.faces)
    assert (first.base.kind, first.base.parameters) == (second.base.kind, second.base.parameters)
    assert (first.left_out, first.timings) == (second.left_out, second.timings)
    assert first.document() == second.document()
    for one, other in zip(first.features, second.features, strict=True):
        np.testing.assert_array_equal(one.axis, other.axis)
        if one.posterior is not None:
            assert other.posterior is not None
            np.testing.assert_array_equal(one.posterior.samples, other.posterior.samples)
    np.testing.assert_array_equal(first.reach, second.reach)
    np.testing.assert_array_equal(first.sigma, second.sigma)
    np.testing.assert_array_equal(first.below, second.below)
    np.testing.assert_array_equal(first.above, second.above)


def test_load_returns_what_save_was_given(tmp_path: Path) -> None:
    written = model().save(tmp_path / "out")
    assert_same(model(), ObjectModel.load(written))
    assert_same(model(), ObjectModel.load(tmp_path / "out"))


def test_saving_twice_writes_the_same_bytes_and_leaves_no_drafts(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        model().save(tmp_path / folder)
    names = sorted(each.name for each in (tmp_path / "a").iterdir())
    assert names == ["model.glb", "model.json", "model.npz"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name


def test_the_document_follows_the_published_schema(tmp_path: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads(SCHEMA_FILE.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    document = json.loads(model().save(tmp_path).read_text())
    jsonschema.validate(document, schema, cls=jsonschema.Draft202012Validator)
    del document["features"][0]["anchor"]["face"]
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(document, schema, cls=jsonschema.Draft202012Validator)


def test_the_document_has_the_fields_that_programs_rely_on(tmp_path: Path) -> None:
    document = json.loads(model().save(tmp_path).read_text())
    assert (document["schema"], document["units"]) == ("explore3d/model/1", "m")
    first = document["features"][0]
    assert first["length"] == {"median": 0.06, "low": 0.0595, "high": None, "censored": True}
    assert first["posterior"]["tau"] is None
    assert np.shape(first["axis"]) == (3, 3) and np.shape(first["anchor"]["frame"]) == (3, 3)
    assert document["left_out"][0]["stage"] == "algorithms 1 and 2"


@pytest.mark.parametrize("far", [0.0, 1e6])
def test_the_glb_names_each_feature_and_keeps_its_place(tmp_path: Path, far: float) -> None:
    import trimesh

    model(far).save(tmp_path)
    scene = trimesh.load(tmp_path / "model.glb", process=False)
    assert set(scene.graph.nodes_geometry) == {"base", "ridge-1", "bump-1", "bump-2"}
    turned, _ = scene.graph["object"]  # the object's z is glTF's y, which viewers have upwards
    np.testing.assert_array_equal(turned[:3, :3], [[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    corners = scene.bounds @ turned[:3, :3]
    np.testing.assert_allclose(corners.min(axis=0)[:2], [far, far], atol=2e-9, rtol=2e-16)
    mesh = scene.geometry["base"]
    np.testing.assert_array_equal(mesh.faces, model().base.surface.faces)
    np.testing.assert_array_equal(mesh.vertex_attributes["_REACH"].ravel(), [0, 1, 2, 2])
    np.testing.assert_array_equal(
        mesh.vertex_attributes["_SIGMA"].ravel(), np.array([1e-4, 2e-4, -1, 3e-4], dtype=np.float32)
    )
    for key, known in (("_BELOW", [1e-4, 2e-4, -1, 3e-4]), ("_ABOVE", [0, 1e-6, -1, 0])):
        np.testing.assert_array_equal(mesh.vertex_attributes[key].ravel(), np.array(known, dtype=np.float32))
    _, name = scene.graph["ridge-1"]
    tube = scene.geometry[name]
    assert tube.is_watertight and tube.volume > 0
    record = scene.graph.transforms.edge_data[("object", "ridge-1")]["metadata"]
    assert record["height"] == model().document()["features"][0]["height"]


def test_the_glb_is_laid_out_as_the_standard_says(tmp_path: Path) -> None:
    deviation = np.array([0.0, 1e-4, -2e-4, 5e-5])
    replace(model(), deviation=deviation).save(tmp_path)
    content = (tmp_path / "model.glb").read_bytes()
    magic, version, length, size, kind = struct.unpack("<4sII I4s", content[:20])
    assert (magic, version, length, kind) == (b"glTF", 2, len(content), b"JSON") and size % 4 == 0
    tree, rest = json.loads(content[20 : 20 + size]), content[20 + size :]
    assert struct.unpack("<I4s", rest[:8]) == (tree["buffers"][0]["byteLength"], b"BIN\0")
    kinds = {5121: np.uint8, 5125: np.uint32, 5126: np.float32}
    for accessor in tree["accessors"]:
        view = tree["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        values = np.frombuffer(rest[8:][view["byteOffset"] :][: view["byteLength"]], kinds[accessor["componentType"]])
        rows = values.reshape(accessor["count"], -1)
        assert rows.shape[1] == {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        assert (accessor["min"], accessor["max"]) == (rows.min(axis=0).tolist(), rows.max(axis=0).tolist())
    attributes = tree["meshes"][0]["primitives"][0]["attributes"]
    colours = tree["accessors"][attributes["COLOR_0"]]
    assert "_DEVIATION" in attributes and (colours["type"], colours["normalized"]) == ("VEC4", True)


def test_features_without_names_are_not_saved(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="ids of their own"):
        ObjectModel(plate(), (ridge(),)).save(tmp_path / "out")
    twice = replace(ridge(), id="a")
    with pytest.raises(ModelError, match="'a' used 2 times"):
        ObjectModel(plate(), (twice, twice)).save(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_json_cannot_hold_is_named(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"provenance\.when.*complex"):
        ObjectModel(plate(), provenance={"when": 1j}).save(tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.update(schema="explore3d/model/9"), "expected schema 'explore3d/model/1'"),
        (lambda d: d.pop("base"), "'base' is missing"),
        (lambda d: d["features"][0].pop("height"), "feature ridge-1: field 'height' is missing"),
        (lambda d: d["features"][0].update(kind="hill"), "unknown kind 'hill'"),
        (lambda d: d["features"][0]["posterior"].update(draws=7), "draws have shape"),
        (lambda d: d.update(left_out=[{"step": "x"}]), "step"),
    ],
)
def test_a_damaged_model_is_refused_by_name(tmp_path: Path, change: object, message: str) -> None:
    file = model().save(tmp_path)
    document = json.loads(file.read_text())
    change(document)  # type: ignore[operator]
    file.write_text(json.dumps(document))
    with pytest.raises(ModelError, match=message):
        ObjectModel.load(file)


def test_a_missing_or_torn_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"not a readable model: No such file or directory$"):
        ObjectModel.load(tmp_path)
    model().save(tmp_path)
    (tmp_path / "model.npz").write_bytes(b"PK torn")
    with pytest.raises(ModelError, match=r"model\.npz"):
        ObjectModel.load(tmp_path)
