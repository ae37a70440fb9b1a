"""Lines that no single sweep shows: how closely to survey, and where to begin to follow them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from explore3d.bench.scenes.bodies import plate
from hw.move import Move
from mapping.base.base import Base
from mapping.detection.detect import Detections, detect
from mapping.feature import Feature, Interval, Support
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace
from planners.drive import drive
from planners.explore.faint_search import LEADS, FaintSearch, lead
from planners.survey.survey import Survey

PLATE = Base(Surface(*plate(0.1, 0.08)))


def survey(**changes) -> Survey:
    return Survey(base=PLATE, tip_radius=0.01, smallest=4e-5, shortest_ridge=0.04, **changes)


def test_a_single_crossing_is_enough_where_one_sweep_shows_the_smallest_line() -> None:
    assert FaintSearch(survey(), 4e-5, Noise(2e-4), 0.01).crossings == 1


def test_half_the_height_needs_six_times_the_crossings() -> None:
    one, other = (FaintSearch(survey(), limit, Noise(2e-4), 0.01).crossings for limit in (1.6e-4, 3.2e-4))
    assert other / one == pytest.approx(2.0**2.5, rel=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_every_line_of_the_span_is_crossed_as_often_as_asked(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle, middle = rng.uniform(0.0, np.pi), rng.uniform(-0.015, 0.015, 2)
    way = np.array([np.cos(angle), np.sin(angle)])
    count = 0
    for move in survey(crossings=12).sweeps():
        offset = move.path[:, :2] - middle
        beside = offset @ [-way[1], way[0]]
        for k in np.flatnonzero(np.sign(beside[1:]) != np.sign(beside[:-1])):
            share = beside[k] / (beside[k] - beside[k + 1])
            count += abs((offset[k] + share * (offset[k + 1] - offset[k])) @ way) <= 0.02
    assert count >= 11  # planes begin half a pitch within the border: one crossing more or less at an end


def test_a_lead_begins_in_the_middle_with_passes_that_follow_from_the_height() -> None:
    axis, up = np.array([[-0.02, 0.0, 0.0], [0.02, 0.01, 0.0]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    height = Interval(-4.5e-5, -5.3e-5, -3.7e-5)

    def line(snr: float) -> Feature:
        size = Interval(2e-3, 2e-3, 2e-3)
        return Feature("groove", axis, up, height, size, size, Support(snr, 36), True, 3e-4)

    seen = Detections((), Noise(2e-4), 3, 1.3e-4, 0.95, 4.8, 10.0)
    begun = lead(line(12.0), seen, PLATE, 0.01)
    assert np.linalg.norm(begun.seed.point - axis.mean(axis=0)) < 1e-9
    assert abs(begun.seed.tangent @ begun.way) < 1e-9 and begun.seed.kind == "concave"
    alone = np.sqrt(3.0 / 8.0) * 6.445 * (4.5 / 13.0) ** 1.25  # signal-to-noise ratio of one pass over such a dip
    assert begun.passes == np.ceil(38.2 / alone**2)
    assert lead(line(30.0), seen, PLATE, 0.01).passes == begun.passes  # a sweep along it tells nothing of a crossing


def test_sweeps_that_felt_hardly_anything_show_nothing() -> None:
    def felt(move: Move) -> Trace:
        number = int(1e6 * move.path[0].sum()) % 1000
        return Trace(np.arange(3.0), move.path[[0, 0, -1]] + [0.0, 0.0, 0.01], np.full(3, number), 0.01)

    _, outcome = drive(FaintSearch(survey(), 8e-5, Noise(2e-4), 0.01).plan(), felt)
    assert outcome.reason == "no contact" and outcome.value.leads == () and outcome.value.crossings == ()


@pytest.mark.parametrize(("learns", "more"), [(True, True), (False, False)])
def test_more_sweeps_are_made_where_the_noise_is_larger_than_the_survey_told(learns: bool, more: bool) -> None:
    """A plate felt every 0.1 mm with twice the noise that was believed: lines need four times the crossings."""
    believed, rng, moves = Noise(1e-4), np.random.default_rng(0), []

    def felt(move: Move) -> Trace:
        s = np.linalg.norm(move.path - move.path[0], axis=1)
        even = np.arange(0.0, s[-1], 1e-4)
        centers = np.column_stack([np.interp(even, s, move.path[:, i]) for i in range(3)])
        centers[:, 2] = 0.01 + 2.0 * believed.white * rng.standard_normal(len(even))
        moves.append(move)
        return Trace(even / 0.1, centers, np.full(len(even), len(moves)), 0.01)

    first = next(iter(survey().sweeps()))
    limit = detect(felt(first), PLATE, noise=believed).detection_limit
    search = FaintSearch(replace(survey(), smallest=0.8 * limit), limit, believed, 0.01, learns)
    moves.clear()
    _, outcome = drive(search.plan(), felt)
    planned = len(list(replace(search.survey, crossings=max(2, int(np.ceil(LEADS * search.crossings)))).sweeps()))
    assert (len(moves) > 2 * planned) if more else (len(moves) == planned)
    assert outcome.value.noise.white == pytest.approx((2.0 if learns else 1.0) * believed.white, rel=0.05)
