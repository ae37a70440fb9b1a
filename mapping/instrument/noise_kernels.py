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


@njit(cache=True)
def block_likelihood(values, steps, samples, white, correlated, length):  # type: ignore[no-untyped-def]
    """Twice the negative log-likelihood, less N log(2 pi), of means over adjoining blocks of white + OU noise.

    The state is the process at a block's end; its mean over the next block and its next value share what happens
    within that block.

    Args:
        values: (N,) block means; NaN where nothing counts.
        steps: (N,) lengths of the blocks, m; negative where another run begins.
        samples: in a block.
        white, correlated, length: of the noise.
    """
    power = correlated * correlated
    scatter = white * white / samples
    state, variance = 0.0, power
    last, before, logarithm, gain, inverse, settled = -1.0, -1.0, 0.0, 0.0, 0.0, 0.0
    decay = pull = within = shared = fresh = 0.0
    result = 0.0
    for i in range(len(values)):
        step = steps[i]
        if step < 0:
            state, variance = 0.0, power
            step = -step
        if step != last:
            x = step / length
            decay = np.exp(-x)
            pull = -np.expm1(-x) / x if x > 1e-8 else 1.0
            if x < 1e-2:
                within = power * x * (2.0 / 3.0 - x * (0.5 - 7.0 * x / 30.0))
            else:
                within = power * (2.0 * (x - 1.0 + decay) / (x * x) - pull * pull)
            shared = power * pull * (1.0 - decay)
            fresh = -power * np.expm1(-2.0 * x)
            last, before = step, -1.0
        if np.isnan(values[i]):
            state *= decay
            variance = decay * decay * variance + fresh
            continue
        error = values[i] - pull * state
        if variance != before:  # along a run of equal blocks it soon stands still
            before = variance
            total = pull * pull * variance + within + scatter
            gain = (decay * pull * variance + shared) / total
            inverse, logarithm = 1.0 / total, np.log(total)
            settled = decay * decay * variance + fresh - gain * gain * total
        variance = settled
        result += error * error * inverse + logarithm
        state = decay * state + gain * error
    return result
