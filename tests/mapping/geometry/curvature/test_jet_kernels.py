"""Fits by moments, which noise allows, are those by reflections."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.geometry.curvature.jet import LEAST_NOISE
from mapping.geometry.curvature.jet_kernels import fit_jets
from mapping.geometry.curvature.neighbours import Neighbours


@pytest.mark.parametrize("noise", [LEAST_NOISE, 1e-3])
@pytest.mark.parametrize("thin", [1.0, 1e-3, 0.0])
def test_fits_by_moments_differ_from_those_by_reflections_by_far_less_than_noise_makes_them(noise, thin):
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-1.0, 1.0, (2, 1200))
    points = np.column_stack([x, thin * y, 0.3 * x**2 - 0.1 * x * thin * y + 0.2 * x**4])
    points[:, 2] += noise * rng.standard_normal(len(points))
    normals = np.broadcast_to([0.0, 0.0, 1.0], points.shape).copy()
    chosen, sizes = np.arange(0, 1200, 40), np.array([13, 19, 25, 33, 49, 137, 547])
    near = Neighbours(points).query(points[chosen], 547)
    bends = np.full(len(chosen), -0.6)
    kept, less = (fit_jets(points, normals, near, chosen, bends, 0.0, sizes, 6, way) for way in (False, True))
    known = np.isfinite(kept[1])
    np.testing.assert_array_equal(known, np.isfinite(less[1]))
    assert known.any() == (thin > 0.0)
    off = np.abs(kept[0] - less[0])[known].max(axis=1, initial=0.0)
    assert (off <= 1e-3 * noise * kept[1][known]).all()
    np.testing.assert_allclose(less[1][known], kept[1][known], rtol=1e-3)
    np.testing.assert_allclose(less[2][known], kept[2][known], rtol=1e-3)
