"""The page's own view: what it is given is what was found, and its script puts things where they are."""

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reported_wire import BASE, ridge

from explore3d.pictures.camera import Camera
from explore3d.pictures.sweep_paths import SweepPath
from explore3d.report import view3d
from explore3d.report.view3d import lighter, object_view, profile_view
from mapping.model.object_model import ObjectModel
from mapping.surface import Surface
from mapping.trace import Trace

SCRIPTS = Path(view3d.__file__).parent
UP = np.array([0.0, 0.0, 1.0])


def sweep(y: float) -> SweepPath:
    x = np.linspace(-0.03, 0.03, 7)
    points = np.column_stack([x, np.full(7, y), np.zeros(7)])
    return SweepPath(points, np.tile(UP, (7, 1)), np.array([False, False, True, True, True, False, False]))


def data_of(html: str) -> dict:
    return json.loads(re.search(r'id="view-data">(.*?)</script>', html, re.S)[1])


def places(part: dict) -> np.ndarray:
    shares = np.frombuffer(base64.b64decode(part["points"]), dtype="<u2").reshape(-1, 3)
    return part["low"] + shares / 65535 * part["span"]


def test_the_view_holds_the_base_the_features_and_every_sweep() -> None:
    features = ObjectModel.attach(BASE, (ridge(),)).features
    data = data_of(object_view(BASE.surface, features, [sweep(0.01), sweep(0.02)]))
    base, feature = data["meshes"]
    np.testing.assert_allclose(places(base), BASE.surface.vertices, atol=2e-5 * BASE.surface.size)
    assert (base["layer"], feature["layer"], feature["id"]) == ("base", "features", "ridge-1")
    assert feature["text"][0] == "ridge-1" and feature["text"][1].startswith("height 0.65")
    sweeps, noticed = data["lines"]
    assert sweeps["starts"] == [0, 7] and noticed["starts"] == [0, 3]
    np.testing.assert_allclose(places(noticed)[:3, 0], np.linspace(-0.03, 0.03, 7)[2:5], atol=1e-6)


def test_no_text_of_a_record_can_end_the_data() -> None:
    from explore3d.report.markup import data_script

    html = data_script("d", {"text": "</script><script>alert(1)"})
    assert html.count("</script>") == 1
    assert json.loads(re.search(r">(.*)</script>", html)[1])["text"] == "</script><script>alert(1)"


