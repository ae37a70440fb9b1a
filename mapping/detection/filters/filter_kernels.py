"""Matched filters along a profile, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

# Values that numpy adds up one after the other, and in eight sums side by side; of more the halves first
IN_A_ROW, IN_EIGHT_SUMS = 8, 128


@njit(cache=True, error_model="numpy", nogil=True)
def filtered(bins, weights, edge, out):  # type: ignore[no-untyped-def]
    """Write the filter's weighted sum at each of the bins (n,); beyond the profile's ends there is nothing.

    Args:
        bins: (n,).
        weights: (2 M + 1,) of a window all of which exists.
        edge: (M, 2 M + 1) weights where only i bins exist before the middle; mirrored at the far end.
        out: (n,).
    """
    count, reach = len(bins), len(weights) // 2
    short = min(len(edge), count)
    for i in range(short):
        _sum_at(i, edge[i], reach, bins, out)
    for i in range(count - short, count):
        _sum_at(i, edge[count - 1 - i, ::-1], reach, bins, out)
    middle = out[short : max(short, count - short)]
    middle[:] = 0.0
    last = len(weights) // 4 * 4
    for k in range(0, last, 4):  # four at once: each sum is read and written a quarter as often
        a, b, c, d, part = weights[k], weights[k + 1], weights[k + 2], weights[k + 3], bins[short - reach + k :]
        for i in range(len(middle)):
            middle[i] = middle[i] + a * part[i] + b * part[i + 1] + c * part[i + 2] + d * part[i + 3]
    for k in range(last, len(weights)):
        weight, part = weights[k], bins[short - reach + k :]
        for i in range(len(middle)):
            middle[i] += weight * part[i]


@njit(cache=True, error_model="numpy", nogil=True)
def _sum_at(i, weights, reach, bins, out):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(max(0, reach - i), min(len(weights), reach + len(bins) - i)):
        total += weights[k] * bins[i - reach + k]
    out[i] = total


@njit(cache=True, error_model="numpy", nogil=True)
def peaks(  # type: ignore[no-untyped-def]
    profile, coarse, reach, weights_at, weights, edge_at, edge, sd, edge_sd_at, edge_sd, threshold, highest, certainty
):
    """(P, 4) signal-to-noise ratio, place, number of the filter and height of each local maximum over place.

    All filters of a bank in one pass: a profile of a few hundred bins is asked by a dozen of them, ten thousand times.

    Args:
        profile: (n,) heights in bins.
        coarse, reach: (F,) bins of the profile in one of each filter's, and M of its 2 M + 1 weights.
        weights_at, weights: where those of each filter begin, and all in a row.
        edge_at, edge: the same of its (M, 2 M + 1) weights near the profile's ends.
        sd: (F,) of each filter's estimate.
        edge_sd_at, edge_sd: the same near the ends, where those of each filter begin.
        threshold: what a maximum must exceed.
        highest: (F,) height above which it is none.
        certainty: (F, n) expected over actual sd of what is seen in each bin; (0, 0) if it is 1.
    """
    most = 0
    for k in range(len(coarse)):
        most += len(profile) // coarse[k] // 2 + 1
    out, found = np.empty((most, 4)), 0
    bins, heights = np.empty(len(profile)), np.empty(len(profile))
    for k in range(len(coarse)):
        size, count, width = coarse[k], len(profile) // coarse[k], 2 * reach[k] + 1
        for i in range(count):
            bins[i] = profile[i] if size == 1 else _sum_of(profile, i * size, size) / size
        filtered(
            bins[:count],
            weights[weights_at[k] : weights_at[k] + width],
            edge[edge_at[k] : edge_at[k] + reach[k] * width].reshape(reach[k], width),
            heights[:count],
        )
        short = min(reach[k], count)
        before, here = -1.0, -1.0  # beyond the ends there is nothing
        for i in range(count + 1):
            after = -1.0
            if i < count:
                own = edge_sd[edge_sd_at[k] + i] if i < short else sd[k]
                if count - 1 - i < short:
                    own = max(own, edge_sd[edge_sd_at[k] + count - 1 - i])
                after = abs(heights[i]) / own
                if len(certainty) > 0:
                    after *= certainty[k, i * size]
                if abs(heights[i]) > highest[k]:
                    after = 0.0
            if here > threshold and here >= before and here > after:
                out[found, 0], out[found, 1] = here, int((i - 0.5) * size)
                out[found, 2], out[found, 3] = k, heights[i - 1]
                found += 1
            before, here = here, after
    return out[:found]


@njit(cache=True, error_model="numpy", nogil=True)
def _sum_of(values, first, count):  # type: ignore[no-untyped-def]
    """The sum of so many values, in the order in which numpy adds them: the same to the last digit."""
    if count < IN_A_ROW:
        total = 0.0
        for i in range(first, first + count):
            total += values[i]
        return total
    if count > IN_EIGHT_SUMS:
        half = count // 2 // IN_A_ROW * IN_A_ROW
        return _sum_of(values, first, half) + _sum_of(values, first + half, count - half)
    a, b, c, d = values[first], values[first + 1], values[first + 2], values[first + 3]
    e, f, g, h = values[first + 4], values[first + 5], values[first + 6], values[first + 7]
    whole = count // IN_A_ROW * IN_A_ROW
    for i in range(first + IN_A_ROW, first + whole, IN_A_ROW):
        a, b, c, d = a + values[i], b + values[i + 1], c + values[i + 2], d + values[i + 3]
        e, f, g, h = e + values[i + 4], f + values[i + 5], g + values[i + 6], h + values[i + 7]
    total = ((a + b) + (c + d)) + ((e + f) + (g + h))
    for i in range(first + whole, first + count):
        total += values[i]
    return total


@njit(cache=True, error_model="numpy", nogil=True)
def dominant(spans, taken):  # type: ignore[no-untyped-def]
    """(P,) which spans (P, 2), middle and half-width, overlap none before them and none of those taken (T, 2)."""
    kept = np.empty(len(spans), dtype=np.bool_)
    for i in range(len(spans)):
        kept[i] = not (_overlaps(spans[i], taken) or _overlaps(spans[i], spans[:i]))
    return kept


@njit(cache=True, error_model="numpy", nogil=True)
def _overlaps(span, others):  # type: ignore[no-untyped-def]
    found, j = False, 0
    while j < len(others) and not found:
        found = abs(span[0] - others[j, 0]) < span[1] + others[j, 1]
        j += 1
    return found
