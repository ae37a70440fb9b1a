"""Details on any body, and the judge of what was explored of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from explore3d.bench.exploration import body_judge
from explore3d.bench.exploration.bodies import body_run
from explore3d.bench.exploration.body_judge import Judge, refusals
from explore3d.bench.scenes.any_body import BODY_BUILDING_SEEDS, BODY_REPORTED_SEEDS, FILED_BODIES, any_body
from explore3d.bench.scenes.bodies import sphere_mesh
from explore3d.bench.scenes.laid_on import Detail, drawn_details, laid_on
from explore3d.log import Event
from mapping.geometry.contact import BallContact
from mapping.geometry.mesh.nearest import NearestPoint
from mapping.surface import Surface

R = 3e-3
FILES = Path(__file__).resolve().parents[5] / "shared" / "data"


def box(size: float) -> Surface:
    from trimesh.creation import box as cuboid

    body = cuboid(extents=(size, size, size))
    return Surface(body.vertices, body.faces)


def test_a_detail_has_its_height_and_leaves_the_rest_of_the_body_where_it_was() -> None:
    plain = box(0.04)
    course = np.column_stack([np.linspace(-5e-3, 5e-3, 21), np.zeros(21), np.full(21, 0.02)])
    ridge = Detail("ridge", course, np.tile([0.0, 0.0, 1.0], (21, 1)), 0.5e-3, 2e-3)
    detailed = Surface(*laid_on((plain.vertices, plain.faces), [ridge]))
    assert not detailed.open_sides.any()
    top = detailed.vertices[:, 2].max() - 0.02
    assert 0.994 * 0.5e-3 < top < 0.5e-3 + 1e-12
    off = NearestPoint(plain).query(detailed.vertices).distance
    assert off[ridge.distance(detailed.vertices) > 1.2e-3].max() < 1e-12
    # the sum of what stands out: half the height over the width along the course, a round end at either side
    grown = volume(detailed) - volume(plain)
    ends = np.pi * 0.5e-3 * 1e-6 * (0.5 - 2.0 / np.pi**2)
    assert grown == pytest.approx(0.5 * 0.5e-3 * 2e-3 * 10e-3 + ends, rel=0.02)


def test_a_bump_is_as_high_as_it_is_said_to_be_wherever_it_lies() -> None:
    plain = box(0.04)
    for x, y in ((1.23e-3, -4.56e-3), (0.0, 0.0)):  # in a face; where edges of the refined mesh may meet
        bump = Detail("bump", np.array([[x, y, 0.02]]), np.array([[0.0, 0.0, 1.0]]), 0.6e-3, 3e-3)
        detailed = Surface(*laid_on((plain.vertices, plain.faces), [bump]))
        assert not detailed.open_sides.any()
        assert detailed.vertices[:, 2].max() == pytest.approx(0.0206, abs=1e-9)


@pytest.mark.parametrize(("kind", "height", "width"), [("bump", 0.6e-3, 3e-3), ("ridge", 0.5e-3, 2e-3)])
def test_the_ball_feels_a_detail_as_high_as_its_section(kind: str, height: float, width: float) -> None:
    plain = box(0.04)
    course = np.array([[0.0, 0.0, 0.02]]) if kind == "bump" else np.array([[-6e-3, -2e-3, 0.02], [6e-3, 3e-3, 0.02]])
    detail = Detail(kind, course, np.tile([0.0, 0.0, 1.0], (len(course), 1)), height, width)
    detailed = BallContact(Surface(*laid_on((plain.vertices, plain.faces), [detail])), R)
    rng = np.random.default_rng(3)
    along = rng.uniform(0.25, 0.75, (400, 1))
    beside = course[0] + along * (course[-1] - course[0]) + rng.uniform(-0.3, 0.3, (400, 3)) * [1e-3, 1e-3, 0.0]
    distance = detail.distance(beside)
    felt = 0.03 - detailed.first_contact(beside + np.array([0.0, 0.0, 0.01]), [0.0, 0.0, -1.0]).distance - 0.02 - R
    u = np.linspace(0.0, 0.5 * width, 2001)
    ideal = height * np.cos(np.pi * u / width) ** 2 + np.sqrt(R**2 - (u - distance[:, None]) ** 2)
    off = felt - (ideal.max(axis=1) - R)
    # half of a standard deviation of a height that a run measures, 4.6 um of a bump and 1.9 of a ridge
    assert abs(off.mean()) < (2.3e-6 if kind == "bump" else 0.95e-6)
    assert off.min() > -4.5e-6 and off.max() < 1e-9


def volume(surface: Surface) -> float:
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def test_details_are_drawn_where_the_ball_fits_and_by_the_seed_alone() -> None:
    unit, faces = sphere_mesh(4)
    ball = Surface(0.03 * unit, faces)
    first, again, other = (drawn_details(ball, R, np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert [each.kind for each in first] == ["ridge", "ridge", "groove", "bump", "bump"]
    assert all(np.array_equal(a.course, b.course) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[0].course[0], other[0].course[0])
    assert np.linalg.norm(np.diff(first[0].course, axis=0), axis=1).sum() == pytest.approx(18e-3, rel=0.02)
    with pytest.raises(ValueError, match="no room"):
        drawn_details(box(8e-3), R, np.random.default_rng(0))


def test_the_seeds_that_are_reported_are_none_that_were_built_with() -> None:
    assert not set(BODY_BUILDING_SEEDS) & set(BODY_REPORTED_SEEDS)


def test_the_judge_knows_what_a_ball_cannot_reach_in_an_inner_corner() -> None:
    body, _ = any_body("l_bracket", BODY_BUILDING_SEEDS[0])
    judge = Judge(body.base, R)
    places, normals, _ = judge.asked
    floor = (normals[:, 1] > 0.99) & (np.abs(places[:, 1] - 6e-3) < 1e-6) & (np.abs(places[:, 2] - 20e-3) < 15e-3)
    beside = floor & (places[:, 0] < 8.3e-3)
    beyond = floor & (places[:, 0] > 9.2e-3) & (places[:, 0] < 55e-3)
    assert not judge.reachable[beside].any() and judge.reachable[beyond].all()


def test_the_judge_takes_neither_the_other_side_nor_far_places_for_swept() -> None:
    plate = box(0.02)
    judge = Judge(plate, R)
    places, normals, _ = judge.asked
    line = np.column_stack([np.linspace(-8e-3, 8e-3, 200), np.zeros(200), np.full(200, 10e-3 + R)])
    swept = judge.swept(line, 1e-3)
    top = normals[:, 2] > 0.9
    assert not swept[~top].any()
    away = np.hypot(np.maximum(np.abs(places[top, 0]) - 8e-3, 0.0), places[top, 1])
    assert swept[top][away < 0.99e-3].all() and not swept[top][away > 1e-3].any()


def test_the_judge_sees_a_way_through_a_corner() -> None:
    judge = Judge(box(0.02), R)
    up = [0.0, 0.0, -1.0]
    over = {"purpose": "travel", "path": [[0.0, 0.0, 14e-3], [9e-3, 0.0, 14e-3]], "approach": [up, up]}
    down = {"purpose": "sweep", "path": [[9e-3, 0.0, 13e-3], [13e-3, 0.0, 13e-3]], "approach": [up, up]}
    beside = {"purpose": "sweep", "path": [[13e-3, 0.0, 0.0], [13e-3, 5e-3, 0.0]], "approach": [[-1.0, 0.0, 0.0]] * 2}
    assert judge.sinking([over, down], [])[0] <= 0.0
    assert judge.sinking([over, beside], [])[0] > 0.05
    assert judge.sinking([over], [np.tile([0.0, 0.0, 12.7e-3], (16, 1))])[0] == pytest.approx(0.1, abs=0.01)


def test_two_refusals_in_a_row_count_if_their_cause_is_one() -> None:
    def event(kind: str, what: str = "") -> Event:
        return Event(kind, 0.0, {"what": what})

    wall, far = "sweep not executed: sinks 0.3 mm", "sweep not executed: leaves the workspace"
    events = [event("move"), event("refused", wall), event("refused", wall.replace("3", "4")), event("refused", far)]
    assert refusals(events) == {"moves": 1, "refused": 3, "refused_twice": 1}
    assert body_judge.refusals(events[:2])["refused_twice"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(FILED_BODIES))
def test_a_published_body_is_swept_and_nothing_sinks_into_it(name: str, tmp_path: Path) -> None:
    if not (FILES / FILED_BODIES[name]).exists():
        pytest.skip(f"{FILES / FILED_BODIES[name]} is not there")
    record = body_run(name, BODY_BUILDING_SEEDS[0], FILES, tmp_path)
    assert record["swept"] > 0.95 and record["refused"] <= 0.02 * (record["moves"] + record["refused"])
    assert record["ball_sank"] <= 0.05
    assert record["found"] >= 0.9 * record["reachable_features"]
