"""Smooth hollows against brute-force dilation of their sections."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray
from mapping.geometry.templates import smooth_groove_heights, smooth_pit_heights

TIP = 3e-3


def section(u: FloatArray, depth: float, half: float, taper: float) -> FloatArray:
    """Heights (N,) of the hollow itself."""
    if taper == 0.0:
        return -depth * 0.5 ** ((u / half) ** 2)
    base = 1.0 + (2.0**taper - 1.0) * (u / half) ** 2
    return -depth * np.where(base > 0.0, np.maximum(base, 1e-300) ** (-1.0 / taper), 0.0)


def rolled(at: FloatArray, tip: float, *shape: float) -> FloatArray:
    """Heights (N,) at which a ball rests over each place, by trying every place of the section."""
    u = np.linspace(-15e-3, 15e-3, 600_001)
    z = section(u, *shape)
    near = [np.abs(u - x) < tip for x in at]
    return np.array([(z[m] + np.sqrt(tip**2 - (u[m] - x) ** 2) - tip).max() for m, x in zip(near, at, strict=True)])


@pytest.mark.parametrize("taper", [-0.6, -0.4, 0.0, 0.3, 1.0])
@pytest.mark.parametrize(("depth", "half"), [(0.5e-3, 0.9e-3), (0.5e-3, 0.3e-3), (0.1e-3, 2e-3), (2e-3, 0.9e-3)])
def test_a_ball_rests_on_a_smooth_pit_as_on_each_of_its_points(taper: float, depth: float, half: float) -> None:
    at = np.concatenate([np.linspace(0.0, 0.5e-3, 11), np.linspace(0.6e-3, 6e-3, 31)])
    out = np.empty((1, len(at)))
    nodes = at[:, None]
    shape = np.array([depth]), np.array([half]), np.array([taper])
    smooth_pit_heights(nodes, 0.0 * nodes, np.zeros(2), np.zeros((1, 2)), *shape, TIP, out)
    np.testing.assert_allclose(out[0], rolled(at, TIP, depth, half, taper), atol=2e-5 * depth)
    assert (out[0] < -0.02 * depth).sum() > 4


def test_a_groove_is_felt_as_its_section_as_the_base_bends_and_ends_round() -> None:
    """Along a line over which the base bends more and more, and beyond its end."""
    depth, half, taper = 0.4e-3, 0.8e-3, -0.4
    bend = np.linspace(-40.0, 120.0, 33)[:, None]
    s, aside = np.full_like(bend, 5e-3), np.full_like(bend, 0.5e-3)
    shape = np.array([depth]), np.array([half]), np.array([taper])
    line = np.zeros((0, *bend.shape)), bend, 0.0 * bend, np.zeros((1, 0)), np.array([[0.0, 10e-3]])
    out = np.empty((1, len(bend)))
    smooth_groove_heights(s, aside, *line, *shape, TIP, out)
    expected = [rolled(np.array([0.5e-3]), 1.0 / (1.0 / TIP + k), depth, half, taper)[0] for k in bend[:, 0]]
    np.testing.assert_allclose(out[0], expected, atol=1e-3 * depth)
    assert np.ptp(expected) > 0.1 * depth
    beyond = np.linspace(0.0, 2e-3, 33)[:, None]
    flat = np.zeros((0, *bend.shape)), 0.0 * bend, 0.0 * bend, np.zeros((1, 0)), np.array([[0.0, 10e-3]])
    smooth_groove_heights(10e-3 + beyond, 0.0 * beyond, *flat, *shape, TIP, out)
    np.testing.assert_allclose(out[0], rolled(beyond[:, 0], TIP, depth, half, taper), atol=2e-5 * depth)
