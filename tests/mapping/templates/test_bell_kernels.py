"""The compiled trace of a bell against the dilation of its meridian point by point."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.geometry.templates.bell_kernels import bell_trace

R = 1.0


@pytest.mark.parametrize("exponent", [0.5, 1.0, 30.0])
@pytest.mark.parametrize(
    ("height", "scale"), [(0.003, 0.03), (0.1, 1.0), (0.1, 0.01), (1.0, 0.01), (0.5, 0.1), (3.0, 1.0), (1e-6, 10.0)]
)
def test_the_trace_is_the_highest_place_of_the_ball(height: float, scale: float, exponent: float) -> None:
    spacing = 0.01
    table = np.empty(200)
    bell_trace(height, scale, exponent, R, table, spacing)
    places = spacing * np.arange(len(table))
    u = np.unique(np.concatenate([s * np.linspace(-1.0, 1.0, 20_001) for s in (scale, 10.0 * scale, 2.5 * R)]))
    z = height * (1.0 + u**2 / (exponent * scale**2)) ** -exponent
    for x, traced in zip(places[::5], table[::5], strict=True):
        under = u[np.abs(u - x) < R]
        felt = (z[np.abs(u - x) < R] + np.sqrt(R**2 - (under - x) ** 2) - R).max()
        assert traced == pytest.approx(felt, abs=3e-5 * height + 1e-9)
