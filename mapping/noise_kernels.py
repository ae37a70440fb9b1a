"""The sequential part of whitening, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def innovations(values, steps, white, correlated, length):  # type: ignore[no-untyped-def]
    """Normalised Kalman innovations of columns (N, P) under white + OU noise, and the log-determinant."""
    count, columns = values.shape
    out = np.empty((count, columns))
    state = np.zeros(columns)
    variance = correlated * correlated
    noise = white * white
    logdet = 0.0
    for i in range(count):
        if i > 0:
            decay = np.exp(-steps[i - 1] / length)
            state *= decay
            variance = correlated * correlated + decay * decay * (variance - correlated * correlated)
        total = variance + noise
        root = np.sqrt(total)
        gain = variance / total
        for j in range(columns):
            error = values[i, j] - state[j]
            out[i, j] = error / root
            state[j] += gain * error
        variance *= noise / total
        logdet += np.log(total)
    return out, logdet
