"""Slopes across sweeps that do not run side by side."""

import numpy as np
import pytest

from mapping import Trace
from mapping.estimate.envelope import estimate_surface
from mapping.estimate.sweeps.normals import _least_slopes
from mapping.estimate.sweeps.tangent_kernels import slopes_across
from mapping.instrument import Noise


@pytest.fixture
def neighbours() -> tuple[np.ndarray, ...]:
    """Coordinates u, v and weights of 24 neighbours of 200 samples."""
    rng = np.random.default_rng(1)
    u, v = rng.uniform(-1.0, 1.0, (2, 200, 24))
    return u, v, rng.uniform(0.1, 1.0, u.shape)


def test_the_slope_of_a_quadratic_is_that_of_its_linear_term(neighbours: tuple[np.ndarray, ...]) -> None:
    u, v, weight = neighbours
    slope, residual, determined = slopes_across(u, v, 0.2 - 0.4 * u + 0.7 * v + u * u - 2 * u * v + 3 * v * v, weight)
    assert determined.all()
    np.testing.assert_allclose(slope, 0.7, atol=1e-12)
    assert residual.max() < 1e-13


def test_slope_and_residual_of_any_heights_are_those_of_the_singular_value_decomposition(
    neighbours: tuple[np.ndarray, ...],
) -> None:
    u, v, weight = neighbours
    w = np.random.default_rng(2).normal(size=u.shape)
    slope, residual, _ = slopes_across(u, v, w, weight)
    expected = _least_slopes(u, v, w, weight[..., None])
    np.testing.assert_allclose(slope, expected[0], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(residual, expected[1], rtol=1e-12)


def test_neighbours_on_one_line_and_too_few_of_them_determine_nothing(neighbours: tuple[np.ndarray, ...]) -> None:
    u, _, weight = neighbours
    along = np.stack([u[0], np.zeros(24), 0.3 * u[0], weight[0]])[:, None]
    slanting = np.stack([u[0], 0.7 * u[0], 0.3 * u[0], weight[0]])[:, None]
    for row in (along, slanting, slanting[..., :5]):
        assert not slopes_across(*row)[2].any()


def test_the_last_sweep_before_a_sharp_edge_is_not_tilted_by_those_round_it() -> None:
    """Rows along the edge of a bar on two of its sides, and one across them, so that fits tell the slope."""
    r, noise, rng = 3e-3, 10e-6, np.random.default_rng(4)
    s, places = np.arange(0.0, 30e-3, 0.2e-3), (1e-3, 1e-3, 3e-3, 5e-3)
    rows = [np.column_stack([s, np.full_like(s, y), np.full_like(s, r)]) for y in places]
    rows += [np.column_stack([s, np.full_like(s, -r), np.full_like(s, -z)]) for z in places]
    across = np.arange(5e-3, 9e-3, 0.2e-3)
    rows.append(np.column_stack([np.full_like(across, 15e-3), across, np.full_like(across, r)]))
    centers, sweep = np.concatenate(rows), np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    normals = np.where(centers[:, 2:] > 0.0, [0.0, 0.0, 1.0], [0.0, -1.0, 0.0])
    centers = centers + noise * rng.normal(size=(len(centers), 1)) * normals
    trace = Trace(np.arange(len(centers)) * 1e-3, centers, sweep, r)
    found = estimate_surface(trace, noise=Noise(noise), outward=normals)
    first = (found.sample >= 0) & (found.sweep == 0)
    assert np.degrees(np.arccos(found.normals[first, 2])).max() < 6.0
    assert np.abs(found.points[first, 2]).max() < 5 * noise
