"""Robust linear least squares: the bare base must not bend towards the features on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray

# Tukey's bisquare at 4.685 standard deviations keeps 95 % efficiency on Gaussian residuals (Beaton and Tukey, The
# fitting of power series, Technometrics 16, 1974).
BISQUARE = 4.685
# Standard deviation of normal values against their median absolute deviation
MAD_TO_SD = 1.482602218505602
# A residual beyond so many standard deviations counts as a feature: its size does not matter any more.
FEATURE_RESIDUAL_SDS = 3.0
L1_ROUNDS = 15
# Most of these rounds. Each brings half of what is farther off than the scale nearer by NEARER at least, or it is the
# last: that comes to an end where only features are left. From 1 to 1e-12 these are 80
MOST_L1_ROUNDS, NEARER = 80, 0.7
BISQUARE_ROUNDS = 40
# Designs of more columns are made orthonormal first
MANY = 20


@dataclass(frozen=True, eq=False)
class RobustFit:
    """Coefficients (P,) and residuals (N,)."""

    coefficients: FloatArray
    residual: FloatArray


def robust_sd(values: FloatArray) -> float:
    """Standard deviation of the Gaussian core of values about zero (median absolute value)."""
    return float(MAD_TO_SD * np.median(np.abs(values)))


def robust_scale(residual: FloatArray) -> float:
    """Standard deviation of the bulk of residuals (N,), from their median absolute deviation."""
    return float(MAD_TO_SD * np.median(np.abs(residual - np.median(residual))))


def neighbour_scatter(values: FloatArray) -> float:
    """Standard deviation of values (N,) from one to the next, from second differences; 0 of fewer than four.

    A slope does not count, nor does a bend that many values share; what is rare, as features are, hardly does.
    """
    if len(values) < 4:
        return 0.0
    return robust_scale(np.diff(values, 2)) / float(np.sqrt(6.0))


def robust_fit(design: FloatArray, values: FloatArray, scale: float) -> RobustFit:
    """Least squares that ignores what stands out by more than a few times `scale`.

    The first rounds minimise the sum of absolute residuals (convex: a feature that covers a third of the
    data cannot trap it), the rest Tukey's bisquare at the given scale. There are more of the
    first where a feature stands off by 1e9 of the scale, as in data without noise.

    Args:
        design: (N, P) matrix.
        values: (N,) data.
        scale: standard deviation of the data where there is no feature; zero for exact data.
    """
    floor = max(scale, 1e-12 * float(np.abs(values).max(initial=0.0)), np.finfo(float).tiny)
    weights = np.ones(len(values))
    if many := design.shape[1] > MANY:
        # orthonormal columns, whose normal equations lose no digits, take a fraction of the time
        design, triangle = np.linalg.qr(design)
    solve = _normal if many else _weighted
    coefficients, residual = solve(design, values, weights)
    off = np.inf
    for step in range(MOST_L1_ROUNDS):
        beyond = np.abs(residual[np.abs(residual) > floor])
        off, before = float(np.median(beyond)) if len(beyond) else 0.0, off
        if step >= L1_ROUNDS and not 0.0 < off < NEARER * before:
            break
        weights = 1.0 / np.maximum(np.abs(residual) / floor, 0.1)
        coefficients, residual = solve(design, values, weights)
    for _ in range(BISQUARE_ROUNDS):
        new = np.clip(1.0 - (np.abs(residual) / (BISQUARE * floor)) ** 2, 0.0, None) ** 2
        if (new > 0).sum() <= design.shape[1] or np.abs(new - weights).max() < 1e-6:
            break
        weights = new
        coefficients, residual = solve(design, values, weights)
    if many:
        coefficients = np.linalg.lstsq(triangle, coefficients, rcond=None)[0]
    return RobustFit(coefficients, residual)


def _weighted(design: FloatArray, values: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    root = np.sqrt(weights)
    coefficients = np.asarray(np.linalg.lstsq(design * root[:, None], values * root, rcond=None)[0])
    return coefficients, values - design @ coefficients


def _normal(design: FloatArray, values: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """As `_weighted`, by the normal equations: for designs whose columns are orthonormal."""
    weighted = design * weights[:, None]
    coefficients = np.asarray(np.linalg.lstsq(weighted.T @ design, weighted.T @ values, rcond=None)[0])
    return coefficients, values - design @ coefficients
