"""The Kalman filter of a noise's states, compiled: one recursion for all who whiten (theory section 6.9).

The states of oscillators come first, two each (a complex amplitude that turns), then one for each
Ornstein-Uhlenbeck term. Over a step every state decays, oscillators turn as well, and what is read is linear in the
states before the step, with innovations that may be shared with the states after it (theory equation 6.17).
"""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

# Relative change of a covariance below which it stands still: along a run of equal steps it soon does.
SETTLED = 1e-10
# Readings of the first run whose covariances are kept, for runs that are like it no further.
REMEMBERED = 2048
# Series that are whitened side by side: each waits for its own last state, and the others need not wait with it. Eight
# take a third of the time (two fifths with two states), three as long as one after the other
LANES, WORTH_LANES = 8, 4


@njit(cache=True, error_model="numpy")
def gains(kind, begins, known, observe, spread, shared, carry, turn, fresh, power):  # type: ignore[no-untyped-def]
    """Gains of the filter, which do not depend on what is read.

    As long as a run's steps are those of the first run, so are its gains.

    Args:
        kind: (N,) row of the transition that leads to each reading.
        begins: (N,) True where the states are as before anything was read.
        known: (N,) False where nothing is read.
        observe: (K, D) weights of the states before the step in what is read.
        spread: (K,) variance of what is read, given these states.
        shared: (K, D) its covariance with the states after the step.
        carry: (K, D) by which each state decays.
        turn: (K, P) sine by which the first P pairs turn.
        fresh: (K, D) variances that the step adds.
        power: (D,) of the states at rest.

    Returns:
        (N, D) gains, and (N,) one over the standard deviation of each innovation; 0 where nothing is read.
    """
    count, states, pairs = len(kind), len(power), turn.shape[1]
    gain, scale = np.zeros((count, states)), np.zeros(count)
    covariance, carried = np.zeros((states, states)), np.zeros((states, states))
    seen = np.zeros(states)
    first = 1
    while first < count and not begins[first]:
        first += 1
    # before the first readings of the first run: the covariance, and whether it stands still
    stored = min(first, REMEMBERED) if first < count else 0
    before, still = np.zeros((stored, states, states)), np.zeros(stored, dtype=np.bool_)
    settled, alike, own, i = False, False, 0, -1
    while i < count - 1:
        i += 1
        k = kind[i]
        if begins[i]:
            own, alike, settled = i, i > 0, False
            covariance[:] = 0.0
            for a in range(states):
                covariance[a, a] = power[a]
        if alike:
            at = i - own
            if at < first and k == kind[at] and known[i] == known[at]:
                gain[i], scale[i] = gain[at], scale[at]
                continue
            alike = False
            at = min(at, stored - 1)
            covariance[:], settled, i = before[at], still[at], own + at
            k = kind[i]
        elif i < stored:
            before[i], still[i] = covariance, settled
        if i > own and settled and known[i] and known[i - 1] and k == kind[i - 1]:
            gain[i], scale[i] = gain[i - 1], scale[i - 1]
            continue
        settled = False
        total = spread[k]
        for a in range(states):
            seen[a] = 0.0
            for b in range(states):
                seen[a] += covariance[a, b] * observe[k, b]
            total += observe[k, a] * seen[a]
        # A P, then (A P) A^T
        for b in range(states):
            for p in range(pairs):
                x, y = covariance[2 * p, b], covariance[2 * p + 1, b]
                carried[2 * p, b] = carry[k, 2 * p] * x + turn[k, p] * y
                carried[2 * p + 1, b] = carry[k, 2 * p] * y - turn[k, p] * x
            for a in range(2 * pairs, states):
                carried[a, b] = carry[k, a] * covariance[a, b]
        if known[i]:
            scale[i] = 1.0 / np.sqrt(total)
            for a in range(states):
                along = shared[k, a]
                for b in range(states):
                    along += carried[a, b] * observe[k, b]
                gain[i, a] = along / total
        change = 0.0
        for a in range(states):
            for p in range(pairs):
                x, y = carried[a, 2 * p], carried[a, 2 * p + 1]
                carried[a, 2 * p] = carry[k, 2 * p] * x + turn[k, p] * y
                carried[a, 2 * p + 1] = carry[k, 2 * p] * y - turn[k, p] * x
            for b in range(2 * pairs, states):
                carried[a, b] *= carry[k, b]
            for b in range(states):
                new = carried[a, b] - gain[i, a] * gain[i, b] * total
                if a == b:
                    new = max(new + fresh[k, a], 0.0)
                change = max(change, abs(new - covariance[a, b]) / np.sqrt(power[a] * power[b]))
                carried[a, b] = new
        for a in range(states):
            for b in range(states):
                covariance[a, b] = 0.5 * (carried[a, b] + carried[b, a])
        settled = known[i] and not begins[i] and change < SETTLED
    return gain, scale


