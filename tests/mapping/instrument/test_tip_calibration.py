"""Tip calibration against spheres and rings whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from hw.simulated.noise_source import NoiseSource
from mapping.errors import CalibrationError
from mapping.instrument.tip_calibration import calibrate_tip
from mapping.trace import Trace

REFERENCE, TIP = 0.0125, 0.010
CENTER = np.array([0.3, -0.2, 0.1])
PAPER = NoiseSource(white=2e-4, correlated=2e-5, correlation_length=1e-3)


def lines_on_sphere(noise: NoiseSource, seed: int, lines: int = 8, spacing: float = 6e-6, tip: float = TIP) -> Trace:
    """Meridians from 60 degrees on one side of the pole to 60 on the other."""
    rng, radius, parts = np.random.default_rng(seed), REFERENCE + tip, []
    for number in range(lines):
        angle = np.arange(-np.pi / 3, np.pi / 3, spacing / radius)
        turn = np.pi * number / lines
        unit = np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
        centers = CENTER + radius * unit + noise.of_centers(rng, len(angle), spacing)
        t = 10.0 * number + np.arange(len(angle)) * spacing / 0.03
        parts.append(Trace(t, centers, np.full(len(t), number), 1.0))
    return Trace.concatenate(parts)


def test_without_noise_the_radius_is_exact_at_any_scale() -> None:
    for scale in (1.0, 2.0**-20, 2.0**10):
        trace = lines_on_sphere(NoiseSource(), 1, spacing=1e-4)
        scaled = Trace(trace.t, trace.centers * scale, trace.sweep, 1.0)
        found = calibrate_tip(scaled, REFERENCE * scale)
        assert found.radius == pytest.approx(TIP * scale, rel=1e-12)
        assert np.abs(found.center - CENTER * scale).max() < 1e-12 * scale


def test_at_the_papers_noise_the_radius_is_found_within_ten_micrometres() -> None:
    found = calibrate_tip(lines_on_sphere(PAPER, 7, lines=24), REFERENCE)
    assert abs(found.radius - TIP) < 1e-5
    assert 1e-6 < found.radius_sd < 6e-6
    assert found.noise.white == pytest.approx(2e-4, rel=0.02)
    assert found.noise.correlated == pytest.approx(2e-5, rel=0.4)


def test_a_ring_gives_the_same_tip_from_inside() -> None:
    angle = np.linspace(0, 2 * np.pi, 4000)
    radius = 0.03 - TIP
    flat = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 1e-3 * np.sin(3 * angle)])
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    first = np.cross(axis, [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    frame = np.stack([first, np.cross(axis, first), axis])
    trace = Trace(angle, CENTER + flat @ frame, np.zeros(len(angle)), 1.0)
    found = calibrate_tip(trace, 0.03, shape="ring", axis=axis)
    assert found.radius == pytest.approx(TIP, rel=1e-9)


def test_a_direction_that_triggers_late_stands_out_on_the_map() -> None:
    trace = lines_on_sphere(NoiseSource(white=1e-6), 3, spacing=1e-4)
    east = trace.centers[:, 0] - CENTER[0] > 0.008
    centers = np.where(east[:, None], trace.centers - 2e-5 * np.array([1.0, 0, 0]), trace.centers)
    found = calibrate_tip(Trace(trace.t, centers, trace.sweep, 1.0), REFERENCE)
    worst = found.directions[found.deviations.argmin()]
    assert worst[0] > 0.4 and found.deviations.min() < -4e-6


def test_the_uncertainty_of_the_reference_is_in_that_of_the_tip() -> None:
    found = calibrate_tip(lines_on_sphere(NoiseSource(white=1e-6), 1, spacing=1e-4), REFERENCE, reference_sd=3e-6)
    assert found.radius_sd == pytest.approx(3e-6, rel=0.02)


def test_samples_that_say_nothing_are_refused() -> None:
    line = np.column_stack([np.linspace(0, 1, 50), np.zeros(50), np.zeros(50)])
    with pytest.raises(CalibrationError, match="two directions"):
        calibrate_tip(Trace(np.arange(50.0), line, np.zeros(50), 1.0), REFERENCE)
    with pytest.raises(CalibrationError, match="16"):
        calibrate_tip(Trace(np.arange(5.0), line[:5], np.zeros(5), 1.0), REFERENCE)
    with pytest.raises(CalibrationError, match="no tip radius fits"):
        calibrate_tip(lines_on_sphere(NoiseSource(), 1, spacing=1e-4), 0.05)


@pytest.mark.slow
def test_the_ninety_percent_interval_covers_the_truth_in_ninety_percent_of_a_hundred_seeds() -> None:
    inside, error = 0, []
    for seed in range(100):
        found = calibrate_tip(lines_on_sphere(PAPER, seed), REFERENCE)
        inside += found.interval[0] <= TIP <= found.interval[1]
        error.append((found.radius - TIP) / found.radius_sd)
    assert 84 <= inside <= 96
    assert np.abs(error).max() < 4.0
