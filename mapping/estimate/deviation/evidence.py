"""Evidence: how probable the heights are if some causes displace the surface, whatever their sizes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray

# An explanation is preferred if it makes the heights so much more probable: a thousand times
LEAST_GAIN = float(np.log(1e3))
# Less noise than this many tip radii is rounding
ROUNDING = 1e-9
# Correlated part of a block's noise in units of the white part, and its length in blocks: from none to offsets of
# whole sweeps
CORRELATED, CORRELATION_BLOCKS = (1.0, 3.0, 10.0, 30.0), (2.0, 8.0, 32.0, 128.0)
# White noise that is tried, against that of neighbouring bins: differences between sweeps come on top
NOISE_GRID = np.geomspace(0.7, 100.0, 28)


@dataclass(frozen=True, eq=False)
class Whitened:
    """Heights and columns after a filter that makes the noise white with unit variance, once per law of noise.

    Args:
        gram: (K, K) products of the columns.
        moment: (K,) of columns and heights.
        square: of the heights.
        log_scale: sum of the logarithms of the filter's gains.
        count: weight of all blocks.
    """

    gram: FloatArray
    moment: FloatArray
    square: float
    log_scale: float
    count: float


@dataclass(frozen=True, eq=False)
class Fit:
    """One explanation at its best noise.

    Args:
        log_evidence: logarithm of the marginal likelihood.
        coefficients: (K,) posterior means, m.
        noise: white standard deviation of a block, m.
        law: number of the law of noise.
    """

    log_evidence: float
    coefficients: FloatArray
    noise: float
    law: int


def laws() -> list[tuple[float, float]]:
    """Of the noise: (standard deviation of the correlated part against the white one, correlation length in blocks)."""
    return [(0.0, 1.0), *((level, length) for level in CORRELATED for length in CORRELATION_BLOCKS)]


def every_law() -> list[int]:
    """Their numbers."""
    return list(range(len(laws())))


def whitened(
    columns: FloatArray, piece: IntArray, place: FloatArray, weight: FloatArray, step: float
) -> list[Whitened]:
    """One for each law of noise.

    Args:
        columns: (B, 1 + K) heights first.
        piece: (B,) number of the stretch of each block, not decreasing.
        place: (B,) arclength in it, m.
        weight: (B,) what each block counts (see Blocks).
        step: between blocks, m.
    """
    found, root = [], np.sqrt(weight)[:, None]
    for level, length in laws():
        white, log_gain = decorrelated(columns, piece, place / step, level, length)
        white = white * root
        y, a = white[:, 0], white[:, 1:]
        found.append(Whitened(a.T @ a, a.T @ y, float(y @ y), float(weight @ log_gain), float(weight.sum())))
    return found


def decorrelated(
    columns: FloatArray, piece: IntArray, place: FloatArray, level: float, length: float
) -> tuple[FloatArray, FloatArray]:
    """(B, K) columns as noise of one law would be white with unit variance, and (B,) logarithms of the filter's gain.

    A Kalman filter of one state along all pieces at once: its innovations are independent.

    Args:
        columns: (B, K).
        piece: (B,) number of the stretch of each block, not decreasing.
        place: (B,) place in it, in blocks.
        level, length: of the law (see `laws`).
    """
    if level == 0.0:
        return columns, np.zeros(len(columns))
    _, starts, counts = np.unique(piece, return_index=True, return_counts=True)
    white, log_gain = np.empty_like(columns), np.empty(len(columns))
    mean, spread = np.zeros((len(starts), columns.shape[1])), np.full(len(starts), level**2)
    for k in range(int(counts.max())):
        here = np.flatnonzero(counts > k)
        which = starts[here] + k
        if k:
            keep = np.exp(-np.abs(place[which] - place[which - 1]) / length)
            mean[here] *= keep[:, None]
            spread[here] = keep**2 * spread[here] + (1.0 - keep**2) * level**2
        total = spread[here] + 1.0
        innovation = columns[which] - mean[here]
        white[which] = innovation / np.sqrt(total)[:, None]
        gain = spread[here] / total
        mean[here] += gain[:, None] * innovation
        spread[here] *= 1.0 - gain
        log_gain[which] = 0.5 * np.log(total)
    return white, log_gain


def best_fit(seen: list[Whitened], which: IntArray, prior: FloatArray, noise: float, among: list[int]) -> Fit:
    """The evidence of the columns `which` with Gaussian coefficients, at the best of the tried noises.

    Args:
        seen: heights and columns, for each law of noise.
        which: (K,) columns that take part.
        prior: (K,) standard deviations of their coefficients, m.
        noise: white standard deviation of a block by neighbouring bins, m.
        among: numbers of the laws to try.
    """
    found: list[Fit] = []
    for law in among:
        each = seen[law]
        gram = each.gram[np.ix_(which, which)] * np.outer(prior, prior)
        values, vectors = np.linalg.eigh(gram) if len(which) else (np.zeros(0), np.zeros((0, 0)))
        values, moment = np.maximum(values, 0.0), vectors.T @ (each.moment[which] * prior)
        variance = (noise * NOISE_GRID[:, None]) ** 2
        explained = (moment**2 / (values + variance)).sum(axis=1)
        variance = variance[:, 0]
        misfit = np.maximum(each.square - explained, 0.0) / variance
        curved = np.log1p(values / variance[:, None]).sum(axis=1)
        log = -0.5 * (misfit + curved + each.count * np.log(2.0 * np.pi * variance)) - each.log_scale
        top = int(log.argmax())
        coefficients = prior * (vectors @ (moment / (values + variance[top])))
        found.append(Fit(float(log[top]), coefficients, float(np.sqrt(variance[top])), law))
    return max(found, key=lambda fit: fit.log_evidence)
