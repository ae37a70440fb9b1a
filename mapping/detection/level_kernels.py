"""A level that wanders along a sweep: its likelihood and its expectation, compiled; time linear in the cells.

The level's logarithm is b + x: b is one value of the sweep, x an Ornstein-Uhlenbeck process from cell to cell. It is
read in each cell with an error of its own; where nothing is read the error is infinite. A Kalman filter runs along x;
b is marginalised by the filter's answer to a constant (Sherman and Morrison 1950).
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def level_likelihood(read, error, by_sweep, along, length):  # type: ignore[no-untyped-def]
    """Log-likelihood, less a constant of the readings, of a sweep's level.

    Args:
        read, error: (C,) readings in the cells, and their variances; infinite where nothing was read.
        by_sweep, along: variances of b and of x.
        length: correlation length of x in cells.
    """
    squared, crossed, ones, logdet = 0.0, 0.0, 0.0, 0.0
    decay = np.exp(-1.0 / length)
    state, answer, variance = 0.0, 0.0, along
    for c in range(len(read)):
        if c > 0:
            state, answer = decay * state, decay * answer
            variance = along + decay * decay * (variance - along)
        if np.isfinite(error[c]):
            total = variance + error[c]
            gain = variance / total
            off, one = read[c] - state, 1.0 - answer
            squared += off * off / total
            crossed += off * one / total
            ones += one * one / total
            logdet += np.log(total)
            state, answer = state + gain * off, answer + gain * one
            variance *= error[c] / total
    told = 1.0 + by_sweep * ones
    return -0.5 * (squared - by_sweep * crossed * crossed / told + logdet + np.log(told))


@njit(cache=True)
def expected_level(read, error, by_sweep, along, length):  # type: ignore[no-untyped-def]
    """(C,) expectation of the level's logarithm in each cell, given all readings; arguments as above."""
    count = len(read)
    decay = np.exp(-1.0 / length)
    # columns: what the readings say of x, and what readings of one everywhere would say
    filtered, variances = np.zeros((count, 2)), np.zeros(count)
    state, answer, variance = 0.0, 0.0, along
    crossed, ones = 0.0, 0.0
    for c in range(count):
        if c > 0:
            state, answer = decay * state, decay * answer
            variance = along + decay * decay * (variance - along)
        if np.isfinite(error[c]):
            total = variance + error[c]
            gain = variance / total
            off, one = read[c] - state, 1.0 - answer
            crossed += off * one / total
            ones += one * one / total
            state, answer = state + gain * off, answer + gain * one
            variance *= error[c] / total
        filtered[c, 0], filtered[c, 1], variances[c] = state, answer, variance
    # back along x (Rauch, Tung and Striebel 1965)
    for c in range(count - 2, -1, -1):
        ahead = along + decay * decay * (variances[c] - along)
        share = decay * variances[c] / ahead if ahead > 0.0 else 0.0
        for j in range(2):
            filtered[c, j] += share * (filtered[c + 1, j] - decay * filtered[c, j])
    of_sweep = by_sweep * crossed / (1.0 + by_sweep * ones)
    return of_sweep + filtered[:, 0] - of_sweep * filtered[:, 1]
