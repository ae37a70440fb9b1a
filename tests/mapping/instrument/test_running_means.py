"""Means of neighbours: over as many values as there are to either side."""

from __future__ import annotations

import numpy as np

from mapping.instrument.averaging import running_mean, running_means


def test_each_mean_is_over_the_values_that_there_are_whatever_the_reach() -> None:
    values, halves = np.random.default_rng(3).standard_normal(40), np.array([0, 1, 7, 39, 200])
    means = running_means(values, halves)
    for half, row in zip(halves, means, strict=True):
        expected = [values[max(i - half, 0) : i + half + 1].mean() for i in range(40)]
        np.testing.assert_allclose(row, expected, atol=1e-14)
        np.testing.assert_array_equal(row, running_mean(values, half))
