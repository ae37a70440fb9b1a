"""Pareto-smoothed importance sampling: weights that cannot be ruled by a few draws, and a test of them.

Reference: Vehtari, Simpson, Gelman, Yao & Gabry, "Pareto Smoothed Importance Sampling", JMLR 25 (2024);
Zhang & Stephens, "A New and Efficient Estimation Method for the Generalized Pareto Distribution", Technometrics
51 (2009).
"""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, IntArray


def smooth_weights(log_ratios: FloatArray) -> tuple[FloatArray, float]:
    """Normalised weights (S,) with a smoothed tail, and k-hat: below 0.5 the weights' variance is finite.

    Args:
        log_ratios: (S,) log target minus log proposal; -inf outside the target's support.

    Returns:
        Weights that sum to one, and k-hat (inf if too few draws have any weight; the weights are even if none has).
    """
    count = len(log_ratios)
    if not np.isfinite(log_ratios).any():
        return np.full(count, 1.0 / count), float("inf")
    shifted = log_ratios - np.max(log_ratios)
    weights = np.exp(shifted)
    tail = int(np.ceil(min(0.2 * count, 3.0 * np.sqrt(count))))
    order = np.argsort(weights, kind="stable")
    cutoff = weights[order[-tail - 1]]
    if tail < 5 or cutoff <= np.finfo(float).tiny:
        return weights / weights.sum(), float("inf")
    exceed = weights[order[-tail:]] - cutoff
    if exceed[-1] <= 1e-12 * weights[order[-1]]:
        return weights / weights.sum(), float("-inf")
    k, sigma = _fit_pareto(exceed)
    if np.isfinite(k):
        p = (np.arange(tail) + 0.5) / tail
        # where one draw makes the tail its shape is in the hundreds, and the last quantiles overflow: 1 bounds them
        with np.errstate(over="ignore"):
            smoothed = cutoff + (sigma * np.expm1(-k * np.log1p(-p)) / k if k != 0.0 else -sigma * np.log1p(-p))
        weights[order[-tail:]] = np.minimum(smoothed, 1.0)
    return weights / weights.sum(), float(k)


def effective_size(weights: FloatArray) -> float:
    """Number of equally weighted draws that would give the same variance."""
    return float(1.0 / np.sum(weights**2))


def resample(rng: np.random.Generator, weights: FloatArray, size: int) -> IntArray:
    """(size,) indices drawn with the weights by systematic resampling, in random order."""
    places = (np.arange(size) + rng.random()) / size
    index = np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1)
    return np.asarray(rng.permutation(index))


def _fit_pareto(exceed: FloatArray) -> tuple[float, float]:
    """Shape k and scale of a generalised Pareto distribution by Zhang & Stephens' quasi-posterior mean."""
    from scipy.special import softmax

    x = np.sort(exceed)
    n = len(x)
    grid = 30 + int(np.sqrt(n))
    quarter = max(x[int(n / 4 + 0.5) - 1], np.finfo(float).tiny)
    b = 1.0 - np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))
    b = b / (3.0 * quarter) + 1.0 / x[-1]
    k = np.mean(np.log1p(-b[:, None] * x), axis=1)
    profile = n * (np.log(-b / k) - k - 1.0)
    weight = softmax(profile)
    weight = np.where(weight >= 10 * np.finfo(float).eps, weight, 0.0)
    mean = float(np.sum(b * weight) / weight.sum())
    shape = float(np.mean(np.log1p(-mean * x)))
    # A weak prior towards 0.5 steadies short tails (Vehtari et al., appendix).
    return (n * shape + 10 * 0.5) / (n + 10), -shape / mean
