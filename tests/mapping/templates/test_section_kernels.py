"""Lines with a polygon for a section: their traces against dilation by brute force."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray
from mapping.geometry.templates import section_heights, step_height


def trace(
    u: FloatArray, s: FloatArray, corners: list[tuple[float, float]], tip: float, bend: float = 0.0
) -> FloatArray:
    """Heights at distances u across and s along a line that ends at s = 0."""
    across, up = (np.array([each]) for each in zip(*corners, strict=True))
    out = np.empty((1, len(u)))
    nodes = np.zeros((0, len(u), 1))
    ends = np.array([[-1.0, 0.0]])
    section_heights(
        s[:, None], u[:, None], nodes, *(np.full((len(u), 1), bend),) * 2, np.zeros((1, 0)), ends, across, up, tip, out
    )
    return np.asarray(out[0])


def dilated(u: FloatArray, s: FloatArray, corners: list[tuple[float, float]], tip: float) -> FloatArray:
    """The same by trying all points of the section, at s >= 0."""
    x, z = zip(*corners, strict=True)
    places = np.linspace(-x[-1], x[-1], 1601)
    heights = np.interp(np.abs(places), x, z)
    # of a line that goes on to s < 0 the cross-section at its end is the nearest to what lies beyond
    gap = (u[:, None] - places) ** 2 + (s**2)[:, None]
    arcs = heights - gap / (tip + np.sqrt(np.clip(tip**2 - gap, 0.0, None)))
    return np.asarray(np.maximum(np.where(gap < tip**2, arcs, -1.0).max(axis=1), 0.0))


@pytest.mark.parametrize(
    "corners",
    [
        pytest.param([(1e-3, 0.4e-3), (1.001e-3, 0.0)], id="a bar"),
        pytest.param([(0.0, 0.5e-3), (0.4e-3, 0.0)], id="a steep roof"),
        pytest.param([(0.0, 0.1e-3), (1.5e-3, 0.0)], id="a roof that the ball rolls down on"),
        pytest.param([(0.2e-3, 0.4e-3), (0.5e-3, 0.3e-3), (2.0e-3, 0.0)], id="two slopes"),
    ],
)
@pytest.mark.parametrize("tip", [10e-3, 1e-3])
@pytest.mark.parametrize("beyond", [0.0, 0.4e-3])
def test_the_ball_rests_on_what_holds_it_highest(corners: list[tuple[float, float]], tip: float, beyond: float) -> None:
    u = np.linspace(-4e-3, 4e-3, 801)
    s = np.full(len(u), beyond)
    # the grid of places misses a corner by up to 1.3 um: that far down a slope of the ball of up to 45 degrees
    np.testing.assert_allclose(trace(u, s, corners, tip), dilated(u, s, corners, tip), atol=1.5e-6)


def test_beyond_its_end_a_wide_bar_is_a_step() -> None:
    s = np.linspace(-1e-3, 4e-3, 51)
    bar = trace(np.zeros(len(s)), s, [(20e-3, 0.5e-3), (20.1e-3, 0.0)], 10e-3)
    np.testing.assert_allclose(bar, step_height(-s, 0.5e-3, 10e-3), atol=1e-15)


def test_it_scales_with_the_unit_of_length() -> None:
    u = np.linspace(-4e-3, 4e-3, 101)
    corners = [(0.2e-3, 0.4e-3), (0.5e-3, 0.3e-3), (2.0e-3, 0.0)]
    scaled = [(2.0**-20 * x, 2.0**-20 * z) for x, z in corners]
    small = trace(2.0**-20 * u, 0.0 * u, scaled, 2.0**-20 * 10e-3)
    np.testing.assert_array_equal(small, 2.0**-20 * trace(u, 0.0 * u, corners, 10e-3))
