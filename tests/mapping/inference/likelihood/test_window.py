"""Bins of a run: what is no noise stays in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mapping.base.base import Base, Feet
from mapping.geometry.templates.shapes import cap_height
from mapping.inference.likelihood.gaussian import Nuisance, build_likelihood
from mapping.inference.likelihood.window import Samples, bin_samples, gather
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

R, RADIUS, WIDTH, SIGMA = 5e-3, 0.325e-3, 85e-6, 1e-6


def crossing(spikes: int = 0, spacing: float = 5e-6) -> Trace:
    """A sweep of 15 mm across a wire with noise far below what a flank rises over a bin."""
    rng = np.random.default_rng(1)
    x = np.arange(-7.5e-3, 7.5e-3, spacing)
    height = cap_height(x, 2.0 * RADIUS, RADIUS, R) + SIGMA * rng.standard_normal(len(x))
    height[rng.choice(len(x), spikes, replace=False)] += 1e-3
    centers = np.column_stack([x, np.zeros_like(x), R + height])
    return Trace(1e-3 * np.arange(len(x)), centers, np.zeros(len(x), dtype=np.int64), R)


def window_of(trace: Trace, scale: float = 2.5e-3):
    corners = 0.02 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    base = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
    return bin_samples(
        gather(trace, base, np.array([[0.0, 0.0, R]]), np.array([[0.0, 0.0, 1.0]]), 7e-3), WIDTH, SIGMA, scale
    )


def test_the_samples_of_a_steep_flank_are_no_spikes() -> None:
    trace = crossing()
    window = window_of(trace)
    assert window.samples == int((np.linalg.norm(trace.centers - [0.0, 0.0, R], axis=1) <= 7e-3).sum())
    fine = np.linspace(-1.0, 1.0, 401) * window.half[:, None] + window.feet[:, :1]
    expected = cap_height(fine, 2.0 * RADIUS, RADIUS, R).mean(axis=1)
    assert np.abs(window.height - expected).max() < 2.5e-6  # the ends of a bin fall between samples


def test_a_lost_bit_is_left_out_of_its_bin() -> None:
    clean, spiked = window_of(crossing()), window_of(crossing(spikes=40))
    assert clean.samples - 40 <= spiked.samples < clean.samples - 30
    assert spiked.height == pytest.approx(clean.height, abs=3e-6)


def test_a_bin_of_few_samples_stands_where_they_lie() -> None:
    window = window_of(crossing(spacing=17.7e-6))  # four or five a bin of 85 um
    own = window.feet[:, 0] - window.place
    assert np.ptp(own[2:-2]) < 1e-6


def test_a_stage_that_goes_by_steps_is_where_it_was_felt() -> None:
    """Along and up in turns: the way goes by jumps, and each sample is right where it lies."""
    s = np.linspace(-7.5e-3, 7.5e-3, 700)
    climbing = (np.abs(s) > 0.8e-3) & (np.abs(s) < 2.3e-3)
    s = np.where(climbing, 150e-6 * np.round(s / 150e-6), s) + 1e-6 * np.random.default_rng(1).standard_normal(len(s))
    height = cap_height(s, 2.0 * RADIUS, RADIUS, R)
    centers = np.column_stack([s, np.zeros_like(s), R + height])
    window = window_of(Trace(1e-3 * np.arange(len(s)), centers, np.zeros(len(s), dtype=np.int64), R), scale=0.0)
    flank = (np.abs(window.feet[:, 0]) > 0.5e-3) & (np.abs(window.feet[:, 0]) < 2.2e-3)
    expected = cap_height(window.feet[:, 0], 2.0 * RADIUS, RADIUS, R)
    assert np.abs(window.height - expected)[flank].max() < 1e-6


def test_a_single_sample_was_felt_at_a_point() -> None:
    window = window_of(crossing(spacing=0.3e-3))  # far wider than a bin
    assert (window.count == 1).all() and (window.half == 0.0).all()
    assert (window_of(crossing()).half > 0.4 * WIDTH).sum() > 100


def passes_of(order: list[float], noise: Noise, beside: float = 0.0) -> Trace:
    """Sweeps of 10 mm to and fro across a wire along y, at these places along it, m; the last one's may be off."""
    rng, parts = np.random.default_rng(2), []
    x = np.arange(-5e-3, 5e-3, 25e-6)
    root = np.linalg.cholesky(replace(noise, white=0.0).covariance(x) + noise.white**2 * np.eye(len(x)))
    felt = dict.fromkeys(order, 0)
    for y in order:
        draw = np.random.default_rng([int(1e6 * y), felt[y]]).standard_normal(len(x))
        height = cap_height(x, 2.0 * RADIUS, RADIUS, R) + root @ draw
        way = slice(None, None, 1 if felt[y] % 2 == 0 else -1)
        parts.append(np.column_stack([x, np.full_like(x, y), R + height])[way])
        felt[y] += 1
    parts[-1][:, 1] += beside
    centers = np.concatenate(parts) + 1e-9 * rng.standard_normal((len(parts) * len(x), 3))
    return Trace(1e-3 * np.arange(len(centers)), centers, np.repeat(np.arange(len(parts)), len(x)), R)


