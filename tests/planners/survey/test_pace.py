"""Speeds that the noise allows."""

from __future__ import annotations

import pytest

from mapping.instrument.noise import Noise
from planners.survey.pace import fastest_speed, least_height

TIP = 0.01


def test_the_least_height_under_white_noise_grows_as_the_power_two_fifths_of_the_spacing() -> None:
    noise = Noise(0.2e-3)
    near, far = (least_height(noise, spacing, TIP, 5.0) for spacing in (1e-6, 32e-6))
    assert far / near == pytest.approx(32**0.4, rel=0.05)


def test_the_least_height_under_white_noise_is_that_of_the_matched_filter() -> None:
    sigma, spacing, ratio = 0.2e-3, 6e-6, 5.0
    height = least_height(Noise(sigma), spacing, TIP, ratio)
    width = (2 * TIP * height) ** 0.5
    assert height / sigma * (16 * width / (15 * spacing)) ** 0.5 == pytest.approx(ratio, rel=0.03)


def test_a_high_feature_is_swept_fast_and_a_low_one_slowly_and_one_that_no_sweep_shows_fast() -> None:
    noise = Noise(0.2e-3, 0.02e-3, 1e-3)
    chosen = [fastest_speed(noise, 5000.0, TIP, height, 0.03, 0.25) for height in (1e-3, 0.2e-3, 0.05e-3)]
    assert chosen[0] == chosen[2] == pytest.approx(0.25)
    assert 0.03 < chosen[1] < 0.25


def test_without_noise_any_speed_will_do() -> None:
    assert fastest_speed(Noise(0.0), 5000.0, TIP, 1e-5, 0.03, 0.25) == pytest.approx(0.25)
