"""Sections: parameters of a surface with intervals, from how much they differ from section to section."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mapping import FloatArray, Interval

# Sections of a default evaluation (ISO 21920-3)
EVALUATED_SECTIONS = 5
# Draws of sections, with replacement: the 5 and 95 % quantiles are then known to 3 % of the interval's width
DRAWS = 2000
# Sections that are drawn at once: 8 MB
_MOST_DRAWN = 1_000_000


def with_interval(table: FloatArray, value: Callable[[FloatArray], FloatArray], *, signed: bool = False) -> Interval:
    """A parameter and its 90 % interval, by the bootstrap over sections.

    The spread of the draws is widened to that of Student's t with as many sections as there are: of five, a bootstrap
    alone covers 80 %. It is the spread of the logarithm where the parameter cannot be negative: of a scale all errors
    are ratios, and where one section of many holds most of the height an interval about the value began below zero.
    One section knows no interval: its ends are NaN.

    Args:
        table: (S, K) sums over each section that the parameter is a function of.
        value: of the sums (..., K) of all sections, the parameter (...).
        signed: True of a parameter that may be negative.
    """
    from scipy.special import stdtrit

    middle = float(value(table.sum(axis=0)))
    count = len(table)
    if count < 2 or not np.isfinite(middle):
        return Interval(middle, float("nan"), float("nan"))
    low, high = np.nanquantile(value(_drawn(table)), [0.05, 0.95])
    wider = float(np.sqrt(count / (count - 1.0)) * stdtrit(count - 1, 0.95) / 1.6448536)
    if signed or middle <= 0.0:
        return Interval(middle, middle - wider * (middle - float(low)), middle + wider * (float(high) - middle))
    return Interval(middle, middle * (float(low) / middle) ** wider, middle * (float(high) / middle) ** wider)


def _drawn(table: FloatArray) -> FloatArray:
    """(DRAWS, K) sums over as many sections as there are in a table (S, K), drawn with replacement."""
    rng, count = np.random.default_rng(0), len(table)
    block = max(1, _MOST_DRAWN // count)
    sums = []
    for first in range(0, DRAWS, block):
        size = min(block, DRAWS - first)
        index = rng.integers(0, count, (size, count)) + count * np.arange(size)[:, None]
        sums.append(np.bincount(index.ravel(), minlength=size * count).reshape(size, count) @ table)
    return np.concatenate(sums)


def moments(heights: FloatArray) -> FloatArray:
    """(5,) number of heights, sums of their absolute values, squares, third and fourth powers."""
    square = heights * heights  # the third and fourth powers of numpy take thirty times as long as products
    return np.array(
        [len(heights), np.abs(heights).sum(), square.sum(), (square * heights).sum(), (square * square).sum()]
    )


def mean_size(sums: FloatArray) -> FloatArray:
    """Ra, Sa: the mean absolute height, from `moments`."""
    return np.asarray(sums[..., 1] / sums[..., 0])


def root_mean_square(sums: FloatArray) -> FloatArray:
    """Rq, Sq."""
    return np.sqrt(sums[..., 2] / sums[..., 0])


def skewness(sums: FloatArray) -> FloatArray:
    """Rsk, Ssk; NaN of heights that are all zero."""
    with np.errstate(invalid="ignore"):
        return np.asarray(sums[..., 3] / sums[..., 0] / root_mean_square(sums) ** 3)


def kurtosis(sums: FloatArray) -> FloatArray:
    """Rku, Sku; NaN of heights that are all zero."""
    with np.errstate(invalid="ignore"):
        return np.asarray(sums[..., 4] / sums[..., 0] / root_mean_square(sums) ** 4)
