"""The filter of a window's bins: it whitens means over bins of white and correlated noise in O(n)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping import FloatArray
from mapping.inference.likelihood.window import Window
from mapping.instrument import Filter, Noise, mean_steps


def bin_filter(window: Window, noise: Noise, floor: float, inflation: FloatArray | None = None) -> Filter:
    """The Kalman filter of the noise of a window's bins.

    The states are the correlated noise at the last sample of a bin (see `instrument.states`). The mean over the next
    bin and the states at its end are both linear in them, with innovations that are correlated with each other: exact
    for evenly spaced samples.

    Args:
        window: the bins.
        noise: level and correlation of a single sample.
        floor: standard deviation below which no sample is trusted, m, positive: what the model of the shape and
            of the base leaves out; a noise-free log is read with it.
        inflation: (n,) factors >= 1 on the bins' own variance (outliers), or None.
    """
    # of one pass; of a mean over several all variances are less by their number
    count = window.count / np.asarray(window.passes, dtype=np.float64)
    own = (noise.white**2 + floor**2) / count
    if inflation is not None:
        own = own * inflation + (inflation - 1.0) * noise.correlated_sd**2
    own = own + np.square(window.jumped)
    begins = np.zeros(len(count), dtype=bool)
    begins[window.starts[:-1]] = True
    steps = mean_steps(noise.terms, _distance_from_previous(window), own, np.maximum(count, 1.0))
    one = steps.filter(np.arange(len(count)), begins, np.ones(len(count), dtype=bool))
    # levels change slowly against a bin's memory of those before it
    return replace(one, scale=one.scale * np.sqrt(window.passes) / window.level)


def _distance_from_previous(window: Window) -> FloatArray:
    """(n,) distance from the last sample of the bin before to the last of this one, m."""
    step = np.diff(window.last, prepend=0.0)
    first = window.starts[:-1]
    step[first] = 2.0 * window.half[first]
    return np.maximum(step, 0.0)
