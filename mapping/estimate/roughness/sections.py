"""Sections: parameters of a surface with intervals, from how much they differ from section to section."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from mapping import FloatArray, Interval

# Sections of a default evaluation (ISO 21920-3)
EVALUATED_SECTIONS = 5
# Draws of sections, with replacement: the 5 and 95 % quantiles are then known to 3 % of the interval's width
DRAWS = 2000


def with_interval(table: FloatArray, value: Callable[[FloatArray], FloatArray]) -> Interval:
    """A parameter and its 90 % interval, by the bootstrap over sections.

    The spread of the draws is widened to that of Student's t with as many sections as there are: of five, a bootstrap
    alone covers 80 %. One section knows no interval: its ends are NaN.

    Args:
        table: (S, K) sums over each section that the parameter is a function of.
        value: of the sums (..., K) of all sections, the parameter (...).
    """
    from scipy.stats import t

    middle = float(value(table.sum(axis=0)))
    count = len(table)
    if count < 2 or not np.isfinite(middle):
        return Interval(middle, float("nan"), float("nan"))
    draws = value(_times_drawn(count) @ table)
    low, high = np.nanquantile(draws, [0.05, 0.95])
    wider = float(np.sqrt(count / (count - 1.0)) * t.ppf(0.95, count - 1) / 1.6448536)
    return Interval(middle, middle - wider * (middle - float(low)), middle + wider * (float(high) - middle))


@lru_cache(maxsize=2)
def _times_drawn(count: int) -> FloatArray:
    """(DRAWS, count) how often each section is in each draw: every parameter is judged by the same draws."""
    index = np.random.default_rng(0).integers(0, count, (DRAWS, count)) + count * np.arange(DRAWS)[:, None]
    return np.bincount(index.ravel(), minlength=DRAWS * count).reshape(DRAWS, count).astype(np.float64)


def moments(heights: FloatArray) -> FloatArray:
    """(5,) number of heights, sums of their absolute values, squares, third and fourth powers."""
    return np.array([len(heights), np.abs(heights).sum(), *[(heights**power).sum() for power in (2, 3, 4)]])


def mean_size(sums: FloatArray) -> FloatArray:
    """Ra, Sa: the mean absolute height, from `moments`."""
    return np.asarray(sums[..., 1] / sums[..., 0])


def root_mean_square(sums: FloatArray) -> FloatArray:
    """Rq, Sq."""
    return np.sqrt(sums[..., 2] / sums[..., 0])


def skewness(sums: FloatArray) -> FloatArray:
    """Rsk, Ssk."""
    return np.asarray(sums[..., 3] / sums[..., 0] / root_mean_square(sums) ** 3)


def kurtosis(sums: FloatArray) -> FloatArray:
    """Rku, Sku."""
    return np.asarray(sums[..., 4] / sums[..., 0] / root_mean_square(sums) ** 4)