def test_passes_over_one_line_are_one_run() -> None:
    noise = Noise(5e-5)
    window = window_of(passes_of([0.0] * 6 + [1e-3] * 3, noise))
    assert len(window.starts) == 3
    inner = np.abs(window.feet[:, 0]) < 3e-3
    assert set(window.passes[inner & (window.run == 0)]) == {6} and set(window.passes[inner & (window.run == 1)]) == {3}
    off = window.height - cap_height(np.linspace(-1.0, 1.0, 51) * window.half[:, None] + window.feet[:, :1],
                                     2.0 * RADIUS, RADIUS, R).mean(axis=1)  # fmt: skip
    z = (off / (noise.white / np.sqrt(window.count)))[inner]
    assert np.std(z) == pytest.approx(1.0, abs=0.15)


def test_a_pass_beside_a_line_is_a_run_of_its_own() -> None:
    assert len(window_of(passes_of([0.0] * 4, Noise(1e-6), beside=0.5 * WIDTH)).starts) == 2
    assert len(window_of(passes_of([0.0] * 4, Noise(1e-6), beside=2.0 * WIDTH)).starts) == 3


@pytest.mark.parametrize("noise", [Noise(5e-5), Noise(5e-5, 2e-5, 0.7e-3)])
def test_a_mean_says_what_its_passes_say(noise: Noise) -> None:
    """The same sweeps, those over one line one after the other or in turns with those over another."""
    together = window_of(passes_of([0.0] * 5 + [1e-3] * 5, noise))
    apart = window_of(passes_of([0.0, 1e-3] * 5, noise))
    assert (len(together.starts), len(apart.starts)) == (3, 11)
    places = 2e-5 * np.array([-1.0, 0.0, 1.0])
    known = []
    for window in (together, apart):
        likelihood = build_likelihood(window, noise, Nuisance(1e-3, 1e-3), 1e-9)
        nodes = np.linspace(-1.0, 1.0, 21) * window.half[:, None] + window.feet[:, :1]
        templates = np.array([cap_height(nodes - at, 2.0 * RADIUS, RADIUS, R).mean(axis=1) for at in places])
        bend, slope, _ = np.polyfit(places, likelihood.log_density(templates), 2)
        known.append((-0.5 * slope / bend, (-2.0 * bend) ** -0.5))
    (place, sd), (other, other_sd) = known
    assert sd == pytest.approx(other_sd, rel=0.03)
    assert abs(place - other) < 0.25 * sd  # what begins a bin in one begins none in the other


def test_a_ball_that_stands_on_a_corner_went_along_no_line() -> None:
    # over a sharp corner the foot stays where it is: means of equal numbers differ by rounding alone
    corner = np.array([0.010309520936406420, 0.015394459150322603, 0.003670723049944928])
    onto = corner + np.linspace(-5e-3, 0.0, 19)[:, None] * np.eye(3)[0]
    along = corner + 4e-3 * np.eye(3)[0] + np.linspace(-1e-3, 6e-3, 139)[:, None] * np.eye(3)[2]
    points = np.concatenate([onto, np.tile(corner, (19, 1)), along])
    up, level, shares = np.tile([0.0, 1.0, 0.0], (len(points), 1)), np.zeros(len(points)), np.zeros((len(points), 3))
    feet = Feet(points, up, level, np.zeros(len(points), dtype=np.int64), shares)
    sweep, t = np.repeat([0, 1], [38, 139]), 1e-3 * np.arange(len(points))
    window = bin_samples(Samples(feet, np.array([38]), False, sweep, t), 1e-4, 0.0, 1e-3)
    assert len(window.starts) == 3 and np.isfinite(window.place).all()
