"""Surveys: level sets, spacing, order and coverage, against what is known of planes, cylinders and spheres."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hw.move import Move
from mapping.base.base import Base
from mapping.detection.coverage import coverage, face_samples
from mapping.surface import Surface
from mapping.trace import Trace
from planners.drive import dry_run
from planners.errors import PlannerError
from planners.paths.isolines import isolines
from planners.survey.charts import crease_charts
from planners.survey.level_field import level_field
from planners.survey.survey import Survey

R = 0.01
EMPTY = Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), R)


def plate(x: float = 0.2, y: float = 0.15, parts: int = 4) -> Surface:
    u, v = np.meshgrid(np.linspace(0, x, parts + 1), np.linspace(0, y, parts + 1), indexing="ij")
    vertices = np.column_stack([u.ravel(), v.ravel(), np.zeros(u.size)])
    i, j = (k.ravel() for k in np.meshgrid(range(parts), range(parts), indexing="ij"))
    a = i * (parts + 1) + j
    b, d = a + parts + 1, a + 1
    return Surface(vertices, np.concatenate([np.column_stack([a, b, b + 1]), np.column_stack([a, b + 1, d])]))


def cylinder(radius: float = 0.03, height: float = 0.06, around: int = 96) -> Surface:
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(around)])
    vertices = np.concatenate([ring, ring + np.array([0, 0, height])])
    a = np.arange(around)
    b = (a + 1) % around
    return Surface(
        vertices, np.concatenate([np.column_stack([a, b, b + around]), np.column_stack([a, b + around, a + around])])
    )


def box(size: float = 0.05) -> Surface:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float) * size
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Surface(corners, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def survey(surface: Surface, smallest: float = 3e-4) -> Survey:
    return Survey(base=Base(surface), tip_radius=R, smallest=smallest)


def test_sweeps_of_a_plate_run_along_its_long_side_a_pitch_apart_and_turn_round_every_time() -> None:
    plan = survey(plate())
    sweeps = list(plan.sweeps())
    assert len(sweeps) == int(np.ceil(0.15 / plan.pitch))
    rows = np.array([sweep.path[0, 1] for sweep in sweeps])
    assert np.abs(np.diff(rows)).max() <= plan.pitch * (1 + 1e-9)
    assert all(sweep.length == pytest.approx(0.2) for sweep in sweeps)
    directions = np.array([np.sign(sweep.path[-1, 0] - sweep.path[0, 0]) for sweep in sweeps])
    assert (directions[1:] == -directions[:-1]).all()


@pytest.mark.parametrize("surface", [plate(), cylinder()])
@pytest.mark.parametrize("shortest_ridge", [None, 0.05])
def test_the_length_of_all_sweeps_is_foretold_by_the_area(surface: Surface, shortest_ridge: float | None) -> None:
    plan = Survey(base=Base(surface), tip_radius=R, smallest=3e-4, shortest_ridge=shortest_ridge)
    assert sum(line.length for line in plan.lines()) == pytest.approx(plan.foretold_path, rel=0.25)


def test_every_point_between_two_sweeps_still_sees_the_asked_share_of_the_smallest_feature() -> None:
    plan = survey(plate(), smallest=5e-4)
    height_halfway = plan.smallest - (plan.pitch / 2) ** 2 / (2 * R)
    assert height_halfway >= plan.visible * plan.smallest * (1 - 1e-9)


def test_the_commanded_centre_presses_slightly_into_contact() -> None:
    for sweep in survey(plate()).sweeps():
        assert np.allclose(sweep.path[:, 2], 0.98 * R)
        assert np.allclose(sweep.approach, [0, 0, -1])


def test_a_cylinder_is_surveyed_by_closed_rings_that_overlap_themselves() -> None:
    plan = survey(cylinder())
    sweeps = list(plan.sweeps())
    assert len(sweeps) == int(np.ceil(0.06 / plan.pitch))
    for sweep in sweeps:
        assert np.ptp(sweep.path[:, 2]) < 1e-12
        assert sweep.length > 2 * np.pi * (0.03 + 0.98 * R)
        radial = np.linalg.norm(sweep.path[:, :2], axis=1)
        assert np.abs(radial - 0.03 - 0.98 * R).max() < 1e-4


def test_a_box_has_six_charts_and_is_covered_all_over() -> None:
    body = box()
    assert len(crease_charts(body)) == 6
    moves, outcome = dry_run(survey(body).plan(), EMPTY)
    assert outcome.reason == "done"
    assert outcome.value.fraction == pytest.approx(1.0)
    assert len(moves) >= 6 * 0.05 / survey(body).pitch


def test_a_sphere_is_covered_by_level_sets_of_the_geodesic_distance() -> None:
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.04)
    surface = Surface(ball.vertices, ball.faces)
    field = level_field(surface, surface.vertices, np.arange(len(surface.faces)))
    assert field.kind == "geodesic"
    assert field.values.max() - field.values.min() == pytest.approx(np.pi * 0.04, rel=0.03)
    # the ball's centres are (R + r) / R times further apart than what it touches, and so much more is lost between
    # two sweeps: they lie closer by the root of that
    bent = level_field(surface, surface.vertices, np.arange(len(surface.faces)), R)
    assert field.bend == 1.0 and bent.bend == pytest.approx((0.04 + R) / 0.04, rel=0.01)
    assert len(bent.levels(2e-3)) == pytest.approx(len(field.levels(2e-3)) * np.sqrt(bent.bend), rel=0.02)
    _, outcome = dry_run(survey(surface).plan(), EMPTY)
    assert outcome.value.fraction > 0.995


def test_a_region_limits_the_survey() -> None:
    low, high = np.array([0.0, 0.0, -1.0]), np.array([0.1, 0.15, 1.0])
    part = Survey(base=Base(plate()), tip_radius=R, smallest=3e-4, region=(low, high))
    sweeps = list(part.sweeps())
    assert max(float(sweep.path[:, 0].max()) for sweep in sweeps) <= 0.1 + 1e-9
    assert sum(sweep.length for sweep in sweeps) == pytest.approx(0.1 * 0.15 / part.pitch, rel=0.1)


def test_a_region_is_cut_out_of_triangles_larger_than_it() -> None:
    low, high = np.array([0.05, 0.04, -0.01]), np.array([0.13, 0.09, 0.01])
    coarse, fine = (
        Survey(base=Base(plate(parts=parts)), tip_radius=R, smallest=3e-4, region=(low, high)) for parts in (1, 30)
    )
    lengths = []
    for part in (coarse, fine):
        sweeps = list(part.sweeps())
        paths = np.concatenate([sweep.path for sweep in sweeps])[:, :2]
        assert (paths >= low[:2] - 1e-9).all() and (paths <= high[:2] + 1e-9).all()
        assert part.covered([part.touched(sweep) for sweep in sweeps]).fraction > 0.99
        lengths.append(sum(sweep.length for sweep in sweeps))
    assert lengths[0] == pytest.approx(lengths[1]) == pytest.approx(0.08 * np.ceil(0.05 / coarse.pitch))


def test_a_region_without_surface_has_no_sweeps_and_nothing_covered() -> None:
    above = Survey(base=Base(plate()), tip_radius=R, smallest=3e-4, region=(np.full(3, 0.01), np.full(3, 0.1)))
    _, outcome = dry_run(above.plan(), EMPTY)
    assert not list(above.sweeps()) and outcome.value.fraction == 0.0


def test_an_isoline_lies_on_its_level_and_closes_round_a_cylinder() -> None:
    body = cylinder()
    lines = isolines(body.vertices, body.faces, np.arange(len(body.faces)), body.vertices[:, 2], 0.0173)
    assert len(lines) == 1 and lines[0].closed
    assert np.allclose(lines[0].points[:, 2], 0.0173)
    assert len(lines[0].faces) == len(body.faces)


def test_a_level_through_vertices_gives_each_face_once() -> None:
    body = plate(parts=4)
    lines = isolines(body.vertices, body.faces, np.arange(len(body.faces)), body.vertices[:, 1], 0.075)
    assert sum(line.length for line in lines) == pytest.approx(0.2)


def test_coverage_counts_the_share_of_each_face_near_a_sweep() -> None:
    body = plate(parts=1)
    line = np.column_stack([np.linspace(0, 0.2, 400), np.full(400, 0.075), np.zeros(400)])
    seen = coverage(body, line, 0.0075)
    assert seen.fraction == pytest.approx(0.1, abs=0.01)
    assert coverage(body, np.zeros((0, 3)), 0.01).fraction == 0.0
    samples = face_samples(body, 0.01)
    assert np.bincount(samples.owner).min() >= 100 and np.ptp(samples.points[:, 2]) == 0.0


def test_settings_that_cannot_work_are_refused() -> None:
    for smallest in (0.0, -1.0, np.nan):
        with pytest.raises(PlannerError, match="smallest"):
            survey(plate(), smallest=smallest)
    with pytest.raises(PlannerError, match="visible"):
        Survey(base=Base(plate()), tip_radius=R, smallest=1e-4, visible=1.5)


def test_a_survey_scales_with_the_world() -> None:
    scale = 2.0**-10
    big = list(survey(plate()).sweeps())
    small = Survey(
        base=Base(Surface(plate().vertices * scale, plate().faces)), tip_radius=R * scale, smallest=3e-4 * scale
    )
    for one, other in zip(big, small.sweeps(), strict=True):
        assert isinstance(one, Move)
        assert np.allclose(one.path * scale, other.path, rtol=1e-9, atol=1e-15)


def crossed(surface: Surface, span: float) -> Survey:
    return Survey(base=Base(surface), tip_radius=R, smallest=3e-4, shortest_ridge=span)


def nearest_sweep(points: np.ndarray, sweeps: list[Move]) -> float:
    """Least distance of points (N, 3) from what the sweeps touch, m."""
    from scipy.spatial import cKDTree

    dense = [np.linspace(a, b, 60) for s in sweeps for a, b in itertools.pairwise(s.path + 0.98 * R * s.approach)]
    return float(cKDTree(np.concatenate(dense)).query(points)[0].min())


def test_no_ridge_of_the_asked_span_slips_between_crossed_sweeps_however_it_lies() -> None:
    plan = crossed(plate(), 0.03)
    sweeps = list(plan.sweeps())
    rng = np.random.default_rng(5)
    for _ in range(300):
        angle = rng.uniform(0, np.pi)
        half = 0.015 * np.array([np.cos(angle), np.sin(angle), 0.0])
        middle = np.append(rng.uniform([0.015, 0.015], [0.185, 0.135]), 0.0)
        assert nearest_sweep(np.linspace(middle - half, middle + half, 200), sweeps) < 0.5 * plan.pitch + 2e-4


def test_crossed_sweeps_are_several_times_shorter_than_strips() -> None:
    strips = sum(sweep.length for sweep in survey(plate()).sweeps())
    assert sum(sweep.length for sweep in crossed(plate(), 0.03).sweeps()) < strips / 2.5
    assert crossed(plate(), 2e-3).crossed(0.35) is None  # strips are shorter there


@pytest.mark.slow
def test_crossed_sweeps_on_a_sphere_meet_every_arc_of_the_asked_span() -> None:
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.04)
    plan = crossed(Surface(ball.vertices, ball.faces), 0.03)
    sweeps = list(plan.sweeps())
    slices = plan.crossed(plan.visible)
    assert slices is not None and len(slices.axes) == 3
    rng = np.random.default_rng(6)
    for _ in range(100):
        first, second = np.linalg.qr(rng.standard_normal((3, 2)))[0].T
        half = np.arcsin(0.015 / 0.04)
        turn = np.linspace(-half, half, 150)[:, None]
        arc = 0.04 * (np.cos(turn) * first + np.sin(turn) * second)
        assert nearest_sweep(arc, sweeps) < 0.5 * plan.pitch + 4e-4


def test_a_span_that_is_no_length_is_refused() -> None:
    for span in (0.0, -1.0, np.inf):
        with pytest.raises(PlannerError, match="shortest ridge"):
            crossed(plate(), span)
