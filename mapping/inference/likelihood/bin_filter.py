"""BinFilter: whitens means over bins of white plus Ornstein-Uhlenbeck noise in O(n)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray
from mapping.inference.likelihood.window import Window
from mapping.instrument import Noise


@dataclass(frozen=True, eq=False)
class BinFilter:
    """The Kalman filter of the noise of a window's bins; its gains do not depend on the data.

    The state is the correlated noise at the last sample of a bin. The mean over the next bin and the state at its
    end are both linear in it, with innovations that are correlated with each other: exact for evenly spaced samples.

    Args:
        starts: (runs + 1,) first bin of each run, and n.
        carry, observe, gain: (n,) coefficients of m' = carry m + gain v, v = y - observe m.
        scale: (n,) one over the standard deviation of v, 1/m.
    """

    starts: IntArray
    carry: FloatArray
    observe: FloatArray
    gain: FloatArray
    scale: FloatArray

    def whiten(self, values: FloatArray) -> FloatArray:
        """Unit independent noise (W, n) from W series of bin means (W, n), m."""
        from mapping.inference.likelihood.whitening_kernels import whiten

        return np.asarray(
            whiten(np.ascontiguousarray(values), self.starts, self.carry, self.observe, self.gain, self.scale)
        )


def bin_filter(window: Window, noise: Noise, floor: float, inflation: FloatArray | None = None) -> BinFilter:
    """The filter for a window.

    Args:
        window: the bins.
        noise: level and correlation of a single sample.
        floor: standard deviation below which no sample is trusted, m, positive: what the model of the shape and
            of the base leaves out; a noise-free log is read with it.
        inflation: (n,) factors >= 1 on the bins' own variance (outliers), or None.
    """
    count = window.count.astype(np.float64)
    own = (noise.white**2 + floor**2) / count
    if inflation is not None:
        own = own * inflation
    step = _distance_from_previous(window)
    if noise.correlated == 0.0:
        zero = np.zeros(len(count))
        return BinFilter(window.starts, zero, zero, zero, 1.0 / np.sqrt(own))
    observe, spread, shared, carry, fresh = _transition(step / noise.length, count)
    level = noise.correlated**2
    if inflation is not None:
        own = own + (inflation - 1.0) * level
    return _gains(window.starts, observe, own + level * spread, level * shared, carry, level * fresh, level)


def _distance_from_previous(window: Window) -> FloatArray:
    """(n,) distance from the last sample of the bin before to the last of this one, m."""
    step = np.diff(window.last, prepend=0.0)
    first = window.starts[:-1]
    step[first] = 2.0 * window.half[first]
    return np.maximum(step, 0.0)


def _transition(x: FloatArray, count: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Of a unit OU process over bins of x correlation lengths and m samples, given the state before the bin:

    weight of the state in the mean, variance of the mean, its covariance with the state at the end, weight of the
    state in that, and its variance. Series where the closed forms cancel.
    """
    small = x < 1e-3
    each = np.maximum(x, 1e-3) / count
    loss, loss_all = -np.expm1(-each), -np.expm1(-np.maximum(x, 1e-3))
    ratio = loss_all / (count * loss)
    observe = (1.0 - loss) * ratio
    variance = (2.0 - loss) / (count * loss) - 2.0 * (1.0 - loss) * loss_all / (count * loss) ** 2
    carry = np.exp(-x)
    unit = x / count
    spread = np.where(small, unit * ((count + 1) - (count**2 - 1) / (3 * count)), variance - observe**2)
    shared = np.where(small, unit * (count + 1), ratio - observe * carry)
    observe = np.where(small, 1.0 - unit * (count + 1) / 2, observe)
    return observe, np.maximum(spread, 0.0), shared, carry, -np.expm1(-2.0 * x)


def _gains(
    starts: IntArray,
    observe: FloatArray,
    own: FloatArray,
    shared: FloatArray,
    carry: FloatArray,
    fresh: FloatArray,
    level: float,
) -> BinFilter:
    gain, scale = np.empty(len(own)), np.empty(len(own))
    for start, stop in itertools.pairwise(starts):
        variance = level
        for i in range(int(start), int(stop)):
            total = observe[i] ** 2 * variance + own[i]
            gain[i] = (carry[i] * observe[i] * variance + shared[i]) / total
            scale[i] = 1.0 / np.sqrt(total)
            variance = max(carry[i] ** 2 * variance + fresh[i] - gain[i] ** 2 * total, 0.0)
    return BinFilter(starts, carry, observe, gain, scale)
