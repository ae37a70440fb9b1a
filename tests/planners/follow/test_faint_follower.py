"""Lines that a single sweep does not show: whether they are at a place, and where they end."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.bench.exploration.exploring import APPARATUS
from explore3d.bench.scenes.exploring import BENCH_TIP_RADIUS as TIP_RADIUS, groove
from hw.simulated.finger import SimulatedFinger
from mapping.base.base import Base
from mapping.detection.crossing import Crossing
from mapping.instrument.noise import Noise
from planners.drive import drive
from planners.follow.faint_follower import DECIDED, FaintFollower, FaintLead, Straight
from planners.follow.presence import Expected, presence
from planners.follow.sense import Sense
from planners.follow.template_fit import dip_shape
from planners.paths.strokes import Strokes

NOISE = Noise(APPARATUS["white"], APPARATUS["correlated"], APPARATUS["correlation_length"])
UP = np.array([0.0, 0.0, 1.0])
DIP, HALF_WIDTH = 5e-5, 1e-3
EXPECTED = Expected(0.0, 0.3e-3, float(np.log(DIP)), 0.2)


def odds(depth: float, passes: int, rng: np.random.Generator, place: float = 0.0) -> tuple[float, Expected]:
    """What passes say that feel a dip of a depth at a place, m."""
    s = np.linspace(-3e-3, 3e-3, 121)
    noise = NOISE.of_passes(passes)
    root = np.linalg.cholesky(Noise(NOISE.white / np.sqrt(passes), noise.correlated, noise.length).covariance(s))
    height = -dip_shape(TIP_RADIUS)(s - place, depth) + root @ rng.standard_normal(len(s))
    every = np.repeat(height, passes)  # their mean is all that counts
    return presence(
        np.repeat(s, passes), every, dip_shape(TIP_RADIUS), -1.0, EXPECTED, HALF_WIDTH, NOISE.of_passes(passes)
    )


def test_odds_of_a_line_where_nothing_is_are_one_on_average() -> None:
    rng = np.random.default_rng(0)
    factors = np.exp([odds(0.0, 6, rng)[0] for _ in range(400)])
    assert abs(factors.mean() - 1.0) < 3.0 * factors.std() / 20.0


def test_what_is_decided_is_wrong_no_more_often_than_said() -> None:
    """By Wald's bound; the passes are so many that most are decided."""
    rng = np.random.default_rng(1)
    there = np.array([odds(DIP, 60, rng, 0.3e-3 * rng.standard_normal())[0] for _ in range(200)])
    nothing = np.array([odds(0.0, 60, rng)[0] for _ in range(200)])
    assert (there < -DECIDED).sum() <= 1 and (nothing > DECIDED).sum() <= 1
    assert (there > 0.0).mean() > 0.97 and (nothing < 0.0).mean() > 0.97


def test_a_place_and_a_height_are_told_as_well_as_they_are_known() -> None:
    rng = np.random.default_rng(2)
    off = []
    for _ in range(200):
        place, depth = 0.3e-3 * rng.standard_normal(), DIP * np.exp(0.2 * rng.standard_normal())
        known = odds(depth, 100, rng, place)[1]
        off.append(((known.place - place) / known.place_sd, (known.log_height - np.log(depth)) / known.log_height_sd))
    assert np.std(off, axis=0) == pytest.approx([1.0, 1.0], abs=0.15)


def lead_along(axis: np.ndarray, beside: float, turned: float) -> tuple[FaintLead, np.ndarray]:
    """A lead in the middle of an axis, beside it (m) and turned (rad) by so much; and the way across it."""
    along = (axis[-1] - axis[0]) / np.linalg.norm(axis[-1] - axis[0])
    across = np.cross(UP, along)
    start, way = axis[30] + beside * across, along + turned * across
    seed = Crossing(0, 0.0, start, UP, across, "concave", -0.043e-3, 4e-6, 4e-4, 1.05e-3, -70.0, 8.0, True, 0, 0)
    return FaintLead(seed, way / np.linalg.norm(way), 100, 0.05), across


@pytest.mark.parametrize("number", [21, *(pytest.param(number, marks=pytest.mark.slow) for number in (22, 23))])
def test_a_groove_a_quarter_of_the_noise_deep_is_followed_to_its_ends_by_many_passes(number: int) -> None:
    scene = groove(np.random.default_rng(number))
    finger = SimulatedFinger(object=scene.object, tip_radius=TIP_RADIUS, seed=number, **APPARATUS)
    base, axis = Base(scene.base), scene.truth[0].axis
    lead, across = lead_along(axis, 0.3e-3, 0.015)
    _, outcome = drive(FaintFollower(Strokes(base, TIP_RADIUS), Sense(base, NOISE), NOISE).follow(lead), finger.execute)
    track = outcome.value
    assert [end.reason for end in track.ends] == ["end", "end"]
    errors = [min(np.linalg.norm(axis[[0, -1]] - end.point, axis=1)) for end in track.ends]
    assert max(errors) < 0.5e-3
    beside = (track.points - axis[0]) @ across
    assert np.sqrt(np.mean(beside**2)) < 0.15e-3
    assert track.height == pytest.approx(DIP, abs=4.0 * track.height_sd)


def test_a_lead_to_nothing_is_given_up() -> None:
    scene = groove(np.random.default_rng(24))
    finger = SimulatedFinger(object=scene.base, tip_radius=TIP_RADIUS, seed=24, **APPARATUS)
    base = Base(scene.base)
    lead, _ = lead_along(scene.truth[0].axis, 0.0, 0.0)
    _, outcome = drive(FaintFollower(Strokes(base, TIP_RADIUS), Sense(base, NOISE), NOISE).follow(lead), finger.execute)
    assert outcome.reason == "lost" and outcome.value is None


def test_two_places_tell_the_course_between_them_better_than_beyond() -> None:
    lead, _ = lead_along(np.linspace([-0.03, 0.0, 0.0], [0.03, 0.0, 0.0], 60), 0.0, 0.0)
    course = Straight.of(lead)
    for s, place in ((-0.01, 1e-4), (0.01, 3e-4)):
        course = course.told(s, Expected(place, 1e-6, course.log_height, course.log_height_sd))
    assert course.at(-0.01).place == pytest.approx(1e-4, abs=1e-6)
    assert course.at(0.01).place == pytest.approx(3e-4, abs=1e-6)
    assert course.slope(0.0) == pytest.approx(0.01, rel=1e-3)
    # only the bend is left open: it bulges by (s^2 - 0.01^2) / 2
    assert course.at(0.005).place_sd / course.at(0.02).place_sd == pytest.approx(0.25, rel=1e-2)