@njit(cache=True, nogil=True, error_model="numpy")
def innovations(values, kind, begins, observe, carry, turn, gain, scale):  # type: ignore[no-untyped-def]
    """(W, N) innovations over their standard deviations of W series (W, N); 0 where nothing is read."""
    series = len(values)
    out = np.zeros(values.shape)
    first = 0
    while series - first >= WORTH_LANES:
        last = min(first + LANES, series)
        _side_by_side(values[first:last], kind, begins, observe, carry, turn, gain, scale, out[first:last])
        first = last
    for w in range(first, series):
        _alone(values[w], kind, begins, observe, carry, turn, gain, scale, out[w])
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _alone(values, kind, begins, observe, carry, turn, gain, scale, out):  # type: ignore[no-untyped-def]
    """`innovations` of one series (N,), written to zeros (N,)."""
    states, pairs = observe.shape[1], turn.shape[1]
    state = np.zeros(states)
    for i in range(len(values)):
        k = kind[i]
        if begins[i]:
            state[:] = 0.0
        error = 0.0
        if scale[i] > 0.0:
            error = values[i]
            for a in range(states):
                error -= observe[k, a] * state[a]
            out[i] = error * scale[i]
        for p in range(pairs):
            x, y = state[2 * p], state[2 * p + 1]
            state[2 * p] = carry[k, 2 * p] * x + turn[k, p] * y
            state[2 * p + 1] = carry[k, 2 * p] * y - turn[k, p] * x
        for a in range(2 * pairs, states):
            state[a] *= carry[k, a]
        for a in range(states):
            state[a] += gain[i, a] * error


@njit(cache=True, nogil=True, error_model="numpy")
def _side_by_side(values, kind, begins, observe, carry, turn, gain, scale, out):  # type: ignore[no-untyped-def]
    """`innovations` of up to LANES series (W, N), written to zeros (W, N): the same as of each alone, to the last
    digit."""
    series, count = values.shape
    states, pairs = observe.shape[1], turn.shape[1]
    state, error = np.zeros((states, LANES)), np.zeros(LANES)
    for i in range(count):
        k = kind[i]
        if begins[i]:
            state[:] = 0.0
        if scale[i] > 0.0:
            for w in range(series):
                error[w] = values[w, i]
            for a in range(states):
                for w in range(LANES):
                    error[w] -= observe[k, a] * state[a, w]
            for w in range(series):
                out[w, i] = error[w] * scale[i]
        else:
            error[:] = 0.0
        for p in range(pairs):
            for w in range(LANES):
                x, y = state[2 * p, w], state[2 * p + 1, w]
                state[2 * p, w] = carry[k, 2 * p] * x + turn[k, p] * y
                state[2 * p + 1, w] = carry[k, 2 * p] * y - turn[k, p] * x
        for a in range(2 * pairs, states):
            for w in range(LANES):
                state[a, w] *= carry[k, a]
        for a in range(states):
            for w in range(LANES):
                state[a, w] += gain[i, a] * error[w]


@njit(cache=True)
def block_likelihood(values, steps, samples, white, correlated, length):  # type: ignore[no-untyped-def]
    """Twice the negative log-likelihood, less N log(2 pi), of means over adjoining blocks of white + OU noise.

    `gains` and `innovations` of one state in one pass: most noise needs no more, and its fit asks most often.

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
