"""Coverage: how small a feature would have been found where, and how surely."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from explore3d.analysis.inspected import Inspected
from hw.simulated.finger import SimulatedFinger
from mapping import length_text
from mapping.base.base import Base
from mapping.base.fit import fit_base
from mapping.detection.coverage import face_samples, found_heights, found_probability, lost_heights
from mapping.detection.detect import detect, expected_limit
from mapping.geometry.templates.shapes import cap_height
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace
from planners.survey.survey import Survey

R = 0.01


def plate(cells: int = 24) -> Surface:
    x, y = (g.ravel() for g in np.meshgrid(*[np.linspace(0.0, 0.06, cells + 1)] * 2, indexing="ij"))
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    faces = [np.column_stack([corner, corner + cells + 1, corner + 1])]
    faces.append(np.column_stack([corner + cells + 1, corner + cells + 2, corner + 1]))
    return Surface(np.column_stack([x, y, 0 * x]), np.concatenate(faces))


def test_a_face_beside_a_sweep_hides_what_the_ball_passes_over() -> None:
    surface = plate()
    touched = np.column_stack([np.linspace(0, 0.06, 601), np.full(601, 0.03), np.zeros(601)])
    height = found_heights(surface, touched, upwards(touched), R, 1e-4).face
    middle = surface.vertices[surface.faces].mean(axis=1)
    away = np.abs(surface.vertices[surface.faces][:, :, 1] - 0.03).max(axis=1)
    near = away < 0.8 * R
    exact, beyond = (1e-4 + R - np.sqrt(R**2 - (away[near] + more) ** 2) for more in (0.0, 0.1 * R))
    assert (height[near] >= exact).all() and (height[near] <= beyond).all()
    assert np.isinf(height[np.abs(middle[:, 1] - 0.03) > 1.1 * R]).all()
    assert np.isinf(found_heights(surface, touched[:0], touched[:0], R, 1e-4).face).all()


def upwards(places: np.ndarray) -> np.ndarray:
    return np.tile([0.0, 0.0, 1.0], (len(places), 1))


@pytest.mark.parametrize("bend", [1 / 0.03, 0.0, -1 / 0.03])
def test_what_is_lost_beside_a_sweep_is_the_height_of_the_crest_that_the_ball_just_touches(bend: float) -> None:
    """Sweeps along a cylinder: outside of it more is lost than on a plane, inside less."""
    aside = 1.5e-3
    if bend:
        radius, angle = 1 / bend, aside * bend
        normal = np.array([[np.sin(angle), 0.0, np.cos(angle)]])
        place = radius * (normal - [[0.0, 0.0, 1.0]])
    else:
        place, normal = np.array([[aside, 0.0, 0.0]]), upwards(np.zeros((1, 3)))
    touched = np.column_stack([np.zeros(401), np.linspace(-5e-3, 5e-3, 401), np.zeros(401)])
    lost = lost_heights(place, normal, touched, upwards(touched), R)[0]
    crest, centre = place[0] + lost * normal[0], np.array([0.0, 0.0, R])
    assert np.linalg.norm(crest - centre) == pytest.approx(R, rel=1e-12)
    assert lost == pytest.approx(0.5 * aside**2 * (1 / R + bend), rel=0.02)


def test_a_ball_on_the_other_side_of_a_thin_wall_shows_nothing() -> None:
    touched = np.column_stack([np.linspace(0, 0.06, 601), np.full(601, 0.03), np.full(601, -1e-4)])
    place = np.array([[0.03, 0.03, 0.0]])
    assert np.isinf(lost_heights(place, upwards(place), touched, -upwards(touched), R)).all()


@pytest.mark.parametrize("noise", [Noise(1e-4), Noise(1e-4, 1e-5, 1e-3), Noise(2e-5, 2e-5, 2e-3)])
def test_the_limit_is_foretold_from_the_noise_alone(noise: Noise) -> None:
    spacing, flat = 2e-5, Surface([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    x, rng = np.arange(0.0, 0.4, spacing), np.random.default_rng(3)
    slow, kept = noise.correlated * rng.normal(size=len(x)), np.exp(-spacing / noise.length)
    for k in range(1, len(x)):
        slow[k] = kept * slow[k - 1] + np.sqrt(1 - kept**2) * slow[k]
    trace = Trace.from_profile(x, R + slow + noise.white * rng.normal(size=len(x)), R)
    # the spread of the limit over ten such traces is 2 to 4 %
    assert expected_limit(noise, spacing, R) == pytest.approx(detect(trace, Base(flat)).detection_limit, rel=0.12)


def test_the_probability_of_finding_is_what_detection_does() -> None:
    """Bumps beside a sweep in white noise: the predicted share is found."""
    noise, spacing = Noise(1e-4), 4e-5
    x = np.arange(-0.03, 0.03, spacing)
    flat = Surface([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]], [[0, 1, 2], [0, 2, 3]])
    base, rng = Base(flat), np.random.default_rng(1)
    quiet = detect(Trace.from_profile(x, R + 1e-4 * rng.normal(size=len(x)), R), base, noise=noise)
    limit, threshold = quiet.detection_limit, quiet.threshold
    for height, aside in ((limit, 0.0), (2.0 * limit, 0.5e-3), (2.0 * limit, np.sqrt(2 * R * 1.15 * limit))):
        predicted = float(found_probability(np.array([aside]), height, R, limit, threshold)[0])
        found = 0
        for _ in range(60):
            cap = cap_height(np.sqrt(x**2 + aside**2), height, 1e-7, R)
            trace = Trace.from_profile(x, R + cap + 1e-4 * rng.normal(size=len(x)), R)
            crossings = detect(trace, base, noise=noise).crossings
            found += any(abs(c.point[0]) < 2e-3 for c in crossings)
        assert found / 60 == pytest.approx(predicted, abs=0.17), (height, aside)


def test_a_survey_inspects_what_it_was_asked_for() -> None:
    base = Base(plate())
    finger = SimulatedFinger(object=base.surface, tip_radius=R, rate=2000.0, white=1e-4, seed=1)
    trace = Trace.concatenate(
        [finger.execute(move) for move in Survey(base=base, tip_radius=R, smallest=4e-4).sweeps()]
    )
    inspected = Inspected.of(trace, base, detect(trace, base), 4e-4)
    assert inspected.share(4e-4) > 0.9 and inspected.untouched == 0.0
    assert inspected.share(0.5 * inspected.limit) == 0.0
    half = trace.select(trace.centers[:, 1] < 0.02)
    part = Inspected.of(half, base, detect(half, base), 4e-4)
    assert 0.2 < part.share(4e-4) < 0.5 and part.untouched > 0.4
    assert "No sweep came near" in part.sentence()
    # of the box that was to be inspected everything was, and only its area counts
    box = np.array([-1.0, -1.0, -1.0]), np.array([1.0, 0.02, 1.0])
    boxed = Inspected.of(half, base, detect(half, base), 4e-4, box)
    assert boxed.untouched == 0.0 and boxed.share(4e-4) > 0.9 and np.array_equal(boxed.height, part.height)
    assert boxed.area.sum() == pytest.approx(0.02 / 0.06 * part.area.sum())
    # sweeps on which nothing would have been seen inspect nothing
    third = [*np.unique(trace.sweep)[: len(np.unique(trace.sweep)) // 3]]
    few = Inspected.of(trace, base, detect(trace, base), 4e-4, seen=third)
    assert few.share(4e-4) == pytest.approx(1 / 3, abs=0.05)
    # where no height is asked for, heights are told that hold on some area: the limit holds on none
    unasked = replace(part, asked=None)
    half_of_it, most_of_it = unasked.above(0.5), unasked.above(0.9)
    assert part.limit < half_of_it < 4e-4 < most_of_it < 0.51 * R
    assert part.share(part.limit) < 0.01
    assert part.share(half_of_it) == pytest.approx(0.5 * (1.0 - part.untouched), rel=0.01)
    assert f"on half of it above {length_text(half_of_it, 2)} and on nine tenths" in unasked.sentence()


def test_what_a_fit_added_beyond_the_samples_is_not_called_unswept_but_a_gap_amid_them_is() -> None:
    finger = SimulatedFinger(object=plate(), tip_radius=R, rate=2000.0, white=1e-4, seed=1)
    sweeps = Survey(base=Base(plate()), tip_radius=R, smallest=4e-4).sweeps()
    trace = Trace.concatenate([finger.execute(move) for move in sweeps])
    gap = np.abs(trace.centers[:, :2] - 0.03).max(axis=1) < 1.5 * R
    # what lies behind the gap is another sweep, as the ledger of the path would have it
    quarter = (trace.centers[:, :2] > 0.03) @ [1000, 2000]
    behind = replace(trace, sweep=trace.sweep + quarter).select(~gap)
    # what lies a tip radius inside the gap, of the plate and a margin of a tip radius; and all of the gap
    least_gap = (3 * R - 2 * R) ** 2 / (0.06 + 2 * R) ** 2
    for felt, least, most in ((trace, 0.0, 0.001), (behind, least_gap, (3 * R) ** 2 / 0.06**2)):
        base = fit_base(felt)
        assert base.kind == "plane"
        untouched = Inspected.of(felt, base, detect(felt, base), 4e-4).untouched
        assert least <= untouched < most
    # a mesh that was given is the body, to its border
    assert not Base(base.surface).beyond(base.surface.vertices, R).any()
    assert base.beyond(base.surface.vertices, R).all()


def test_the_share_that_was_passed_does_not_depend_on_how_large_the_faces_are():
    corners = 0.2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    plate = Surface(corners, [[0, 1, 2], [0, 2, 3]])
    line = np.column_stack([np.linspace(-0.05, 0.05, 201), np.zeros(201), np.zeros(201)])
    found = found_heights(plate, line, upwards(line), 0.01, 1e-4)
    assert np.isinf(found.face).all()
    assert found.area.sum() == pytest.approx(0.16)
    # the strip of a tip radius to either side, and the round ends
    passed = found.area[np.isfinite(found.place)].sum()
    assert passed == pytest.approx(0.1 * 0.02 + np.pi * 0.01**2, rel=0.02)


def thin_faces() -> Surface:
    """A fan of slivers, an obtuse one, a right one of 40 x 1 mm, one without area, and one that is as high as long."""
    rim = [[0.02, y, 0.0] for y in np.linspace(-5e-3, 5e-3, 30)]
    fan = [[0, k + 1, k + 2] for k in range(29)]
    more = [[-0.02, 0, 0.01], [0.02, 0, 0.01], [3e-3, 2e-3, 0.01], [0.02, 1e-3, 0.01], [0.0, 0, 0.01], [0, 0.03, 0.01]]
    others = [[31, 32, 33], [31, 32, 34], [31, 35, 32], [31, 32, 36]]
    return Surface([[-0.02, 0, 0], *rim, *more], [*fan, *others])


def test_samples_of_thin_faces_are_as_near_as_those_of_others_and_not_more() -> None:
    surface, spacing = thin_faces(), 4e-4
    samples = face_samples(surface, spacing)
    count = np.bincount(samples.owner, minlength=len(surface.faces))
    assert np.bincount(samples.owner, samples.share) == pytest.approx(1.0)
    area, longest = surface.face_areas, 0.0475
    # along a face one for each spacing, and for each of its squares two
    assert (count < 4.0 * longest / spacing + 4.0 * area / spacing**2).all()
    rng = np.random.default_rng(3)
    for face, corners in enumerate(surface.vertices[surface.faces]):
        weights = np.concatenate([rng.dirichlet([0.3, 0.3, 0.3], 3000), np.eye(3)])
        own = samples.owner == face
        away = cKDTree(samples.points[own]).query(weights @ corners)
        assert (away[0] <= 1.02 * samples.gap[own][away[1]]).all() and away[0].max() < 1.1 * spacing
        mean = samples.share[own] @ samples.points[own]
        assert mean == pytest.approx(corners.mean(axis=0), abs=0.2 * spacing)


def test_many_samples_of_thin_faces_need_little_more_memory_than_they_are() -> None:
    x = np.linspace(0.0, 0.06, 61)
    vertices = np.concatenate([np.column_stack([x, 0 * x + y, 0 * x]) for y in (0.0, 0.06)])
    one = np.arange(60)
    strips = np.concatenate([np.column_stack(each) for each in ((one, one + 1, one + 62), (one, one + 62, one + 61))])
    surface = Surface(vertices, strips)
    tracemalloc.start()
    samples = face_samples(surface, 1e-4)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    held = sum(each.nbytes for each in vars(samples).values())
    assert len(samples.owner) > 80_000
    assert peak < 2.3 * held  # it was 2.8: five arrays as large as the points between


def test_places_that_all_stay_are_not_copied() -> None:
    found = found_heights(plate(), np.array([[0.03, 0.03, 0.0]]), np.array([[0.0, 0.0, 1.0]]), R)
    assert found.at(np.ones(len(found.place), dtype=bool)) is found
    assert len(found.at(np.isfinite(found.place)).place) == np.isfinite(found.place).sum() < len(found.place)
