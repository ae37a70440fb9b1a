"""How often detection finds what is there and what is not, on closed-form traces of a wire on a plate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, poisson

from mapping.base.base import Base
from mapping.base.height_profile import arclength
from mapping.detection.detect import detect
from mapping.geometry.contact.first_contact import BallContact
from mapping.geometry.templates.shapes import cap_height
from mapping.instrument.noise import Noise
from mapping.instrument.stated import StatedNoise
from mapping.surface import Surface
from mapping.trace import Trace

TIP, SPACING, LENGTH = 0.01, 6e-6, 0.1


def plate() -> Base:
    corners = 0.2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def drawn(noise: Noise, count: int, rng: np.random.Generator) -> np.ndarray:
    from scipy.signal import lfilter

    decay = np.exp(-SPACING / noise.length)
    kicks = noise.correlated * np.sqrt(1 - decay**2) * rng.standard_normal(count)
    kicks[0] = noise.correlated * rng.standard_normal()
    return lfilter([1.0], [1.0, -decay], kicks) + noise.white * rng.standard_normal(count)


def passes(diameter: float, true_noise: Noise, seeds: int, **options):
    """Errors of the places (m) where a wire was found, and the number of other crossings, of passes of 100 mm."""
    errors, others = [], 0
    x = np.arange(-LENGTH / 2, LENGTH / 2, SPACING)
    # twice its disturbance: the faintest are found by a filter that is wider than they are
    reach = 2 * np.sqrt(2 * TIP * diameter)
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        place = rng.uniform(-0.3, 0.3) * LENGTH
        z = TIP + cap_height(x - place, diameter, diameter / 2, TIP) + drawn(true_noise, len(x), rng)
        crossings = detect(Trace.from_profile(x, z, TIP, x / 0.03), plate(), **options).crossings
        off = [c.point[0] - place for c in crossings]
        here = [error for error in off if abs(error) < reach]
        errors += here[:1]
        others += len(off) - len(here)
    return errors, others


@pytest.mark.slow
@pytest.mark.parametrize("diameter", [0.65e-3, 0.2e-3])
def test_wires_in_white_noise_are_all_found_where_they_are(diameter):
    errors, others = passes(diameter, Noise(2e-4), 150)
    assert len(errors) == 150
    assert others <= 2
    # sigma/D sqrt(3 Delta x_c / 8): height, width and base level are even about the crest and cost its place nothing
    bound = 2e-4 / diameter * np.sqrt(3 * SPACING * np.sqrt(2 * TIP * diameter) / 8)
    # 1.1 times the bound; 150 errors know their rms to 6 %
    assert np.sqrt(np.mean(np.square(errors))) < 1.1 * bound * 1.06


@pytest.mark.slow
def test_wires_of_a_tenth_of_a_millimetre_are_found_in_white_noise():
    errors, _ = passes(0.1e-3, Noise(2e-4), 100)
    assert len(errors) >= 95


@pytest.mark.slow
@pytest.mark.parametrize("known", ["noise", "stated"])
def test_a_wire_is_found_by_height_alone_in_noise_correlated_over_a_millimetre(known):
    noise = Noise(0.0, 2e-4, 1e-3)
    errors, others = passes(0.65e-3, noise, 150, **{known: noise if known == "noise" else StatedNoise(noise)})
    assert len(errors) >= 0.6 * 150
    assert others <= poisson.ppf(0.999, 0.01 * LENGTH * 150)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [Noise(2e-4), Noise(0.0, 2e-4, 1e-3)])
def test_the_stated_limit_is_found_with_the_stated_probability(noise):
    x = np.arange(-LENGTH / 2, LENGTH / 2, SPACING)
    bare = detect(Trace.from_profile(x, np.full(len(x), TIP), TIP, x / 0.03), plate(), noise=noise)
    errors, _ = passes(bare.detection_limit, noise, 150, noise=noise)
    # trying many places only helps: at least the stated share, within the binomial band
    assert len(errors) >= binom.ppf(0.001, 150, bare.probability)
    errors, _ = passes(0.7 * bare.detection_limit, noise, 100, noise=noise)
    assert len(errors) <= 95


@pytest.mark.slow
@pytest.mark.parametrize("correlated", [0.0, 2e-4])
def test_false_alarms_with_estimated_noise_are_no_more_than_asked(correlated):
    x = np.arange(-LENGTH / 2, LENGTH / 2, SPACING)
    noise, found = Noise(2e-4 if not correlated else 0.0, correlated, 1e-3), 0
    for seed in range(200):
        z = TIP + drawn(noise, len(x), np.random.default_rng(seed))
        trace = Trace.from_profile(x, z, TIP, x / 0.03)
        found += len(detect(trace, plate(), false_alarms_per_metre=1.0).crossings)
    assert found <= poisson.ppf(0.999, 200 * LENGTH)


def roof() -> Surface:
    """A plate folded up at x = -20 mm, down at 0 and up again at 20 mm, by 0.4 in slope."""
    x, z = np.array([-0.06, -0.02, 0.0, 0.02, 0.06]), np.array([0.0, 0.0, 0.008, 0.0, 0.0])
    vertices = np.array([[a, y, b] for y in (-0.05, 0.05) for a, b in zip(x, z, strict=True)])
    faces = [[k, k + 1, k + 6] for k in range(4)] + [[k, k + 6, k + 5] for k in range(4)]
    return Surface(vertices, faces)


def rolled(white: float) -> tuple[Base, Trace]:
    x = np.arange(-0.05, 0.05, SPACING)
    above = np.column_stack([x, np.zeros_like(x), np.full_like(x, 0.05)])
    centers = BallContact(roof(), TIP).first_contact(above, np.array([0.0, 0, -1])).centers
    noise = white * np.random.default_rng(0).standard_normal((len(x), 1)) * [0.0, 0.0, 1.0]
    return Base(roof()), Trace(x / 0.03 + 10, centers + noise, np.zeros(len(x), dtype=np.int64), TIP)


def test_arclength_grows_evenly_over_edges_and_hollows_of_the_base():
    base, trace = rolled(0.0)
    exact = np.linalg.norm(np.diff(trace.centers, axis=0), axis=1)
    s = arclength(trace, base)
    np.testing.assert_allclose(s[-1], exact.sum(), rtol=2e-3)
    assert np.diff(s).min() > 0.8 * exact.min()
    assert np.diff(s).max() < 1.2 * exact.max()


@pytest.mark.parametrize("white", [0.0, 2e-4])
def test_edges_and_hollows_of_the_base_are_no_features(white):
    base, trace = rolled(white)
    found = detect(trace, base)
    assert found.crossings == ()
    np.testing.assert_allclose(found.inspected_length, 0.1, rtol=0.1)
