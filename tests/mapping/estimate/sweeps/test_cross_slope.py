"""Slopes across parallel sweeps, from the heights of a few neighbouring rows."""

from dataclasses import replace

import numpy as np
import pytest

from mapping import Trace
from mapping.estimate.sweeps.contact_row import ContactRow, contact_row
from mapping.estimate.sweeps.normals import POINTS_AT_ONCE, smooth_slope, surface_normals


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


@pytest.mark.parametrize("samples", [40, POINTS_AT_ONCE // 4])  # the latter are computed in more than one part
def test_rows_have_the_same_normals_in_whatever_order_their_sweeps_are_numbered(samples: int) -> None:
    x, count, aside = np.linspace(0.0, 8e-3, samples), 5, np.array([0.0, 1e-3, 0.0])
    row = np.column_stack([x, 0 * x, 2e-3 + 2e-4 * np.sin(800 * x)])
    centers = np.concatenate([row + k * aside for k in range(count)])
    up = np.tile([0.0, 0.0, 1.0], (len(centers), 1))
    each = contact_row(row, up[:samples], 1e-3)
    found = []
    for numbers in (range(count), range(count, 0, -1)):  # in descending order sweeps are no parts of the arrays
        trace = Trace(1e-4 * np.arange(len(centers)), centers, np.repeat([*numbers], samples), 1e-3)
        contacts = ContactRow.joined(
            [
                replace(
                    each,
                    centers=each.centers + k * aside,
                    sample=each.sample + k * samples,
                    nearest=each.nearest + k * samples,
                )
                for k in range(count)
            ]
        )
        found.append(surface_normals(trace, contacts, up)[0])
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-12)
    slope = 2e-4 * 800 * np.cos(800 * x)
    true = np.column_stack([-slope, 0 * x, np.ones_like(x)]) / np.sqrt(1 + slope**2)[:, None]
    step = 800 * (x[1] - x[0])  # of the phase: tangents are of fourth order
    np.testing.assert_allclose(found[0][2 * samples :][:samples], true, rtol=0, atol=max(step**4, 1e-9))
