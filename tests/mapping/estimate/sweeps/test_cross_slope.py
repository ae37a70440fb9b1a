"""Slopes across parallel sweeps, from the heights of a few neighbouring rows."""

import numpy as np
import pytest

from mapping.estimate.sweeps.normals import smooth_slope


@pytest.fixture
def rows() -> np.ndarray:
    """(500, 9) places of uneven rows, m; the own one is in the middle."""
    v = np.random.default_rng(1).uniform(0.6e-3, 1.4e-3, (500, 9)).cumsum(axis=1)
    return v - v[:, 4:5]


def test_a_parabola_has_its_slope_and_curvature_and_no_doubt(rows: np.ndarray) -> None:
    slope, bend, doubt = smooth_slope(rows, 0.3 * rows - 40.0 * rows**2)
    np.testing.assert_allclose(slope, 0.3, rtol=1e-11)
    np.testing.assert_allclose(bend, -80.0, rtol=1e-8)
    assert doubt.max() < 1e-10


def test_a_smooth_surface_is_known_within_its_doubt(rows: np.ndarray) -> None:
    length = 15e-3
    slope, _, doubt = smooth_slope(rows, length * np.sin(rows / length))
    assert np.abs(slope - 1.0).max() < 1e-4
    assert (np.abs(slope - 1.0) < doubt).mean() > 0.95


def test_a_kink_beside_the_sample_stays_outside(rows: np.ndarray) -> None:
    kink = 1.5e-3
    slope, _, _ = smooth_slope(rows, 20.0 * rows**2 + np.where(rows > kink, 0.5 * (rows - kink), 0.0))
    assert np.abs(slope).max() < 1e-10


def test_missing_rows_are_done_without(rows: np.ndarray) -> None:
    w = 0.3 * rows - 40.0 * rows**2
    few = rows.copy()
    few[:, 6:] = w[:, 6:] = np.nan
    np.testing.assert_allclose(smooth_slope(few, w)[0], 0.3, rtol=1e-11)
    few[:, :4] = w[:, :4] = np.nan
    assert np.isnan(smooth_slope(few, w)[0]).all()
