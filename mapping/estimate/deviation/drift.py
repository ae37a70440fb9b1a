"""Drift: of the whole recording evenly in time, as of an instrument that warms up, or of each sweep on its own.

The first is one number, judged with the causes that are the body's (see `explain`). The second is an offset and a
slope of each sweep, as of an instrument that is zeroed anew. Whether the sweeps have such lines is judged by evidence:
against noise that wanders along the sweeps (white and an Ornstein-Uhlenbeck part, which also makes sweeps stand at
different levels), the lines of all sweeps are Gaussian with one variance of the offsets and one of the slopes, and the
likelihood of both has a closed form. What is taken off is each line's expectation: shrunk where the noise may be what
is seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mapping import FloatArray, IntArray, Trace, length_text
from mapping.base import LaidTrace
from mapping.estimate.deviation.evidence import NOISE_GRID, decorrelated, laws

# Standard deviations of the sweeps' offsets and half rises that are tried, against the noise of a block: a factor of
# three apart, for a variance that is wrong by that costs a fifth of what one sweep says
LINES = (0.0, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)


@dataclass(frozen=True)
class SteadyDrift:
    """An even drift from the first sample on.

    Args:
        begin: time of the first sample, s.
        rate: m/s along the normals of the base.
        whole: by how much until the last sample, m.
    """

    begin: float
    rate: float
    whole: float

    @classmethod
    def over(cls, t: FloatArray, whole: float) -> SteadyDrift:
        """A drift of so much, m, over times (N,), s."""
        begin, end = float(t.min()), float(t.max())
        return cls(begin, whole / max(end - begin, np.finfo(float).tiny), whole)

    def without(self, laid: LaidTrace) -> Trace:
        """The trace with the drift taken off along the normals of the base that it lies on."""
        return _lowered(laid, self.rate * (laid.t - self.begin))

    def sentence(self) -> str:
        """What was found and done."""
        way = "upwards" if self.whole > 0 else "downwards"
        return f"the instrument drifts {way} by {length_text(abs(self.whole), 2)} over the recording: taken off"

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        return {"begin": self.begin, "rate": self.rate}


@dataclass(frozen=True, eq=False)
class Drift:
    """Lines of the sweeps that are no part of the body.

    Args:
        sweep: (S,) numbers of the sweeps.
        middle, half: (S,) arclengths of their middles and half their lengths, m.
        line: (S, 2) height in the middle and half the rise, m.
        gain: logarithm of how much more probable the heights are with them.
    """

    sweep: IntArray
    middle: FloatArray
    half: FloatArray
    line: FloatArray
    gain: float

    def at(self, sweep: IntArray, place: FloatArray) -> FloatArray:
        """(N,) heights of the lines at arclengths (N,) of sweeps (N,), m; zero where nothing is known."""
        k = np.minimum(np.searchsorted(self.sweep, sweep), len(self.sweep) - 1)
        line = self.line[k, 0] + self.line[k, 1] * (place - self.middle[k]) / self.half[k]
        return np.where(self.sweep[k] == sweep, line, 0.0)

    def without(self, laid: LaidTrace) -> Trace:
        """The trace with each sweep's line taken off along the normals of the base that it lies on."""
        place = np.concatenate([own.arclength for own in laid.laid_sweeps])
        return _lowered(laid, self.at(laid.sweep, place))

    def sentence(self) -> str:
        """What was found and done."""
        offset, rise = (float(np.sqrt(np.mean(self.line[:, k] ** 2))) for k in range(2))
        return (
            f"the sweeps drift: offsets of {length_text(offset, 2)} and rises of {length_text(2 * rise, 2)} from end "
            "to end (rms), each sweep its own, were taken off"
        )

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        return {"sweep": self.sweep.tolist(), "line": self.line.tolist()}


