"""BinFilter: whitens means over bins of white and correlated noise in O(n)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray
from mapping.inference.likelihood.window import Window
from mapping.instrument import Noise, mean_steps


@dataclass(frozen=True, eq=False)
class BinFilter:
    """The Kalman filter of the noise of a window's bins; its gains do not depend on the data.

    The states are the correlated noise at the last sample of a bin (see `instrument.states`). The mean over the next
    bin and the states at its end are both linear in them, with innovations that are correlated with each other: exact
    for evenly spaced samples.

    Args:
        starts: (runs + 1,) first bin of each run, and n.
        carry, observe, gain: (n, D) coefficients of m' = carry m + gain v, v = y - observe . m, for D states.
        turn: (n, P) sine by which the first P pairs of states turn.
        scale: (n,) one over the standard deviation of v, 1/m.
    """

    starts: IntArray
    carry: FloatArray
    observe: FloatArray
    gain: FloatArray
    turn: FloatArray
    scale: FloatArray

    def whiten(self, values: FloatArray) -> FloatArray:
        """Unit independent noise (W, n) from W series of bin means (W, n), m."""
        from mapping.inference.likelihood.whitening_kernels import whiten

        return np.asarray(
            whiten(
                np.ascontiguousarray(values),
                self.starts,
                self.carry,
                self.observe,
                self.gain,
                self.turn,
                self.scale,
            )
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
        own = own * inflation + (inflation - 1.0) * noise.correlated_sd**2
    if not noise.terms:
        none = np.zeros((len(count), 0))
        return BinFilter(window.starts, none, none, none, none, 1.0 / np.sqrt(own))
    begins = np.zeros(len(count), dtype=bool)
    begins[window.starts[:-1]] = True
    steps = mean_steps(noise.terms, _distance_from_previous(window), own, count)
    filter_ = steps.filter(np.arange(len(count)), begins, np.ones(len(count), dtype=bool))
    return BinFilter(window.starts, steps.carry, steps.observe, filter_.gain, steps.turn, filter_.scale)


def _distance_from_previous(window: Window) -> FloatArray:
    """(n,) distance from the last sample of the bin before to the last of this one, m."""
    step = np.diff(window.last, prepend=0.0)
    first = window.starts[:-1]
    step[first] = 2.0 * window.half[first]
    return np.maximum(step, 0.0)
