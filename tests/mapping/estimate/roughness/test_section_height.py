"""Sections by ISO 5436-1 and Wolf's pruning, against profiles whose heights are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray
from mapping.estimate.roughness import flat_height, level_difference, round_height, wolf_height

U = np.linspace(-3e-3, 3e-3, 6001)
WIDTH = 1e-3
TILT = 0.01 * U + 2e-6


def groove(depth: float, rounding: float) -> FloatArray:
    """A flat bottom 1 mm wide; its edges are rounded over `rounding`, its walls lean likewise."""
    return -depth * np.clip((0.5 * WIDTH + rounding - np.abs(U)) / (2.0 * rounding), 0.0, 1.0)


@pytest.mark.parametrize("rounding", [1e-6, 0.1e-3, 0.3e-3])
def test_the_depth_of_a_flat_groove_is_free_of_its_edges_and_of_tilt(rounding: float) -> None:
    z = groove(5e-6, rounding) + TILT
    assert flat_height(U, z, WIDTH) == pytest.approx(-5e-6, rel=1e-9)
    assert flat_height(U, -groove(5e-6, rounding), WIDTH) == pytest.approx(5e-6, rel=1e-9)


def test_noise_leaves_the_depth_as_uncertain_as_its_portions_say() -> None:
    rng = np.random.default_rng(5)
    found = [flat_height(U, groove(5e-6, 1e-5) + rng.normal(0.0, 1e-6, len(U)), WIDTH) for _ in range(200)]
    # 333 samples in the middle, 1333 outside; the slope, symmetric, costs nothing
    expected = 1e-6 * np.sqrt(1.0 / 333 + 1.0 / 1333)
    assert np.mean(found) == pytest.approx(-5e-6, abs=4.0 * expected / np.sqrt(200))
    assert np.std(found) == pytest.approx(expected, rel=0.2)


def test_a_rounded_bottom_is_measured_at_its_deepest() -> None:
    shifted = U - 0.05 * WIDTH
    z = np.where(np.abs(shifted) < 0.5 * WIDTH, -5e-6 * (1.0 - (2.0 * shifted / WIDTH) ** 2), 0.0) + TILT
    assert round_height(U, z - TILT, WIDTH) == pytest.approx(-5e-6, rel=1e-9)
    assert round_height(U, z, WIDTH) == pytest.approx(-5e-6, rel=1e-9)
    assert flat_height(U, z, WIDTH) > round_height(U, z, WIDTH)


def test_a_step_is_the_distance_of_two_parallel_lines() -> None:
    z = 3e-6 * (U > 0.0) + TILT
    assert level_difference(U, z, 0.2e-3, 1e-3) == pytest.approx(3e-6, rel=1e-9)
    assert level_difference(-U, z, 0.2e-3, 1e-3) == pytest.approx(-3e-6, rel=1e-9)


def test_what_is_not_all_there_has_no_height() -> None:
    part = U > -0.9e-3  # one outer portion is cut off after 0.07 of its 0.67 mm
    assert np.isfinite(flat_height(U[part], groove(5e-6, 1e-5)[part], WIDTH))
    none = U > -0.8e-3
    for height in (flat_height, round_height):
        assert np.isnan(height(U[none], groove(5e-6, 1e-5)[none], WIDTH))
    assert np.isnan(level_difference(U[U > 0.0], U[U > 0.0], 0.2e-3, 1e-3))


def test_wolf_prunes_a_hill_at_its_prominence_not_at_its_height() -> None:
    hill, shoulder = np.exp(-((U / 0.3e-3) ** 2)), np.exp(-(((U - 1e-3) / 0.3e-3) ** 2))
    z = 5e-6 * hill + 3e-6 * shoulder
    spacing = float(U[1] - U[0])
    near = np.abs(U - 1e-3) < 0.3e-3
    saddle = z[(U > 0.2e-3) & (U < 0.9e-3)].min()
    expected = z[near].max() - saddle
    assert wolf_height(z, spacing, near, 0.1e-3, up=True) == pytest.approx(expected, rel=0.01)
    assert wolf_height(-z, spacing, near, 0.1e-3, up=False) == pytest.approx(expected, rel=0.01)
    flank = (U > -0.4e-3) & (U < -0.2e-3)
    assert np.isnan(wolf_height(z, spacing, flank, 0.1e-3, up=True))
