"""Slopes across parallel sweeps, from the heights of a few neighbouring rows."""

from collections.abc import Sequence

import numpy as np
import pytest

from mapping import Trace
from mapping.estimate.sweeps.normals import CURVES_HELD, SurfaceNormals, smooth_slope


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


def wavy_rows(numbers: Sequence[int], samples: int) -> Trace:
    """Rows 1 mm apart over a wave along them, whose sweeps have these numbers."""
    x = np.linspace(0.0, 8e-3, samples)
    row = np.column_stack([x, 0 * x, 2e-3 + 2e-4 * np.sin(800 * x)])
    centers = np.concatenate([row + np.array([0.0, k * 1e-3, 0.0]) for k in range(len(numbers))])
    return Trace(1e-4 * np.arange(len(centers)), centers, np.repeat([*numbers], samples), 1e-3)


def normals_of(trace: Trace) -> np.ndarray:
    """(N, 3) normals at the samples."""
    surface = SurfaceNormals(trace, np.tile([0.0, 0.0, 1.0], (len(trace), 1)))
    return np.concatenate([surface.of(k)[1] for k in range(len(surface.parts))])


@pytest.mark.parametrize("samples", [40, 4000])
def test_rows_have_the_same_normals_in_whatever_order_their_sweeps_are_numbered(samples: int) -> None:
    forth, back = (normals_of(wavy_rows(numbers, samples)) for numbers in (range(5), range(5, 0, -1)))
    np.testing.assert_allclose(forth, back, rtol=0, atol=1e-12)
    x = np.linspace(0.0, 8e-3, samples)
    slope = 2e-4 * 800 * np.cos(800 * x)
    true = np.column_stack([-slope, 0 * x, np.ones_like(x)]) / np.sqrt(1 + slope**2)[:, None]
    step = 800 * (x[1] - x[0])  # of the phase: tangents are of fourth order
    np.testing.assert_allclose(forth[2 * samples :][:samples], true, rtol=0, atol=max(step**4, 1e-9))


def test_a_sweep_that_is_felt_in_two_parts_has_the_normals_of_one_felt_at_once() -> None:
    whole, samples = wavy_rows(range(5), 41), 41
    late = np.arange(2 * samples + 20, 3 * samples)  # the rest of the middle sweep comes last
    order = np.append(np.delete(np.arange(len(whole)), late), late)
    parted = Trace(whole.t, whole.centers[order], whole.sweep[order], whole.tip_radius)
    found = np.empty((len(whole), 3))
    found[order] = normals_of(parted)
    # tangents beside the cut are one-sided
    np.testing.assert_allclose(found, normals_of(whole), rtol=0, atol=1e-2)
    away = np.abs(np.arange(len(whole)) % samples - 20) > 3
    np.testing.assert_allclose(found[away], normals_of(whole)[away], rtol=0, atol=1e-9)


def test_rows_beyond_those_whose_curves_are_held_are_laid_out_again() -> None:
    passes = wavy_rows(range(5), 40)
    many = 3 * CURVES_HELD
    again = np.concatenate([passes.centers[:40] + np.array([0.0, 1e-9 * k, 0.0]) for k in range(many)])
    centers = np.concatenate([again, passes.centers[40:]])
    trace = Trace(1e-4 * np.arange(len(centers)), centers, np.repeat(np.arange(many + 4), 40), 1e-3)
    surface = SurfaceNormals(trace, np.tile([0.0, 0.0, 1.0], (len(trace), 1)), slack=1e-9)
    few = SurfaceNormals(passes, np.tile([0.0, 0.0, 1.0], (len(passes), 1)), slack=1e-9)
    np.testing.assert_allclose(surface.of(many)[1], few.of(1)[1], rtol=0, atol=1e-6)
