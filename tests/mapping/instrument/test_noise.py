"""The noise model against dense linear algebra, and its estimate against noise of known level."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from mapping.errors import NoiseError
from mapping.instrument.noise import Noise, estimate_noise
from mapping.instrument.term import Term


def drawn(noise: Noise, count: int, spacing: float, rng: np.random.Generator) -> np.ndarray:
    from scipy.signal import lfilter

    decay = np.exp(-spacing / noise.length)
    kicks = noise.correlated * np.sqrt(1 - decay**2) * rng.standard_normal(count)
    kicks[0] = noise.correlated * rng.standard_normal()
    return lfilter([1.0], [1.0, -decay], kicks) + noise.white * rng.standard_normal(count)


def test_whitening_in_one_pass_equals_the_inverse_covariance():
    rng = np.random.default_rng(0)
    s = np.sort(rng.random(150))
    noise, columns = Noise(0.1, 0.5, 0.05), rng.standard_normal((150, 3))
    white, logdet = noise.whiten(columns, s)
    covariance = noise.covariance(s)
    np.testing.assert_allclose(white.T @ white, columns.T @ np.linalg.solve(covariance, columns), rtol=1e-9)
    np.testing.assert_allclose(logdet, np.linalg.slogdet(covariance)[1], rtol=1e-12)


def test_block_covariances_are_those_of_the_block_means():
    noise, spacing, size = Noise(0.3, 1.0, 1e-3), 1e-6, 500
    s = spacing * np.arange(4 * size)
    means = np.kron(np.eye(4), np.full(size, 1 / size))
    dense = means @ noise.covariance(s) @ means.T
    np.testing.assert_allclose(noise.block_covariances(4, size * spacing, size), dense[0], rtol=2e-3)


@pytest.mark.parametrize(("white", "correlated", "length"), [(2e-4, 2e-5, 1e-3), (1e-4, 2e-4, 2e-3), (2e-4, 0.0, 1e-3)])
def test_level_and_correlation_are_found_again(white, correlated, length):
    truth = Noise(white, correlated, length)
    rng = np.random.default_rng(1)
    found = [estimate_noise(drawn(truth, 100_000, 6e-6, rng), 6e-6 * np.arange(100_000)) for _ in range(4)]
    np.testing.assert_allclose(np.mean([f.white for f in found]), white, rtol=0.02)
    if correlated:
        np.testing.assert_allclose(np.mean([f.correlated for f in found]), correlated, rtol=0.15)
        np.testing.assert_allclose(np.median([f.length for f in found]), length, rtol=0.5)
    else:
        assert max(f.correlated for f in found) < 0.1 * white


def test_features_on_a_fifth_of_the_path_do_not_bias_the_noise():
    rng = np.random.default_rng(2)
    s = 6e-6 * np.arange(100_000)
    features = sum(np.maximum(0.65e-3 - (s - c) ** 2 / 20.65e-3, 0) for c in np.arange(0.03, 0.6, 0.036))
    assert 0.15 < (features > 0).mean() < 0.25
    found = estimate_noise(features + 2e-4 * rng.standard_normal(len(s)), s)
    np.testing.assert_allclose(found.white, 2e-4, rtol=0.03)


def test_scale_does_not_matter():
    rng = np.random.default_rng(3)
    residual, s = drawn(Noise(1.0, 2.0, 0.1), 5000, 0.01, rng), 0.01 * np.arange(5000)
    plain, scaled = estimate_noise(residual, s), estimate_noise(residual * 2.0**-30, s * 2.0**-30)
    np.testing.assert_allclose(
        [scaled.white, scaled.correlated, scaled.length],
        np.array([plain.white, plain.correlated, plain.length]) * 2.0**-30,
        rtol=1e-9,
    )


def test_bad_noise_is_refused_by_name():
    with pytest.raises(NoiseError, match="finite"):
        Noise(-1.0)
    with pytest.raises(NoiseError, match="length"):
        Noise(1.0, 1.0, 0.0)
    with pytest.raises(NoiseError, match="16 samples"):
        estimate_noise(np.zeros(3), np.zeros(3))
    with pytest.raises(NoiseError, match="singular"):
        Noise(0.0).whiten(np.ones(3), np.arange(3.0))


def test_block_variances_of_correlated_noise_keep_their_digits_at_every_length() -> None:
    # 1 - x/3 + x^2/12 - x^3/60 + x^4/360 - ...
    for x in (1e-9, 1e-5, 1e-3, 1e-2):
        series = sum(2 * (-x) ** k / math.factorial(k + 2) for k in range(12))
        assert math.isclose(Noise(0.0, 1.0, 1.0).block_covariances(1, x, 1.0)[0], series, rel_tol=1e-14)
    below, above = (Noise(0.0, 1.0, 1.0).block_covariances(1, 0.5 * (1 + step), 1.0)[0] for step in (-1e-9, 1e-9))
    assert math.isclose(below, above, rel_tol=2e-9)


def test_rounded_positions_are_wrong_by_their_step_and_together_within_it():
    rng = np.random.default_rng(0)
    flank = np.cumsum(rng.uniform(0.0, 1e-6, 40_000))
    rounding = np.round(flank / 4e-6) * 4e-6 - flank
    noise = Noise(1e-7).rounded(4e-6)
    assert noise.correlated == pytest.approx(rounding.std(), rel=0.02)
    # one step further on the errors have nothing in common: a bin of 400 samples over 50 steps is worth about 50
    means = rounding.reshape(-1, 400).mean(axis=1)
    assert means.std() < np.sqrt(noise.block_covariances(1, 200e-6, 400.0)[0]) < rounding.std() / 3.0


def test_rounding_joins_what_is_correlated_already():
    noise = Noise(2e-6, 1e-6, 1e-3).rounded(4e-6)
    rounding = 16e-12 / 12.0
    assert noise.white == 2e-6 and noise.correlated**2 == pytest.approx(1e-12 + rounding)
    assert noise.correlated**2 * noise.length == pytest.approx(1e-12 * 1e-3 + rounding * 4e-6)
    assert Noise(2e-6, 1e-6, 1e-3).rounded(0.0) == Noise(2e-6, 1e-6, 1e-3)


def test_what_is_recorded_is_read_again():
    noise = Noise(1.0, 2.0, 3.0, (Term(4.0, 5.0), Term(6.0, 7.0, 8.0)))
    assert Noise.read(json.loads(json.dumps(noise.record))) == noise
