"""The paper's four algorithms on closed forms: what each finds and what each cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mapping.base.base import Base
from mapping.detection.detect import detect
from mapping.detection.paper_algorithms import curvature_features
from mapping.errors import DetectionError
from mapping.estimate.sweeps.curvature import curvature_along, curvature_sd, features_beyond, half_width_for
from mapping.geometry.templates.shapes import cap_height, groove_height
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

TIP = 0.01


def sweep(height, white: float = 0.0, angle: float = 0.0, seed: int = 0) -> Trace:
    """A sweep over a plane with contact normals that follow from the trace's slope."""
    x = np.arange(-0.03, 0.03, 6e-6)
    z = height(x)
    rng = np.random.default_rng(seed)
    tilt = np.arctan(np.gradient(z, x)) + angle * rng.standard_normal(len(x))
    normals = np.column_stack([-np.sin(tilt), np.zeros_like(x), np.cos(tilt)])
    centers = np.column_stack([x, np.zeros_like(x), TIP + z + white * rng.standard_normal(len(x))])
    return Trace(x / 0.03, centers, np.zeros(len(x), dtype=int), TIP, normals=normals)


def wire(x):
    return cap_height(x, 0.65e-3, 0.325e-3, TIP)


def groove(x):
    return groove_height(x, 4e-3, TIP)


def signs(trace: Trace, algorithm: int) -> tuple[int, ...]:
    return tuple(f.sign for f in curvature_features(trace, algorithm))


def test_figure_3_has_three_features_bounded_by_the_roots():
    a, tip = 15.0, 1.0
    u = np.linspace(-1.0, 1.0, 4001)
    d = 1 + a * u**2
    c = np.sqrt(1 + 4 * a**2 * u**2 / d**4)
    exact = 2 * a * (1 - 3 * a * u**2) / (c**3 * d**3)
    found = features_beyond(u, curvature_along(u, 1 / d, 0.004), 1 / tip, -1 / tip)
    assert [f.sign for f in found] == [-1, 1, -1]
    fine = np.linspace(0, 1, 2_000_001)
    d = 1 + a * fine**2
    k = 2 * a * (1 - 3 * a * fine**2) / ((1 + 4 * a**2 * fine**2 / d**4) ** 1.5 * d**3)
    roots = [fine[np.flatnonzero(np.diff(np.sign(k - level)))] for level in (1.0, -1.0)]
    np.testing.assert_allclose(found[1].stop, roots[0][0], rtol=1e-3)
    np.testing.assert_allclose([found[2].start, found[2].stop], roots[1], rtol=1e-3)
    assert np.abs(exact).max() == pytest.approx(30.0)


def test_the_trace_shows_a_wire_as_concave_convex_concave():
    assert signs(sweep(wire, white=1e-6), 3) == (-1, 1, -1)
    assert signs(sweep(wire, angle=1e-4), 2) == (-1, 1, -1)


def test_estimated_surfaces_show_the_wire_but_no_hollow():
    for algorithm in (1, 4):
        convex = [s for s in signs(sweep(wire, white=1e-6, angle=1e-4), algorithm) if s > 0]
        assert convex == [1]
    assert -1 in signs(sweep(groove, white=1e-6), 3)
    assert -1 not in signs(sweep(groove, white=1e-6), 4)


def test_a_plane_under_noise_has_no_curvature_features():
    for seed in range(5):
        assert signs(sweep(np.zeros_like, white=2e-4, seed=seed), 3) == ()


def test_the_window_follows_from_the_noise_as_in_the_theory():
    np.testing.assert_allclose(half_width_for(Noise(2e-4), 6e-6, 1 / TIP), 1.37e-3, rtol=0.01)
    np.testing.assert_allclose(half_width_for(Noise(2e-4), 6e-6, 1 / (2 * TIP)), 1.81e-3, rtol=0.01)


def ornstein_uhlenbeck(noise: Noise, count: int, seed: int) -> np.ndarray:
    from scipy.signal import lfilter

    rng, decay = np.random.default_rng(seed), np.exp(-6e-6 / noise.length)
    kicks = noise.correlated * np.sqrt(1 - decay**2) * rng.standard_normal(count)
    kicks[0] /= np.sqrt(1 - decay**2)
    return lfilter([1.0], [1.0, -decay], kicks) + noise.white * rng.standard_normal(count)


def test_curvature_scatters_in_correlated_noise_as_the_window_assumes():
    noise, half_width = Noise(1e-4, 2e-4, 1e-3), 2e-3
    x = 6e-6 * np.arange(400_000)
    found = curvature_along(x, ornstein_uhlenbeck(noise, len(x), 0), half_width)
    # 2.4 m hold about a thousand independent windows
    assert np.std(found) == pytest.approx(curvature_sd(noise, 6e-6, half_width), rel=0.08)
    width = half_width_for(noise, 6e-6, 1 / TIP)
    assert 3 * curvature_sd(noise, 6e-6, width) == pytest.approx(1 / TIP, rel=1e-3)


@pytest.mark.parametrize("algorithm", [1, 3, 4])
def test_a_plane_under_correlated_noise_has_no_curvature_features_where_the_noise_is_known(algorithm):
    noise, found = Noise(0.0, 2e-4, 1e-3), 0
    for seed in range(5):
        plain = sweep(lambda x, seed=seed: ornstein_uhlenbeck(noise, len(x), seed))
        level = replace(plain, normals=np.tile([0.0, 0.0, 1.0], (len(plain), 1)))
        assert len(curvature_features(level, algorithm)) > 10
        found += len(curvature_features(level, algorithm, noise))
    assert found <= 3


def test_contact_data_is_asked_for_where_it_is_needed():
    plain = Trace.from_profile(np.linspace(0, 1, 50), np.ones(50), 1.0)
    with pytest.raises(DetectionError, match="positions alone"):
        curvature_features(plain, 2)
    with pytest.raises(DetectionError, match="1, 2, 3 and 4"):
        curvature_features(plain, 0)


def test_detection_says_what_each_algorithm_makes_of_a_crossing():
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    base = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
    trace = sweep(wire, white=1e-5, angle=1e-3)
    assert all(detect(trace, base, algorithm=n).crossings[0].curvature_feature for n in (1, 2, 3, 4))
    hollow = sweep(groove, white=1e-5, angle=1e-3)
    assert detect(hollow, base, algorithm=3).crossings[0].curvature_feature
    assert not detect(hollow, base, algorithm=4).crossings[0].curvature_feature
