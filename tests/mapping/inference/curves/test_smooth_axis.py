"""Smooth axis: courses that bend both ways."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import CourseError
from mapping.inference.curves import smooth_axis


def test_two_half_circles_are_followed_to_a_hundredth_of_their_radius() -> None:
    turn = np.linspace(0.0, np.pi, 30)
    half = np.column_stack([np.sin(turn), 1.0 - np.cos(turn)])
    line, _ = smooth_axis(10e-3 * np.concatenate([-half[:0:-1], half]), 20e-6)
    off = np.abs(np.hypot(line[:, 0], np.abs(line[:, 1]) - 10e-3) - 10e-3)
    assert off.max() < 0.1e-3


def test_a_straight_line_pays_for_no_bend() -> None:
    crossings = np.column_stack([np.linspace(0.0, 40e-3, 30), 20e-6 * np.random.default_rng(3).standard_normal(30)])
    assert smooth_axis(crossings, 20e-6)[1] == 1


@pytest.mark.parametrize("crossing", [0.0, np.nan])
def test_crossings_in_one_place_are_no_course(crossing: float) -> None:
    with pytest.raises(CourseError, match="two places"):
        smooth_axis(np.full((12, 3), crossing), 20e-6)
