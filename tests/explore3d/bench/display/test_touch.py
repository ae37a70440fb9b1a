"""LaMotte's task, asked of the detector and of the ideal observer."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.bench.display import bench_touch, best_shares, touch, touch_lines
from hw.simulated import NoiseSource


@pytest.mark.slow
def test_the_detector_feels_what_people_feel_and_guesses_where_nothing_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(touch, "HUMAN_HEIGHTS", {"dot 231 um": touch.HUMAN_HEIGHTS["dot 231 um"]})
    monkeypatch.setattr(touch, "HEIGHT_SHARES", (1e-3, 1.0))
    nothing, human = list(bench_touch(12, seed=5, noises=["white"]))
    assert human.right > 0.9 and nothing.right < 0.9
    assert human.place_unknown > 0.99 and nothing.place_unknown < 0.6
    assert touch_lines([nothing, human])[-1].startswith("| dot 231 um | 2.94 um | white | ")


def test_the_ideal_observer_of_a_known_place_has_the_closed_form() -> None:
    """A stationary Ornstein-Uhlenbeck process is independent innovations: d'^2 is the sum of theirs, squared."""
    sd, height, count, before = 2e-6, 3e-6, 60, 20
    noise, length = NoiseSource(correlated=sd, correlation_length=1e-3), 0.1e-3
    edge = np.where(np.arange(count) >= before, height, 0.0)[None]
    keep = np.exp(-length / 1e-3)
    innovations = edge[0, 1:] - keep * edge[0, :-1]  # each of variance sd^2 (1 - keep^2)
    worth = (innovations**2).sum() / (sd**2 * (1.0 - keep**2))
    known, unknown = best_shares(edge, noise, length, length, np.random.default_rng(1))
    from scipy.stats import norm

    assert known == pytest.approx(norm.cdf(np.sqrt(0.5 * worth)), abs=1e-9)
    assert unknown == pytest.approx(known, abs=0.03)  # there is one place only


def test_who_does_not_know_the_place_is_right_less_often() -> None:
    places = np.eye(200) * 2.5e-6
    noise = NoiseSource(white=1e-6)
    known, unknown = best_shares(places, noise, 1e-5, 1e-5, np.random.default_rng(2))
    assert known == pytest.approx(0.9615, abs=1e-3)  # Phi(2.5 / sqrt 2)
    assert 0.55 < unknown < 0.8


def test_a_wide_dot_that_stands_out_is_felt_however_steep_noise_makes_its_flanks() -> None:
    noise = touch.head_noise("white")
    heights = [touch._strongest(602e-6, 1.09e-6, noise, np.random.default_rng(seed)) for seed in range(44, 56)]
    assert min(heights) > 8.0
