"""Bells against the dilation of their surfaces point by point, on round bases and where facets lean."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray
from mapping.geometry.templates import bell_heights
from mapping.geometry.templates.bell_kernels import SLIGHT, _place_anywhere

UP = np.array([0.0, 0.0, 1.0])


def meridian(height: float, scale: float, taper: float) -> tuple[FloatArray, FloatArray]:
    """Distances from the axis (N,), finely, and heights of the bell there."""
    u = np.unique(np.concatenate([s * np.linspace(0.0, 1.0, 60_001) for s in (0.1 * scale, scale, 8.0 * scale, 4.0)]))
    if taper == 0.0:
        return u, height * np.exp(-((u / scale) ** 2))
    base = 1.0 + taper * (u / scale) ** 2
    return u, height * np.where(base > 0.0, np.maximum(base, 1e-300) ** (-1.0 / taper), 0.0)


def traced(away: FloatArray, curvature: float, height: float, scale: float, taper: float) -> FloatArray:
    """(N,) heights at feet so far from the axis, along a base of a curvature; tip of radius 1, and no bin."""
    turned = np.stack([away if curvature == 0.0 else np.sin(curvature * away) / curvature, 0.0 * away], axis=1)
    sag = 0.0 * away if curvature == 0.0 else (np.cos(curvature * away) - 1.0) / curvature
    feet = np.column_stack([turned, sag])
    normals = np.column_stack([np.sin(curvature * away), 0.0 * away, np.cos(curvature * away)])
    half = scale * np.sqrt(np.log(2.0) if taper == 0.0 else np.expm1(taper * np.log(2.0)) / taper)
    section, out = [np.array([each]) for each in (height, half, taper)], np.empty((1, len(away)))
    bell_heights(feet[:, None], normals, np.zeros((1, 3)), UP[None], curvature, *section, 1.0, out)
    return np.asarray(out[0])


@pytest.mark.parametrize("taper", [-0.6, -0.4, 0.0, 1.0 / 30.0, 0.5, 1.0, 2.0])
@pytest.mark.parametrize(
    ("height", "scale"), [(0.003, 0.03), (0.1, 1.0), (0.1, 0.01), (1.0, 0.01), (0.5, 0.1), (3.0, 1.0), (1e-6, 10.0)]
)
def test_the_trace_is_the_highest_place_of_the_ball(height: float, scale: float, taper: float) -> None:
    """From needles to swells."""
    away = np.linspace(0.0, 1.9, 40)
    u, z = meridian(height, scale, taper)
    felt = []
    for x in away:
        beside = np.concatenate([u, -u]) - x
        under = np.abs(beside) < 1.0
        felt.append((np.concatenate([z, z])[under] + np.sqrt(1.0 - beside[under] ** 2) - 1.0).max())
    off = np.abs(traced(away, 0.0, height, scale, taper) - np.maximum(felt, 0.0)) / height
    off = np.maximum(off - 1e-9 / height, 0.0)  # of the points tried here, on a swell
    # at a kink, where the ball goes over from crest to skirt, the table rounds the corner
    assert np.sort(off)[-3] < 5e-5 and off.max() < 2e-3


@pytest.mark.parametrize("curvature", [-0.3, *(pytest.param(k, marks=pytest.mark.slow) for k in (-0.1, 0.2)), 0.6])
@pytest.mark.parametrize(("height", "scale", "taper"), [(0.2, 0.4, -0.4), (0.1, 0.1, 1.0), (0.05, 0.5, 0.1)])
def test_on_a_round_base_it_stands_on_the_ball(curvature: float, height: float, scale: float, taper: float) -> None:
    radius, away = 1.0 / curvature, np.linspace(0.0, 1.2, 25)
    u, z = meridian(height, scale, taper)
    u, z = np.concatenate([-u[::-1], u]), np.concatenate([z[::-1], z])
    points = (radius + z)[:, None] * np.column_stack([np.sin(u / radius), np.cos(u / radius)])
    expected = []
    for s in away:
        way = np.array([np.sin(s / radius), np.cos(s / radius)])
        beside = (points - radius * way) @ np.array([way[1], -way[0]])
        near = np.abs(beside) < 1.0
        expected.append(((points[near] - radius * way) @ way + np.sqrt(1.0 - beside[near] ** 2) - 1.0).max())
    off = np.abs(traced(away, curvature, height, scale, taper) - np.maximum(expected, 0.0)) / height
    assert np.sort(off)[-3] < 5e-5 and off.max() < 2e-3


def test_over_a_leaning_facet_the_ball_rises_along_its_normal() -> None:
    """A ball of radius 1 whose foot is on a facet that leans by 0.1 touches the bell where it stands."""
    height, scale, lean = 0.2, 0.4, 0.1
    u, z = meridian(height, scale, 0.0)
    points = np.column_stack([np.concatenate([-u, u]), np.concatenate([z, z])])
    normal = np.array([np.sin(lean), np.cos(lean)])
    foot = np.array([0.3, -0.3 * np.tan(lean)])
    off = points - foot - normal
    across = off @ [normal[1], -normal[0]]
    near = np.abs(across) < 1.0
    expected = (off[near] @ normal + np.sqrt(1.0 - across[near] ** 2)).max()
    out, section = np.empty((1, 1)), [np.array([each]) for each in (height, scale * np.sqrt(np.log(2.0)), 0.0)]
    place, way = np.array([[foot[0], 0.0, foot[1]]]), np.array([[normal[0], 0.0, normal[1]]])
    bell_heights(place[:, None], way, np.zeros((1, 3)), UP[None], 0.0, *section, 1.0, out)
    assert out[0, 0] == pytest.approx(expected, abs=1e-4 * height)


@pytest.mark.parametrize("curvature", [-3.0, 0.5])
def test_places_along_a_ball_are_exact_however_far_round_it(curvature: float) -> None:
    """Where the series stands for the arc tangent, where it ends, and beyond."""
    for tangent in (1e-9, 0.01, 0.1, 0.999 * SLIGHT, 1.001 * SLIGHT, 1.0):
        aside = tangent / abs(curvature)
        expected = np.arctan(tangent) / abs(curvature)
        assert _place_anywhere(0.0, aside * aside, curvature) == pytest.approx(expected, rel=2e-15, abs=0.0)