def test_a_heavy_mesh_is_made_light_and_keeps_its_shape() -> None:
    n = 120
    u, v = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    points = np.column_stack([u.ravel(), v.ravel(), 0.2 * np.sin(4 * u.ravel())])
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    quads = np.stack([corner, corner + n, corner + n + 1, corner + 1], axis=1)
    mesh = Surface(points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    light = lighter(mesh, 4000)
    assert 1000 < len(light.faces) <= 4000
    assert np.abs(light.vertices[:, 2] - 0.2 * np.sin(4 * light.vertices[:, 0])).max() < 2e-3
    assert light.face_areas.sum() == pytest.approx(mesh.face_areas.sum(), rel=0.05)
    assert lighter(mesh) is mesh


node = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")


def told(script: str, call: str) -> object:
    """What a script's own functions answer, run by node."""
    code = f"const v = require({json.dumps(str(SCRIPTS / script))}); console.log(JSON.stringify({call}))"
    return json.loads(subprocess.run(["node", "-e", code], capture_output=True, text=True, check=True).stdout)


@node
def test_the_view_sees_points_where_the_cameras_projection_does() -> None:
    target, distance, yaw, pitch = [0.1, -0.2, 0.05], 0.7, 0.8, 0.4
    camera = json.dumps({"target": target, "distance": distance, "size": 0.3, "yaw": yaw, "pitch": pitch})
    points = np.random.default_rng(3).normal(size=(6, 3)) * 0.05 + target
    seen = told("viewer.js", f"{json.dumps(points.tolist())}.map(p => v.seenAt(p, v.matrix({camera}, 1.6), 640, 400))")
    back = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    same = Camera(target + distance * back, np.array(target), UP, 640, 400)  # its field of view is 0.5 rad, too
    np.testing.assert_allclose(seen, same.project(points)[0] + 0.5, atol=1e-3)


@node
def test_lines_are_not_joined_from_one_sweep_to_the_next() -> None:
    found = told("viewer.js", "[...v.pieces(Float32Array.from([0,0,0, 1,0,0, 5,5,5, 6,5,5, 7,5,5]), [0, 2])]")
    np.testing.assert_array_equal(
        np.reshape(found, (-1, 2, 3)), [[[0, 0, 0], [1, 0, 0]], [[5, 5, 5], [6, 5, 5]], [[6, 5, 5], [7, 5, 5]]]
    )


@node
def test_the_whole_object_is_in_the_first_view() -> None:
    data = {"box": [[-0.1, -0.06, 0.0], [0.1, 0.06, 0.09]], "eye": [0.6, -0.6, 0.5]}
    corners = [[x, y, z] for x in (-0.1, 0.1) for y in (-0.06, 0.06) for z in (0.0, 0.09)]
    for width, height in ((1100, 560), (360, 380)):
        call = f"v.matrix(v.overview({json.dumps(data)}, {width / height}), {width / height})"
        seen = np.array(told("viewer.js", f"{json.dumps(corners)}.map(p => v.seenAt(p, {call}, {width}, {height}))"))
        assert (seen > 0).all() and (seen < [width, height]).all()
        assert (np.ptp(seen, axis=0) / [width, height]).max() > 0.5


def test_a_line_across_a_profile_is_marked_where_the_profile_meets_it_however_it_lies() -> None:
    x = np.linspace(-0.03, 0.03, 601)
    centers = np.column_stack([x, np.zeros_like(x), np.full_like(x, 0.01)])
    trace = Trace(x - x[0], centers, np.zeros(len(x), dtype=np.int64), 0.01)
    slanted = replace(ridge(), axis=np.array([[0.016, -0.001, 0.0], [0.014, 0.001, 0.0]]), normals=np.array([UP, UP]))
    (marked,) = data_of(str(profile_view(trace, BASE, [slanted])))["features"]
    assert marked["x"] == pytest.approx(15.0)


@node
def test_a_profiles_view_finds_its_places_by_halving() -> None:
    x = [0.0, 0.1, 0.1, 0.4, 0.9]
    for value in (-1.0, 0.1, 0.2, 0.9, 2.0):
        assert told("profile.js", f"v.firstFrom({x}, {value})") == int(np.searchsorted(x, value))
    assert [word for _, word in told("profile.js", "v.ticks(-0.31, 0.42, 5)")] == ["-0.2", "0.0", "0.2", "0.4"]


@node
def test_the_pointer_looks_where_a_point_is_seen() -> None:
    camera = json.dumps({"target": [0.1, -0.2, 0.05], "distance": 0.7, "size": 0.3, "yaw": 0.8, "pitch": 0.4})
    point = np.array([0.12, -0.17, 0.08])
    column, row = told("viewer.js", f"v.seenAt({point.tolist()}, v.matrix({camera}, 1.6), 640, 400)")
    origin, way = map(np.array, told("viewer.js", f"v.ray({camera}, 1.6, {column / 640}, {row / 400})"))
    along = (point - origin) @ way / (way @ way)
    np.testing.assert_allclose(origin + along * way, point, atol=1e-8)


@node
def test_the_pointer_meets_the_nearest_face_and_feels_what_is_there() -> None:
    points = [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1]
    call = f"v.meets({points}, [0, 1, 2, 3, 4, 5], [0.2, 0.2, 5], [0, 0, -2])"
    np.testing.assert_allclose(told("touch.js", call), [0.2, 0.2, 1.0])
    assert told("touch.js", f"v.meets({points}, [0, 1, 2], [0.9, 0.9, 5], [0, 0, -1])") is None
    features = json.dumps(
        [{"axis": [0, -1, 0, 0, 1, 0], "height": 0.2, "half": 0.5}, {"axis": [3, 0, 0], "height": -0.1, "half": 0.4}]
    )
    heights = told("touch.js", f"[...v.crossed([-1, 0, 0], [3, 0, 0], {features}, 9)]")
    np.testing.assert_allclose(heights, [0, 0, 0.2, 0, 0, 0, 0, 0, -0.1], atol=1e-7)
    loud = told("touch.js", "[...v.sound([0, 0, 1, 1], 10, 1e9)]")
    np.testing.assert_allclose(loud, [0, 0, 1e-8, 0], atol=1e-12)


def test_the_view_says_what_the_pointer_feels_only_if_it_knows_the_tip() -> None:
    features = ObjectModel.attach(BASE, (ridge(),)).features
    silent, felt = (object_view(BASE.surface, features, [sweep(0.01)], tip) for tip in (None, 10e-3))
    assert data_of(silent)["touch"] == [] and "touch.js" not in silent and 'class="feel"' not in silent
    (touch,) = data_of(felt)["touch"]
    assert touch["height"] == pytest.approx(0.65e-3, rel=0.1) and touch["half"] > 1e-3
    assert 'class="feel"' in felt and len(felt) - len(silent) < 9_000


@node
@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("ridge-1, 0.650 mm (0.634 to 0.666 mm)", "µm", "ridge-1, 650 µm (634 to 666 µm)"),
        ("It is 0.650 mm (0.634 to 0.666) high", "µm", "It is 650 µm (634 to 666) high"),
        ("12.50, -3.00, 4.25 mm", "in", "0.4921, -0.1181, 0.1673 in"),
        ("at 30 mm/s over 5 mm² and 1.2 m", "mm", "at 30 mm/s over 5 mm² and 1200 mm"),
        ("−0.25 mm ± 12 µm; +0.1 µm", "mm", "-0.25 mm ± 0.012 mm; +0.0001 mm"),
        ("1,362,701 samples of 2 features", "mm", "1,362,701 samples of 2 features"),
        ("at most 0.254 mm", "mil", "at most 10.00 mil"),
        ("0.65 mm", "", "0.65 mm"),
    ],
)
def test_lengths_are_written_in_the_unit_that_the_reader_chooses(text: str, unit: str, expected: str) -> None:
    assert told("units.js", f"v.inUnit({json.dumps(text)}, {json.dumps(unit)})") == expected


@node
def test_a_range_without_a_unit_follows_the_value_beside_it() -> None:
    assert told("units.js", 'v.inUnit("0.6439 to 0.6538", "µm", "mm")') == "643.9 to 653.8"
