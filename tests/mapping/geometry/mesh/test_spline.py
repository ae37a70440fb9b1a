"""Splines of our own give what scipy's give, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from mapping.geometry.mesh import Spline, spline_design


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("pieces", [1, 2, 17])
def test_values_slopes_and_designs_are_those_of_scipy(degree: int, pieces: int) -> None:
    rng = np.random.default_rng(degree)
    low, high = 1e-3, 7e-3
    knots = np.concatenate([[low] * degree, np.linspace(low, high, pieces + 1), [high] * degree])
    coefficients = rng.standard_normal(len(knots) - degree - 1)
    inside = np.concatenate([knots, rng.uniform(low, high, 300)])
    places = np.concatenate([inside, [0.0, 8e-3]])
    mine, theirs = Spline(knots, coefficients, degree), BSpline(knots, coefficients, degree)
    np.testing.assert_array_equal(
        spline_design(inside, knots, degree), BSpline.design_matrix(inside, knots, degree).toarray()
    )
    np.testing.assert_array_equal(mine(places), theirs(places))
    np.testing.assert_array_equal(mine.derivative()(places), theirs.derivative()(places))
    assert float(mine(inside[5])) == float(theirs(inside[5]))
