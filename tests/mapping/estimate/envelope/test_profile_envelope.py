"""The envelope of balls under a profile, against brute force and the flat-array erosion of surface metrology."""

import time

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from mapping.errors import EnvelopeError
from mapping.estimate.envelope.profile_envelope import envelope_heights, penetration_below


def brute_force(x, z, r, at):
    d = at[:, None] - x[None, :]
    heights = np.where(np.abs(d) <= r, z - np.sqrt(np.maximum((r - d) * (r + d), 0.0)), np.inf)
    return heights.min(axis=1)


def flat_array(z, step, r, shift):
    """Grey dilation (shift = -1: ball lowered on the body) or erosion (+1) of a height array by a ball array."""
    reach = int(np.floor(r / step))
    offsets = np.arange(-reach, reach + 1)
    grids = np.meshgrid(*[offsets] * z.ndim, indexing="ij")
    square = sum((g * step) ** 2 for g in grids)
    pad = np.pad(z, reach, constant_values=-shift * -np.inf)
    result = np.full(z.shape, shift * np.inf)
    for where in np.argwhere(square <= r * r):
        drop = np.sqrt(r * r - square[tuple(where)])
        window = pad[tuple(slice(w, w + n) for w, n in zip(where, z.shape, strict=True))]
        result = np.minimum(result, window - drop) if shift > 0 else np.maximum(result, window + drop)
    return result


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-5, 5), st.floats(-3, 3)), min_size=1, max_size=60),
    st.floats(0.05, 4.0),
)
def test_the_envelope_is_the_lowest_arc_everywhere(centers, r):
    x, z = np.array(centers).T
    at = np.linspace(-9.1, 9.2, 301)
    heights, owner = envelope_heights(x, z, r, at)
    expected = brute_force(x, z, r, at)
    # An abscissa within rounding of a ball's rim may or may not be reached.
    rim = np.min(np.abs(np.abs(at[:, None] - x[None, :]) - r), axis=1) < 1e-9
    np.testing.assert_array_equal(np.isfinite(heights)[~rim], np.isfinite(expected)[~rim])
    both = np.isfinite(heights) & np.isfinite(expected) & ~rim
    np.testing.assert_allclose(heights[both], expected[both], atol=1e-7)
    assert ((owner >= 0) == np.isfinite(heights)).all()


def test_closing_a_profile_equals_flat_array_erosion():
    rng = np.random.default_rng(0)
    step, r = 0.01, 0.73
    body = np.cumsum(rng.standard_normal(900)) * 0.01
    trace = flat_array(body, step, r, -1)
    x = step * np.arange(len(body))
    heights, _ = envelope_heights(x, trace, r)
    inner = slice(150, -150)
    assert np.abs(heights - flat_array(trace, step, r, 1))[inner].max() <= 1e-9 * r


def test_closing_leaves_untouched_what_the_ball_reaches_and_fills_the_rest():
    step, r = 1e-3, 0.5
    x = np.arange(-2, 2, step)
    body = np.where(np.abs(x) < 0.2, -0.3, 0.0)
    trace = flat_array(body, step, r, -1)
    heights, _ = envelope_heights(x, trace, r)
    inner = np.abs(x) < 1.2
    assert np.abs(heights - body)[inner & (np.abs(x) > 0.2 + step)].max() < step**2 / r
    middle = np.abs(x) < 0.1
    assert (heights[middle] > -0.3 + 0.1).all()


def test_order_of_the_samples_does_not_matter():
    rng = np.random.default_rng(2)
    x, z = rng.uniform(0, 3, 200), rng.uniform(0, 1, 200)
    shuffled = rng.permutation(200)
    at = np.linspace(0, 3, 77)
    np.testing.assert_array_equal(
        envelope_heights(x, z, 0.4, at)[0], envelope_heights(x[shuffled], z[shuffled], 0.4, at)[0]
    )


@pytest.mark.parametrize("scale", [2.0**-30, 2.0**20])
def test_the_envelope_scales_exactly_with_powers_of_two(scale):
    rng = np.random.default_rng(3)
    x, z = np.sort(rng.uniform(0, 3, 300)), rng.uniform(0, 1, 300)
    once = envelope_heights(x, z, 0.4)[0]
    np.testing.assert_array_equal(envelope_heights(x * scale, z * scale, 0.4 * scale)[0], once * scale)


def test_a_million_samples_take_less_than_two_seconds():
    x = np.linspace(0.0, 1.0, 1_000_000)
    z = 0.01 * np.sin(40 * x) + 1e-4 * np.random.default_rng(0).standard_normal(len(x))
    envelope_heights(x[:10], z[:10], 0.01)
    start = time.process_time()
    envelope_heights(x, z, 0.01)
    assert time.process_time() - start < 2.0


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_a_radius_that_is_no_length_is_refused(bad):
    with pytest.raises(EnvelopeError, match="positive"):
        envelope_heights([0.0, 1.0], [0.0, 0.0], bad)


def test_values_that_are_not_finite_are_refused():
    with pytest.raises(EnvelopeError, match="finite"):
        envelope_heights([0.0, np.nan], [0.0, 0.0], 1.0)


def test_a_search_for_what_is_deep_enough_finds_it_as_deep_as_a_search_for_everything():
    rng = np.random.default_rng(4)
    centers, points = rng.uniform(0, 3, (400, 3)), rng.uniform(0, 3, (3000, 3))
    depth = penetration_below(centers, 0.4)
    whole = depth(points, -np.inf)
    assert np.isfinite(whole).all() and (whole < 0).any()
    for least in (-0.1, 0.0, 0.05, float(whole.max()), 0.5):
        bounded = depth(points, least)
        np.testing.assert_array_equal(bounded > least, whole > least)
        np.testing.assert_array_equal(bounded[bounded > least], whole[whole > least])


@pytest.mark.parametrize("order", ["sweeps", "none"])
def test_penetration_is_that_of_the_nearest_of_all_centres(order):
    rng = np.random.default_rng(8)
    x, y = np.meshgrid(np.arange(-1, 1, 0.02), np.arange(-1, 1, 0.1))
    centers = np.column_stack([x.ravel(), y.ravel(), 1 + 0.1 * np.sin(3 * x.ravel())])
    if order == "none":
        centers = centers[rng.permutation(len(centers))]
    points = centers - [0, 0, 1] + 0.02 * rng.standard_normal(centers.shape)
    depth = 1 - np.linalg.norm(points[:, None] - centers[None], axis=2).min(axis=1)
    found = penetration_below(centers, 1.0)(points, 1e-9)
    deep = depth > 1e-9
    assert 0.1 < deep.mean() < 1.0
    np.testing.assert_allclose(found[deep], depth[deep], rtol=0, atol=1e-15)
    assert (found[~deep] <= 1e-9).all()
