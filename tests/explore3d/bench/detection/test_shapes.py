"""Courses, letters and neighbours: the truth of what the ball feels, and what is judged of what is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from explore3d.bench.detection import bench_shapes, judged, shape_lines, shapes, write_shapes
from explore3d.bench.scenes import FELT_SHAPES, FIRST_BUILT_WITH, SECTION_TIP, FeltShape, felt_shape
from explore3d.bench.scenes.shapes import SHAPE_NOISE, WIRE_RADIUS
from mapping import Details, Feature, FloatArray, Interval, Support
from mapping.geometry.mesh import distances

BUILT = FIRST_BUILT_WITH + 1  # rows in one direction


def told(felt: FeltShape, axis: FloatArray, kind: str = "ridge", size: float = 1.0, **more: object) -> Feature:
    """A feature of the true sizes, times a size, along an axis."""
    height, width = size * felt.height, size * felt.widths[1]
    nowhere = Interval(0.0, 0.0, 0.0)
    feature = Feature(
        kind, axis, np.tile([0.0, 0.0, 1.0], (len(axis), 1)), Interval(height, 0.99 * height, 1.01 * height),
        Interval(width, 0.9 * width, 1.1 * width), nowhere, Support(100.0, 5), True, 1e-5,
    )  # fmt: skip
    return replace(feature, **more)  # type: ignore[arg-type]


@pytest.mark.slow
def test_sets_for_building_and_for_reporting_have_no_seed_and_no_size_in_common() -> None:
    reported, built = felt_shape("S 30 mm", 1), felt_shape("S 30 mm", BUILT)
    assert reported.height == 2.0 * WIRE_RADIUS != built.height
    assert len(np.unique(reported.trace.sweep)) == 20 and len(np.unique(felt_shape("L", 0).trace.sweep)) == 40


@pytest.mark.parametrize(
    "name", ["on a cone", *(pytest.param(each, marks=pytest.mark.slow) for each in ("on a saddle", "in a fillet"))]
)
def test_no_centre_is_nearer_to_wire_or_body_than_it_can_be_and_each_touches_one(name: str) -> None:
    felt, shape = felt_shape(name, 1), FELT_SHAPES[name]
    rng = np.random.default_rng(0)
    some = rng.choice(np.flatnonzero(np.abs(felt.trace.centers[:, :2]).max(axis=1) < 14e-3), 100)
    centers = felt.trace.centers[some]
    grid = np.arange(-26e-3, 26e-3, 0.25e-3)
    x, y = (each.ravel() for each in np.meshgrid(grid, grid))
    body = np.column_stack([x, y, shape.above(x, y, 0.0)])
    to_body = np.linalg.norm(centers[:, None] - body[None], axis=2).min(axis=1) - SECTION_TIP
    normal = np.array([0.0, 0.0, 1.0])  # the wire's axis lies a radius above its course, within its slope
    axis = felt.courses[0] + WIRE_RADIUS * normal
    to_wire = distances(centers, axis) - SECTION_TIP - WIRE_RADIUS
    gap = np.minimum(to_body, to_wire)
    # noise, the grid's (0.18 mm)^2 / 2r, and by how much the wire's axis leans
    assert np.abs(gap).max() < 5.0 * SHAPE_NOISE
    assert abs(float(np.median(gap))) < 0.02e-3


def test_the_edge_of_a_body_is_rolled_about() -> None:
    above = FELT_SHAPES["beside an edge"].above
    x = np.array([-10e-3, 0.0, 1e-3, 10e-3])
    angle, r = np.pi / 9.0, SECTION_TIP
    flank = r / np.cos(angle) - 10e-3 * np.tan(angle)
    np.testing.assert_allclose(above(x, 0.0 * x, r), [flank, r, np.sqrt(r**2 - 1e-6), flank], rtol=1e-12)


def test_a_course_told_whole_is_right_and_in_pieces_miscounted() -> None:
    felt = felt_shape("S 30 mm", BUILT)
    (course,) = felt.courses
    whole, half = told(felt, course[::20]), len(course) // 2
    assert judged(felt, [whole])["judged"] == "right"
    assert judged(felt, [told(felt, course[:half:20]), told(felt, course[half::20])])["judged"] == "miscounted"
    assert judged(felt, [told(felt, course[:half:20])])["judged"] == "off course"
    across = np.cross(course[-1] - course[0], [0.0, 0.0, 1.0])
    aside = 3e-3 * across / np.linalg.norm(across)
    assert judged(felt, [told(felt, course[::20] + aside)])["judged"] == "invented"
    assert judged(felt, [whole, told(felt, course[half : half + 1] + aside, "bump")])["judged"] == "invented"
    assert judged(felt, [])["judged"] == "missed"


def test_a_letter_may_be_cut_into_strokes_where_they_meet_or_bend() -> None:
    felt = felt_shape("A", BUILT)
    legs, bar = felt.courses
    top = len(legs) // 2
    strokes = [legs[: top + 1 : 20], legs[top::20], bar[::20]]
    assert judged(felt, [told(felt, stroke) for stroke in strokes])["judged"] == "right"
    assert judged(felt, [told(felt, strokes[0]), told(felt, strokes[1])])["judged"] == "off course"
    assert (
        judged(felt, [told(felt, stroke) for stroke in strokes[:2]] + [told(felt, bar[50:51], "bump")])["named"]
        is False
    )


def test_sizes_hold_or_are_bounds_or_are_remarked_upon() -> None:
    felt = felt_shape("S 30 mm", BUILT)
    axis = felt.courses[0][::20]
    wide = told(felt, axis, width=Interval(5e-3, 4e-3, 6e-3))
    record = judged(felt, [wide])
    assert record["judged"] == "wrong size" and record["sizes"][0]["off by a factor"]
    remarked = judged(felt, [replace(wide, details=Details(misfit="no ridge fits"))])
    assert remarked["judged"] == "flagged" and not remarked["sizes"][0]["off by a factor"]
    at_most = judged(felt, [told(felt, axis, width=Interval(3e-3, 0.0, 6e-3, censored=True))])
    assert at_most["judged"] == "right"


def test_a_ring_has_no_ends_and_an_edge_of_the_body_is_no_detail() -> None:
    ring = felt_shape("O", BUILT)
    axis = ring.courses[0][::20]
    closed = np.vstack([axis[:-1], axis[:1]])
    assert judged(ring, [told(ring, closed)])["judged"] == "right"
    assert judged(ring, [told(ring, axis[:-3])])["judged"] == "miscounted"
    beside = felt_shape("beside an edge", BUILT)
    edge = told(beside, np.array([[0.0, -0.02, 0.0], [0.0, 0.02, 0.0]]), "edge")
    assert judged(beside, [told(beside, beside.courses[0], "bump"), edge])["judged"] == "right"


def test_the_bench_goes_on_where_it_stopped_and_draws_what_was_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []

    def one(felt: FeltShape) -> dict[str, object]:
        done.append(felt.shape.kind)
        return {"cpu": 1.5} | judged(felt, [told(felt, course[::20]) for course in felt.courses])

    monkeypatch.setattr(shapes, "shape_trial", one)
    store = tmp_path / "shapes.jsonl"
    list(bench_shapes(["L"], range(BUILT, BUILT + 1), store))
    records = list(bench_shapes(["L", "beside an edge"], range(BUILT, BUILT + 1), store))
    assert done == ["ridge", "bump"]
    lines = list(shape_lines(records))
    assert lines[1].startswith("L,1,100,1,0,0,0,0,0,0,0,100,100,100,0,100,0,1.5")
    assert lines[-1].startswith("all,2,")
    assert [path.name for path in write_shapes(records, tmp_path)] == ["shapes.csv", "shapes.png"]
    drawn = imread(tmp_path / "shapes.png")[..., :3].min(axis=2) < 0.99
    half = drawn.shape[1] // 5
    assert drawn[:, :half].mean() > 0.01 and drawn[:, half : 2 * half].mean() > 0.001  # a letter, and a ball


@pytest.mark.slow
def test_a_wire_in_a_fillet_and_a_ball_beside_an_edge_are_told_without_a_mesh() -> None:
    for name in ("in a fillet", "beside an edge"):
        record = shapes.shape_trial(felt_shape(name, BUILT))
        assert record["judged"] in ("right", "flagged"), record
