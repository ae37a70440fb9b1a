"""Curvature-limited smoothing: no bias, nothing impossible left, features kept."""

import numpy as np
import pytest

from mapping.estimate.envelope.profile_envelope import envelope_heights
from mapping.estimate.sweeps.smoothing import smooth
from mapping.estimate.sweeps.smoothing_spline import curvature_sd, position_sd, smoothing_length
from mapping.instrument.noise import Noise
from mapping.trace import Trace

R, SIGMA, SPACING = 0.01, 2e-4, 6e-6  # the paper's apparatus (theory section 1.1)


def noisy_profile(height, seed=0, extent=0.03):
    x = np.arange(-extent, extent, SPACING)
    rng = np.random.default_rng(seed)
    shifts = SIGMA * rng.standard_normal((2, len(x)))
    return x, Trace.from_profile(x + shifts[0], height(x) + shifts[1], R, t=np.arange(len(x)) * 2e-4)


def wire(x, height=0.65e-3):
    reach = R + height / 2
    return R + np.maximum(height - x**2 / (reach + np.sqrt(np.maximum(reach**2 - x**2, 0.0))), 0.0)


BODIES = {
    "plane": lambda x: np.full_like(x, R),
    "bowl": lambda x: 0.05 - np.sqrt(0.04**2 - x**2),
    "dome": lambda x: np.sqrt(0.06**2 - x**2) - 0.05,
    "wire": wire,
}


@pytest.mark.parametrize("body", BODIES)
def test_the_envelope_of_raw_noise_is_biased_by_two_to_three_sigma_and_ours_by_less_than_a_tenth(body):
    height = BODIES[body]
    x, noisy = noisy_profile(height)
    inner = np.abs(x) < 0.02
    true = envelope_heights(x, height(x), R)[0]
    naive = envelope_heights(noisy.centers[:, 0], noisy.centers[:, 2], R, x)[0]
    assert -3.5 * SIGMA < (naive - true)[inner].mean() < -2 * SIGMA

    smoothed = smooth(noisy, Noise(SIGMA)).trace.centers
    ours = envelope_heights(smoothed[:, 0], smoothed[:, 2], R, x)[0]
    assert abs((ours - true)[inner].mean()) < 0.1 * SIGMA


@pytest.mark.parametrize("body", BODIES)
def test_the_noise_is_estimated_where_it_is_not_given(body):
    _, noisy = noisy_profile(BODIES[body])
    assert smooth(noisy).noise.white == pytest.approx(SIGMA, rel=0.1)


def test_the_predicted_noise_is_what_remains():
    _, noisy = noisy_profile(BODIES["plane"], extent=0.3)
    smoothed = smooth(noisy, Noise(SIGMA))
    residual = smoothed.trace.centers[:, 2] - R
    inner = np.abs(smoothed.trace.centers[:, 0]) < 0.29
    assert residual[inner].std() == pytest.approx(smoothed.sd, rel=0.1)
    limit = curvature_sd(Noise(SIGMA), SPACING, smoothed.scale)
    assert smoothed.curvature[inner].std() == pytest.approx(limit, rel=0.15)
    assert limit == pytest.approx(1 / (3 * R), rel=1e-3)


def test_white_noise_alone_has_its_closed_form():
    noise, h = Noise(SIGMA), 5e-4
    # Integrals of 1 / (1 + x^4)^2 and of x^4 / (1 + x^4)^2 over the positive axis, over pi.
    assert position_sd(noise, SPACING, h) == pytest.approx(SIGMA * np.sqrt(SPACING / h * 3 * np.sqrt(2) / 16), rel=1e-3)
    assert curvature_sd(noise, SPACING, h) == pytest.approx(SIGMA * np.sqrt(SPACING / h**5 * np.sqrt(2) / 16), rel=1e-3)


def test_correlated_noise_asks_for_longer_smoothing():
    white = smoothing_length(Noise(SIGMA), SPACING, R)
    correlated = smoothing_length(Noise(0.0, SIGMA, 1e-3), SPACING, R)
    assert correlated > 1.3 * white


def test_impossible_points_are_removed_and_leave_no_trace():
    x, noisy = noisy_profile(BODIES["plane"])
    centers = noisy.centers.copy()
    spike = slice(5000, 5030)
    centers[spike, 2] += 0.02  # 20 mm up and down within 0.2 mm: no ball of 10 mm does that
    spiked = Trace(noisy.t, centers, noisy.sweep, R)
    smoothed = smooth(spiked, Noise(SIGMA))
    assert 30 <= smoothed.removed < 1000
    assert (smoothed.curvature < 2 / R).all()
    near = np.abs(smoothed.trace.centers[:, 0] - x[5015]) < 0.01
    assert near.sum() > 100
    assert np.abs(smoothed.trace.centers[near, 2] - R).max() < 2 * SIGMA


def test_nothing_is_removed_where_everything_is_possible():
    for body in BODIES.values():
        assert smooth(noisy_profile(body)[1], Noise(SIGMA)).removed == 0


def test_a_trace_without_noise_is_left_as_it_is():
    x = np.linspace(-0.01, 0.01, 500)
    trace = Trace.from_profile(x, wire(x), R)
    assert smooth(trace, Noise(0.0)).trace is trace


def test_sweeps_are_smoothed_one_by_one():
    _, first = noisy_profile(BODIES["plane"])
    second = Trace(first.t + 100, first.centers + np.array([0, 0.01, 0.05]), first.sweep + 1, R)
    both = smooth(Trace.concatenate([first, second]), Noise(SIGMA)).trace
    assert set(both.sweep) == {0, 1}
    assert np.abs(both.centers[both.sweep == 0, 2] - R).max() < SIGMA
    assert np.abs(both.centers[both.sweep == 1, 2] - R - 0.05).max() < SIGMA


@pytest.mark.parametrize("scale", [1e-6, 1e4])
def test_the_size_of_the_tip_does_not_matter(scale):
    _, noisy = noisy_profile(wire)
    once = smooth(noisy, Noise(SIGMA))
    scaled = smooth(Trace(noisy.t, noisy.centers * scale, noisy.sweep, R * scale), Noise(SIGMA * scale))
    assert scaled.scale == pytest.approx(once.scale * scale, rel=1e-5)
    np.testing.assert_allclose(scaled.trace.centers, once.trace.centers * scale, atol=1e-6 * SIGMA * scale)


@pytest.mark.parametrize("count", [0, 1, 2, 4, 5, 20])
def test_very_short_sweeps_pass(count):
    trace = Trace.from_profile(np.arange(count) * 1e-4, np.full(count, R), R)
    assert len(smooth(trace, Noise(SIGMA)).trace) == count
