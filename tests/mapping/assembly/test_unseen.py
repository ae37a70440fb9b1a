"""Crossings that the heights of their own sweep deny."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.assembly.false_crossings import is_plateau_end, is_unseen
from mapping.assembly.linking.inspection import Inspection
from mapping.detection.crossing import Crossing


def along_x(height, sd: float = 1e-5):
    x = np.linspace(-0.02, 0.02, 81)
    return Inspection(
        np.column_stack([x, 0 * x, 0 * x]), height(x), np.full(81, sd), np.zeros(81, dtype=np.int64), 5e-4
    )


def crossing(height: float, snr: float) -> Crossing:
    up, way = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    kind = "convex" if height > 0 else "concave"
    return Crossing(0, 0.0, np.zeros(3), up, way, kind, height, abs(height) / snr, 1e-5, 3e-3, 0.0, snr, True, 0, 1)


@pytest.mark.parametrize("depth", [0.0, 0.6e-3])
def test_the_end_of_a_plateau_is_no_hollow_but_a_hollow_beside_one_is(depth):
    place = along_x(lambda x: np.where(x < -2e-3, 0.6e-3, -depth * np.maximum(1 - (x / 2.5e-3) ** 2, 0.0)))
    assert is_plateau_end(crossing(-0.6e-3, 70.0), place) == (depth == 0.0)


@pytest.mark.parametrize("height", [0.0, 0.6e-3])
def test_what_claims_to_be_clear_must_show_in_the_heights(height):
    place = along_x(lambda x: height * np.maximum(1 - (x / 3e-3) ** 2, 0.0))
    assert is_unseen(crossing(0.6e-3, 40.0), place) == (height == 0.0)
    assert not is_unseen(crossing(0.6e-3, 6.0), place)


def test_what_shows_in_the_heights_is_seen_whatever_the_places_are_said_to_scatter():
    """The claim and the heights are compared as heights: the noise of one is not divided by that of the other."""
    for sd in (1e-8, 1e-6, 1e-4):
        high = along_x(lambda x: 0.6e-3 * np.maximum(1 - (x / 3e-3) ** 2, 0.0), sd)
        assert not is_unseen(crossing(0.6e-3, 15_000.0), high)
        assert is_unseen(crossing(0.6e-3, 15_000.0), along_x(lambda x: 0 * x, sd))
