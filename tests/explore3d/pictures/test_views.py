"""From where a body is drawn: every feature is in sight in one of the views, and labelled there."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from explore3d.pictures.camera import Camera
from explore3d.pictures.object import (
    LABEL_HEIGHT,
    MOST_VIEWS,
    VIEW_HEIGHTS,
    Label,
    object_picture,
    placed,
    view_directions,
)
from explore3d.pictures.render import Body, render
from explore3d.pictures.sweep_paths import SweepPath, over_features
from explore3d.scene import examples, load_scene
from mapping import Feature, Interval, ObjectModel, Support, Surface
from mapping.base import Base

ROUND_BODY = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])  # normals that cancel


def model_of(name: str) -> ObjectModel:
    """The base of an example with its features as its author made them."""
    scene = load_scene(examples()[name].scene)
    base = Base(scene.base_surface())
    features = []
    for true in scene.truth:
        foot = base.foot(true.axis, scene.tip.radius)
        size = Interval(true.height, true.height, true.height)
        features.append(Feature(true.kind, foot.points, foot.normals, size, size, size, Support(9.0, 3), True, 1e-5))
    return ObjectModel.attach(base, features)


SIMPLER = ("bowl", "holed_plate", "l_bracket", "vase")


@pytest.mark.parametrize(
    "name", ["mug", "double_ring", *(pytest.param(each, marks=pytest.mark.slow) for each in SIMPLER)]
)
def test_every_feature_of_a_closed_body_is_labelled_in_one_of_its_views(name: str) -> None:
    model = model_of(name)
    surface = model.base.surface
    middles = surface.vertices[surface.faces].mean(axis=1)[::20]
    path = SweepPath(middles, surface.face_normals[::20], np.zeros(len(middles), dtype=bool))
    drawn = object_picture(surface, model.features, [path]).decode()
    labels = set(re.findall(r">((?:ridge|groove|bump|pit|step)-\d+)\s", drawn))
    assert labels == {each.id for each in model}
    assert 2 <= len(view_directions(ROUND_BODY, model.features, model.base.surface)) <= MOST_VIEWS


def test_a_line_that_one_view_can_show_does_not_end_at_a_bodys_rim() -> None:
    model = model_of("mug")
    directions = np.array(view_directions(ROUND_BODY, model.features, model.base.surface))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    (ridge,) = (each for each in model.features if each.kind == "ridge")  # 80 mm round a mug of 40 mm radius
    facing = directions @ ridge.normals.T
    assert len(directions) <= 3 and facing.min(axis=1).max() > 0.2


def test_a_spot_at_the_rim_of_every_view_gets_one_that_faces_it() -> None:
    """A bump 70 degrees round a cylinder from a ridge, and one opposite: two views show it at a slant only."""
    model = model_of("mug")
    directions = np.array(view_directions(ROUND_BODY, model.features, model.base.surface))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for bump in (each for each in model.features if each.kind == "bump"):
        assert (directions @ bump.normals[0]).max() > 0.5  # from so far above as the views are, 0.9 at most


def test_labels_stand_on_nothing_that_was_found_and_on_no_other_label() -> None:
    lines = np.column_stack([np.linspace(100.0, 300.0, 81), np.full(81, 150.0)])
    labels: list[Label] = []
    for x in (120.0, 150.0, 200.0, 210.0):
        labels.append(placed(np.array([x, 150.0]), 110.0, lines, labels, (400.0, 300.0)))
    assert all(each.covers(lines, 2.0) == 0 for each in labels)
    for one in labels:
        for other in (each for each in labels if each is not one):
            apart = abs(one.top - other.top) >= LABEL_HEIGHT
            assert apart or abs(one.left - other.left) >= one.wide
    # at the edge of the picture it stays inside
    edge = placed(np.array([390.0, 20.0]), 110.0, lines, [], (400.0, 300.0))
    assert edge.left + 110.0 <= 398.0 and edge.top >= 2.0


def test_a_picture_knows_the_normals_of_what_its_pixels_see() -> None:
    low, high = (np.array([[-1.0, -1, z], [1, -1, z], [1, 1, z], [-1, 1, z]]) for z in (0.0, 0.5))
    slanted = 0.4 * high * [1, 1, 2.5] + [0.0, 0.0, 0.0] + np.outer([-0.4, 0.4, 0.4, -0.4], [0.0, 0.0, 0.5])
    both = Surface(np.vstack([low, slanted]), [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    picture = render([Body(both, np.ones(3))], Camera.facing(both.vertices, np.array([0.0, 0.0, 1.0]), 200, 200))
    middle, side = (np.array(each) for each in (100, 30))
    leaning = np.array([-0.5, 0.0, 1.0]) / np.sqrt(1.25)
    np.testing.assert_allclose(picture.normals(middle[None], middle[None]), [leaning], atol=1e-12)
    np.testing.assert_allclose(picture.normals(middle[None], side[None]), [[0.0, 0.0, 1.0]], atol=1e-12)


def test_what_is_turned_down_is_lit_where_it_is_seen_from_below() -> None:
    plate = Surface([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], [[0, 1, 2], [0, 2, 3]])
    brightness = []
    for height in (VIEW_HEIGHTS[0], -VIEW_HEIGHTS[0]):
        camera = Camera.facing(plate.vertices, np.array([0.8, 0.6, height]), 200, 200)
        seen = render([Body(plate, np.full(3, 0.9))], camera).pixels
        brightness.append(float(np.median(seen[seen[:, :, 0] < 1.0])))
    assert brightness[1] == pytest.approx(brightness[0], abs=0.01) and brightness[0] > 0.75


def test_a_level_plate_is_seen_from_one_side_however_a_step_leans_it() -> None:
    plate = Surface([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], [[0, 1, 2], [0, 2, 3]])
    ways = [
        view_directions(np.array([[np.sin(lean) * np.cos(turn), np.sin(lean) * np.sin(turn), np.cos(lean)]]), (), plate)
        for lean in (0.0, 0.017)
        for turn in (0.0, 2.0, 4.0)
    ]
    np.testing.assert_allclose(np.array(ways), np.broadcast_to(ways[0], np.shape(ways)), atol=1e-12)


def test_a_sweep_is_drawn_over_the_bump_that_it_climbed_not_under_it() -> None:
    up = np.array([0.0, 0.0, 1.0])
    sizes = [Interval(each, each, each) for each in (1.0, 4.0, 0.0)]
    bump = Feature("bump", np.zeros((1, 3)), up[None], *sizes, Support(9.0, 9), True, 1e-5)
    x = np.linspace(-3.0, 3.0, 61)
    path = SweepPath(np.column_stack([x, 0.0 * x, 0.0 * x]), np.tile(up, (61, 1)), np.abs(x) < 2.0)
    (lifted,) = over_features([path], [bump])
    ellipse = np.sqrt(np.clip(1.0 - (x / 2.0) ** 2, 0.0, None))  # the body that stands for a bump
    np.testing.assert_allclose(lifted.points[:, 2], ellipse, atol=0.05)
    np.testing.assert_array_equal(lifted.points[:, :2], path.points[:, :2])
    np.testing.assert_array_equal(over_features([path], [])[0].points, path.points)
    low = replace(bump, height=Interval(1e-20, 1e-20, 1e-20))  # no ball is as small as that
    np.testing.assert_array_equal(over_features([path], [low])[0].points, path.points)


def test_a_flat_side_is_shaded_evenly_beside_a_narrow_one_round_a_sharp_edge() -> None:
    """The front of a thin bar has one brightness: the faces above and below it do not tilt its shading."""
    x = np.array([0.0, 0.02, 0.025, 0.06, 0.1])
    rails = np.concatenate(
        [np.column_stack([x, np.full(5, y), np.full(5, z)]) for y in (0.0, 4e-3) for z in (0.0, 0.02)]
    )
    faces = []
    for low, high in ((0, 5), (5, 15), (15, 10), (10, 0)):  # front, top, back, bottom
        for i in range(4):
            faces += [[low + i, low + i + 1, high + i + 1], [low + i, high + i + 1, high + i]]
    surface = Surface(rails, np.array(faces))
    camera = Camera.facing(surface.vertices, np.array([0.0, -1.0, 0.3]), 400, 200)
    picture = render([Body(surface, np.ones(3))], camera)
    front = (picture.seen >= 0) & (picture.seen < 8)
    assert front.sum() > 1000
    shades = picture.pixels[front].mean(axis=1)
    assert np.quantile(shades, 0.9) - np.quantile(shades, 0.1) < 0.01  # outlines are darker
