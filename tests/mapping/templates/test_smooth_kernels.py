"""Bells and smooth hollows against brute-force dilation of their sections."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray
from mapping.geometry.templates import half_ways_touched, smooth_line_heights, smooth_point_heights
from mapping.geometry.templates.smooth_kernels import smooth_trace

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


def on_a_circle(at: FloatArray, curvature: float, height: float, half: float, taper: float) -> list[float]:
    """Heights at which a ball rests over places of a circle, along it, by trying every place of the section."""
    radius = 1.0 / curvature if curvature != 0.0 else 1e3
    u = np.linspace(-10e-3, 10e-3, 400_001)
    out = radius - section(u, height, half, taper)
    found = []
    for place in at:
        turn = (u - place) / radius
        beside = out * np.sin(turn)
        near = np.abs(beside) < TIP
        up = out[near] * np.cos(turn[near]) - radius
        found.append(float((up + np.sqrt(TIP**2 - beside[near] ** 2) - TIP).max()))
    return found


@pytest.mark.parametrize("curvature", [-120.0, -40.0, 60.0, 200.0])
@pytest.mark.parametrize(
    ("height", "half", "taper"), [(0.6e-3, 1e-3, -0.4), (0.3e-3, 0.3e-3, 1.0), (-0.5e-3, 1e-3, 0.2)]
)
def test_a_round_base_is_a_circle_and_no_other_ball(curvature: float, height: float, half: float, taper: float) -> None:
    spacing, table = 0.05e-3, np.empty(80)
    smooth_trace(height, half, taper, TIP, curvature, table, spacing)
    expected = on_a_circle(spacing * np.arange(0, 80, 4), curvature, height, half, taper)
    felt = np.maximum(table[::4], 0.0) if height > 0.0 else table[::4]
    np.testing.assert_allclose(felt, np.maximum(expected, 0.0) if height > 0.0 else expected, atol=3e-5 * abs(height))


@pytest.mark.parametrize("taper", [-0.6, -0.4, 0.0, 0.3, 1.0])
@pytest.mark.parametrize(("depth", "half"), [(0.5e-3, 0.9e-3), (0.5e-3, 0.3e-3), (0.1e-3, 2e-3), (2e-3, 0.9e-3)])
def test_a_ball_rests_on_a_smooth_pit_as_on_each_of_its_points(taper: float, depth: float, half: float) -> None:
    at = np.concatenate([np.linspace(0.0, 0.5e-3, 11), np.linspace(0.6e-3, 6e-3, 31)])
    out = np.empty((1, len(at)))
    nodes = at[:, None]
    shape = np.array([-depth]), np.array([half]), np.array([taper])
    smooth_point_heights(nodes, 0.0 * nodes, np.zeros(2), np.zeros((1, 2)), *shape, TIP, out)
    np.testing.assert_allclose(out[0], rolled(at, TIP, depth, half, taper), atol=2e-5 * depth)
    assert (out[0] < -0.02 * depth).sum() > 4


@pytest.mark.slow
def test_a_groove_is_felt_as_its_section_as_the_base_bends_and_ends_round() -> None:
    """Along a line over which the base bends more and more, and beyond its end."""
    depth, half, taper = 0.4e-3, 0.8e-3, -0.4
    bend = np.linspace(-40.0, 120.0, 33)[:, None]
    s, aside = np.full_like(bend, 5e-3), np.full_like(bend, 0.5e-3)
    shape = np.array([-depth]), np.array([half]), np.array([taper])
    line = np.zeros((2, 0, *bend.shape)), bend, 0.0 * bend, np.zeros((1, 0)), np.array([[0.0, 10e-3]])
    out = np.empty((1, len(bend)))
    smooth_line_heights(s, aside, *line, *shape, TIP, out)
    expected = [on_a_circle(0.5e-3, k, -depth, half, taper) for k in bend[:, 0]]
    np.testing.assert_allclose(out[0], expected, atol=1e-3 * depth)
    assert np.ptp(expected) > 0.05 * depth
    beyond = np.linspace(0.0, 2e-3, 33)[:, None]
    flat = np.zeros((2, 0, *bend.shape)), 0.0 * bend, 0.0 * bend, np.zeros((1, 0)), np.array([[0.0, 10e-3]])
    smooth_line_heights(10e-3 + beyond, 0.0 * beyond, *flat, *shape, TIP, out)
    np.testing.assert_allclose(out[0], rolled(beyond[:, 0], TIP, depth, half, taper), atol=2e-5 * depth)


@pytest.mark.parametrize("taper", [-0.6, -0.4, 0.0, 1.0 / 30.0, 1.0, 2.0])
@pytest.mark.parametrize(
    ("height", "scale"), [(0.003, 0.03), (0.1, 1.0), (0.1, 0.01), (1.0, 0.01), (0.5, 0.1), (3.0, 1.0), (1e-6, 10.0)]
)
def test_the_trace_of_a_bell_is_the_highest_place_of_the_ball(height: float, scale: float, taper: float) -> None:
    """From needles to swells, the ball's radius 1."""
    spacing, table = 0.01, np.empty(200)
    half = scale * np.sqrt(np.log(2.0) if taper == 0.0 else (2.0**taper - 1.0) / taper)
    smooth_trace(height, half, taper, 1.0, 0.0, table, spacing)
    places = spacing * np.arange(len(table))
    u = np.unique(np.concatenate([s * np.linspace(-1.0, 1.0, 20_001) for s in (scale, 10.0 * scale, 2.5)]))
    z = -section(u, height, half, taper)
    for x, traced in zip(places[::5], table[::5], strict=True):
        under = u[np.abs(u - x) < 1.0]
        felt = (z[np.abs(u - x) < 1.0] + np.sqrt(1.0 - (under - x) ** 2) - 1.0).max()
        assert max(traced, 0.0) == pytest.approx(max(felt, 0.0), abs=3e-5 * height + 1e-9)


@pytest.mark.parametrize(
    ("height", "half", "taper"),
    [(0.1, 1.0, -0.4), (0.1, 0.1, -0.4), (0.2, 0.15, 0.0), (0.1, 0.2, 1.0), (2.0, 0.1, 0.3)],
)
def test_what_a_ball_knows_of_the_width_is_where_it_lay(height: float, half: float, taper: float) -> None:
    """Against every place that a ball of radius 1 touches on its way over the bell."""
    out = np.empty((1, 2))
    half_ways_touched(np.array([height]), np.array([half]), np.array([taper]), 1.0, out)
    u = np.linspace(0.0, 4.0, 8001)
    z = -section(u, height, half, taper)
    with np.errstate(invalid="ignore"):
        lain = [u[np.nanargmax(z + np.sqrt(1.0 - (u - x) ** 2))] for x in np.linspace(0.0, 3.5, 3501)]
    above, below = max(at for at in lain if at <= half + 1e-3), min(at for at in lain if at >= half - 1e-3)
    if below - above < 0.02:
        np.testing.assert_array_equal(out, half)
    else:
        np.testing.assert_allclose(out[0], [above, below], atol=0.01)
