"""What whitened traces weigh, compiled: chi-square of many templates in one pass of the filter, O(n) each."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray, IntArray

# Templates that are whitened side by side: a filter waits for its own last state, others need not wait with it. Of 4, 8
# and 16 the fastest, by 1.5 against one after the other
LANES = 8


@njit(cache=True, nogil=True)
def chi_square(
    height: FloatArray,
    templates: FloatArray,
    starts: IntArray,
    carry: FloatArray,
    observe: FloatArray,
    gain: FloatArray,
    turn: FloatArray,
    scale: FloatArray,
    basis: FloatArray,
    shrink: FloatArray,
) -> FloatArray:
    """(W,) squared lengths of heights (n,) less templates (W, n), whitened, each run's nuisance marginalised.

    |e|^2 - sum_j g_j^2 (u_j . e)^2 with the orthonormal columns u_j of `basis` (n, Q) within each run and
    `shrink` (runs, Q) holding g_j^2. `whiten` and this in one pass, which keeps no whitened series.
    """
    walkers, count = templates.shape[0], basis.shape[1]
    states, pairs = carry.shape[1], turn.shape[1]
    total = np.zeros(walkers)
    innovation, white, square = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    state, dots = np.empty((states, LANES)), np.empty((count, LANES))
    for first in range(0, walkers, LANES):
        square[:] = 0.0
        for run in range(len(starts) - 1):
            dots[:] = 0.0
            state[:] = 0.0
            for i in range(starts[run], starts[run + 1]):
                for lane in range(LANES):  # the last template fills the lanes that are left over
                    innovation[lane] = height[i] - templates[min(first + lane, walkers - 1), i]
                for a in range(states):
                    for lane in range(LANES):
                        innovation[lane] -= observe[i, a] * state[a, lane]
                for p in range(pairs):
                    for lane in range(LANES):
                        x, y = state[2 * p, lane], state[2 * p + 1, lane]
                        state[2 * p, lane] = carry[i, 2 * p] * x + turn[i, p] * y
                        state[2 * p + 1, lane] = carry[i, 2 * p] * y - turn[i, p] * x
                for a in range(2 * pairs):
                    for lane in range(LANES):
                        state[a, lane] += gain[i, a] * innovation[lane]
                for a in range(2 * pairs, states):
                    for lane in range(LANES):
                        state[a, lane] = carry[i, a] * state[a, lane] + gain[i, a] * innovation[lane]
                for lane in range(LANES):
                    white[lane] = innovation[lane] * scale[i]
                    square[lane] += white[lane] * white[lane]
                for j in range(count):
                    for lane in range(LANES):
                        dots[j, lane] += white[lane] * basis[i, j]
            for j in range(count):
                for lane in range(LANES):
                    square[lane] -= shrink[run, j] * dots[j, lane] * dots[j, lane]
        for lane in range(min(LANES, walkers - first)):
            total[first + lane] = square[lane]
    return total


@njit(cache=True, nogil=True)
def project(white: FloatArray, starts: IntArray, basis: FloatArray, shrink: FloatArray) -> None:
    """Take the marginalised nuisance out of whitened series (W, n) in place, so that |e|^2 is `chi_square`."""
    walkers = white.shape[0]
    count = basis.shape[1]
    for w in range(walkers):
        for run in range(len(starts) - 1):
            for j in range(count):
                dot = 0.0
                for i in range(starts[run], starts[run + 1]):
                    dot += white[w, i] * basis[i, j]
                dot *= 1.0 - np.sqrt(max(0.0, 1.0 - shrink[run, j]))
                for i in range(starts[run], starts[run + 1]):
                    white[w, i] -= dot * basis[i, j]
