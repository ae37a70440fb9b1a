"""The smoothing spline is the minimiser that it claims to be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_smoothing_spline

from mapping.estimate.sweeps.smoothing_spline import smoothing_spline


@pytest.mark.parametrize("lam", [1e-3, 1.0, 4096.0])
def test_it_is_scipys_and_its_derivatives_too(lam: float) -> None:
    rng = np.random.default_rng(3)
    x, weight = np.cumsum(rng.uniform(0.5, 1.5, 200)), rng.integers(1, 30, 200)
    y = np.column_stack([x, np.sin(x / 20) + 0.1 * rng.standard_normal(200)])
    ours, theirs = smoothing_spline(x, y, weight, lam), make_smoothing_spline(x, y, w=weight, lam=lam)
    for order in range(3):
        assert np.abs(ours(x, order) - theirs(x, order)).max() < 1e-8


def test_without_smoothing_it_interpolates() -> None:
    x = np.array([0.0, 1.0, 1.5, 4.0, 5.0])
    y = np.sin(x)[:, None]
    between = np.linspace(0.0, 5.0, 41)
    natural = CubicSpline(x, y, bc_type="natural")
    assert smoothing_spline(x, y, np.ones(5, dtype=np.int64), 0.0)(between) == pytest.approx(natural(between))
