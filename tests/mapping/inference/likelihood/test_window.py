"""Bins of a run: what is no noise stays in them."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.base.base import Base
from mapping.geometry.templates.shapes import cap_height
from mapping.inference.likelihood.window import bin_samples, gather
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
    return bin_samples(gather(trace, base, np.array([[0.0, 0.0, R]]), 7e-3), WIDTH, SIGMA, scale)


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
