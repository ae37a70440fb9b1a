"""Samples further apart than the ball is wide leave details of any height unfelt between them."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import Trace
from mapping.detection.path import sparse_samples


def along(step: float, tip: float, noise: float = 0.0) -> Trace:
    rng = np.random.default_rng(3)
    x = step * np.arange(200)
    centers = np.column_stack([x, 0.0 * x, 0.0 * x]) + noise * rng.standard_normal((200, 3))
    return Trace(1.0 * np.arange(200), centers, np.zeros(200, dtype=int), tip)


@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_it_is_told_how_wide_a_detail_of_any_height_may_lie_between_two_samples(noise: float) -> None:
    found = sparse_samples(along(20e-6, 0.5e-6, noise * 1e-6))
    assert found is not None and found.unfelt == pytest.approx(19e-6, rel=0.1)
    assert "a detail of any height" in found.sentence() and found.record()["step"] == pytest.approx(20e-6, rel=0.1)


def test_a_ball_that_reaches_from_sample_to_sample_misses_no_height() -> None:
    assert sparse_samples(along(20e-6, 10.001e-6)) is None
    assert sparse_samples(along(20e-6, 9.999e-6)) is not None


def test_noise_that_exceeds_the_step_is_no_distance() -> None:
    """A finger of 5 kHz advances by 6 um a sample, and each is 20 um off."""
    assert sparse_samples(along(6e-6, 6e-6, noise=20e-6)) is None
