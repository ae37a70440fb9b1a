"""Filters: the Gaussian mean line of ISO 16610-21, and the mean surface of ISO 16610-61."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mapping import BoolArray, FloatArray

# A wave as long as the nesting index is passed by half (ISO 16610-21, 4.2): alpha = sqrt(ln 2 / pi), and the weighting
# function exp(-pi (x / (alpha L))^2) is a Gaussian of the standard deviation alpha L / sqrt(2 pi)
SD_PER_NESTING_INDEX = math.sqrt(math.log(2.0) / math.pi) / math.sqrt(2.0 * math.pi)
# Its tails are cut where they weigh 1e-6 of the middle; the standard allows it from half an index on
_TRUNCATED = 5.3
# The standard series of nesting indices of the L-filter (ISO 21920-3), m
NESTING_INDICES = (0.08e-3, 0.25e-3, 0.8e-3, 2.5e-3, 8e-3)
# A mean line that rests on less than this share of its weights is not known: features or ends take the rest. Where one
# side of the window is missing, the variance of the weighted mean is twice that of the whole window.
LEAST_WEIGHT = 0.5


def gaussian_mean(
    heights: FloatArray, spacing: float | Sequence[float], nesting_index: float, keep: BoolArray | None = None
) -> FloatArray:
    """The mean line of a profile, or the mean surface of a raster; NaN where too little is known around.

    The weights of what is left out are shared by the rest (the zeroth-order regression of ISO 16610-31, not robust),
    and so at the ends: there the line is known only from one side, and evaluation begins half an index further in.

    Args:
        heights: (N,) or (M, N), m.
        spacing: of samples, m; one for each axis.
        nesting_index: of the filter (cut-off wavelength), m.
        keep: which heights count; None: all that are numbers.

    Reference: ISO 16610-21:2011, ISO 16610-61:2015, by scipy.ndimage.
    """
    from scipy.ndimage import gaussian_filter

    known = np.isfinite(heights) if keep is None else keep & np.isfinite(heights)
    steps = np.broadcast_to(np.asarray(spacing, dtype=np.float64), (heights.ndim,))
    sd = SD_PER_NESTING_INDEX * nesting_index / steps
    weights = known.astype(np.float64)
    offset = float(heights[known].mean()) if known.any() else 0.0
    values = np.where(known, heights - offset, 0.0)
    total = gaussian_filter(values, sd, mode="constant", truncate=_TRUNCATED)
    weight = gaussian_filter(weights, sd, mode="constant", truncate=_TRUNCATED)
    return np.where(weight > LEAST_WEIGHT - 1e-9, offset + total / np.maximum(weight, LEAST_WEIGHT), np.nan)


def suited_cutoff(length: float, sections: int) -> float | None:
    """The largest nesting index of the standard series of which so many sections and an end fit; None if none does.

    Args:
        length: of a profile, m.
        sections: of one index each.
    """
    fitting = [index for index in NESTING_INDICES if (sections + 1) * index <= length * (1.0 + 1e-9)]
    return max(fitting, default=None)