def drift(
    sweep: IntArray, place: FloatArray, height: FloatArray, weight: FloatArray, noise: float, step: float
) -> Drift:
    """The likeliest lines of the sweeps.

    Args:
        sweep: (B,) number of each block's sweep.
        place: (B,) arclengths, m, increasing along a sweep.
        height: (B,) m.
        weight: (B,) what each block counts (see Blocks).
        noise: standard deviation of a block by its neighbours, m.
        step: between blocks, m.
    """
    order = np.argsort(sweep, kind="stable")
    sweep, place, height, weight = sweep[order], place[order], height[order], weight[order]
    numbers, first, row, counts = np.unique(sweep, return_index=True, return_inverse=True, return_counts=True)
    middle = 0.5 * (place[first] + place[first + counts - 1])
    half = np.maximum(0.5 * (place[first + counts - 1] - place[first]), step)
    columns = np.column_stack([height, np.ones(len(height)), (place - middle[row]) / half[row]])
    best: _Best | None = None
    nothing, told = -np.inf, np.add.reduceat(weight, first)
    for law in laws():
        flat, log_gain = decorrelated(columns, sweep, place / step, *law)
        products = np.add.reduceat(weight[:, None, None] * flat[:, :, None] * flat[:, None, :], first, axis=0)
        grams = _Grams(products, told, float(weight @ log_gain))
        for white in noise * NOISE_GRID:
            log = _likelihoods(grams, white, noise)
            nothing = max(nothing, float(log[0, 0]))
            top = np.unravel_index(int(log.argmax()), log.shape)
            if best is None or log[top] > best.log:
                spreads = noise * np.array([LINES[k] for k in top])
                best = _Best(float(log[top]), grams, float(white), spreads)
    assert best is not None  # there are laws
    return Drift(numbers, middle, half, best.lines(), best.log - nothing)


def _lowered(laid: LaidTrace, height: FloatArray) -> Trace:
    """The trace (N) with heights (N,), m, taken off along the normals of the base that it lies on."""
    shift = height[:, None] * laid.feet().normals
    contacts = None if laid.contacts is None else laid.contacts - shift
    moved = laid.centers - shift
    return Trace(laid.t, moved, laid.sweep, laid.tip_radius, laid.normals, contacts, laid.force, laid.resolution)


@dataclass(frozen=True, eq=False)
class _Grams:
    """Products of whitened heights, ones and places, of each sweep (S, 3, 3), its weight (S,), and what whitening did
    to the density."""

    products: FloatArray
    counts: FloatArray
    log_scale: float


@dataclass(frozen=True, eq=False)
class _Best:
    """The likeliest noise and spreads (2,) of the lines so far."""

    log: float
    grams: _Grams
    white: float
    spreads: FloatArray

    def lines(self) -> FloatArray:
        """(S, 2) expected lines."""
        g, t = self.grams.products, self.spreads
        inner = np.eye(2) + t[:, None] * t * g[:, 1:, 1:] / self.white**2
        right = (t * g[:, 1:, 0] / self.white**2)[..., None]
        return np.asarray(t * np.linalg.solve(inner, right)[..., 0])


def _likelihoods(grams: _Grams, white: float, noise: float) -> FloatArray:
    """(T, T) marginal log-likelihood for each pair of spreads of LINES."""
    g, variance = grams.products, white**2
    offset = (noise * np.array(LINES))[:, None, None]
    rise = (noise * np.array(LINES))[None, :, None]
    b11 = 1.0 + offset**2 * g[:, 1, 1] / variance
    b22 = 1.0 + rise**2 * g[:, 2, 2] / variance
    b12 = offset * rise * g[:, 1, 2] / variance
    determinant = b11 * b22 - b12**2
    v1, v2 = offset * g[:, 0, 1], rise * g[:, 0, 2]
    explained = (v1**2 * b22 - 2 * v1 * v2 * b12 + v2**2 * b11) / determinant / variance**2
    each = g[:, 0, 0] / variance - explained + grams.counts * np.log(2 * np.pi * variance) + np.log(determinant)
    return np.asarray(-0.5 * each.sum(axis=-1) - grams.log_scale)
