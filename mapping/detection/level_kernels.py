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
    _, (squared, crossed, ones, logdet) = _forward(read, error, along, length)
    told = 1.0 + by_sweep * ones
    return -0.5 * (squared - by_sweep * crossed * crossed / told + logdet + np.log(told))


@njit(cache=True)
def expected_level(read, error, by_sweep, along, length):  # type: ignore[no-untyped-def]
    """(C, 2) expectation of the level's logarithm in each cell, given all readings, and its variance; as above."""
    filtered, (_, crossed, ones, _) = _forward(read, error, along, length)
    decay = np.exp(-1.0 / length)
    # back along x (Rauch, Tung and Striebel 1965)
    for c in range(len(read) - 2, -1, -1):
        ahead = along + decay * decay * (filtered[c, 2] - along)
        share = decay * filtered[c, 2] / ahead if ahead > 0.0 else 0.0
        for j in range(2):
            filtered[c, j] += share * (filtered[c + 1, j] - decay * filtered[c, j])
        filtered[c, 2] += share * share * (filtered[c + 1, 2] - ahead)
    of_sweep, told = by_sweep * crossed / (1.0 + by_sweep * ones), by_sweep / (1.0 + by_sweep * ones)
    out = np.empty((len(read), 2))
    out[:, 0] = of_sweep + filtered[:, 0] - of_sweep * filtered[:, 1]
    out[:, 1] = filtered[:, 2] + told * (1.0 - filtered[:, 1]) ** 2
    return out


@njit(cache=True)
def _forward(read, error, along, length):  # type: ignore[no-untyped-def]
    """The filter along x.

    Returns:
        (C, 3): what the readings up to a cell say of x there, what readings of one everywhere would say, and the
        variance of x; and of the innovations of both: products, and the logarithm of their variances.
    """
    filtered = np.zeros((len(read), 3))
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
        filtered[c, 0], filtered[c, 1], filtered[c, 2] = state, answer, variance
    return filtered, (squared, crossed, ones, logdet)
