"""The ideal observer: how often the right one of two strokes can be named at all, in noise of a known law."""

from __future__ import annotations

from math import erf

import numpy as np

from hw.simulated import NoiseSource
from mapping import FloatArray

# Lengths over which samples are averaged before they are weighed, m: a tenth of what a ball of 5 mm takes to climb an
# edge of 0.28 um, sqrt(2 r H) = 53 um. Half as long, no share that is told changes by more than 1 %
OBSERVED_LENGTH = 5e-6
# Pairs of strokes drawn for an observer who does not know the place: +-1 % at 80 % right
OBSERVED_PAIRS = 2000


def best_shares(
    templates: FloatArray, noise: NoiseSource, length: float, spacing: float, rng: np.random.Generator
) -> tuple[float, float]:
    """(place known, place unknown): shares of pairs, one with something and one empty, that can be named rightly.

    With C the covariance of the noise, a template s is worth d'^2 = s^T C^-1 s; who knows it names the right one of two
    with probability Phi(d' / sqrt 2) (Green and Swets 1966). Who knows it but for its place weighs all places: the
    stroke with the larger mean of exp(s_k^T C^-1 x - d_k'^2 / 2) is named, and no rule is right more often (Neyman and
    Pearson). The first number is of the template in the middle; the second is simulated.

    Args:
        templates: (M, N) heights of the trace, without noise, for each of M equally probable places, m.
        noise: of a sample's height.
        length: of path that each of the N heights is the mean of, m.
        spacing: of the samples, m.
        rng: of the simulation.
    """
    from scipy.linalg import cholesky, solve_triangular

    count = templates.shape[1]
    apart = length * np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    covariance = noise.correlated**2 * np.exp(-apart / noise.correlation_length)
    covariance[np.diag_indices(count)] += noise.white**2 * spacing / length
    whitened = solve_triangular(cholesky(covariance, lower=True), templates.T, lower=True)
    worth = (whitened**2).sum(axis=0)
    known = 0.5 * (1.0 + erf(0.5 * np.sqrt(worth[len(worth) // 2])))

    empty, felt = rng.standard_normal((2, OBSERVED_PAIRS, count))
    felt += whitened[:, rng.integers(len(worth), size=OBSERVED_PAIRS)].T
    evidence = [_mean_ratio(strokes @ whitened - 0.5 * worth) for strokes in (felt, empty)]
    return float(known), float(np.mean(evidence[0] > evidence[1]))


def _mean_ratio(logs: FloatArray) -> FloatArray:
    """Logarithm of the mean of exp over the last axis, but for a constant."""
    most = logs.max(axis=1)
    return np.asarray(most + np.log(np.exp(logs - most[:, None]).sum(axis=1)))
