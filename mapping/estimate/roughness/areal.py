"""Areal parameters: Sa, Sq, Sz, Ssk and Sku of a raster's heights beside the features (ISO 25178-2)."""

from __future__ import annotations

import numpy as np

from mapping import BoolArray, FloatArray, Interval
from mapping.estimate.roughness.filters import gaussian_mean
from mapping.estimate.roughness.sections import (
    kurtosis,
    mean_size,
    moments,
    root_mean_square,
    skewness,
    with_interval,
)

AREAL_NAMES = ("Sa", "Sq", "Sz", "Ssk", "Sku")


def areal_parameters(
    heights: FloatArray, keep: BoolArray, spacing: tuple[float, float], cutoff: float, short_cutoff: float | None = None
) -> tuple[dict[str, Interval], int]:
    """The parameters of the scale-limited surface, each with its 90 % interval, and the number of squares they rest on.

    Intervals come from squares as wide as the cut-off; Sz, which is of the whole area, has none.

    Args:
        heights: (M, N) over the base, m; NaN where nothing was felt.
        keep: (M, N) False where a feature is.
        spacing: of rows and of columns, m.
        cutoff: nesting index of the L-filter, m.
        short_cutoff: of the S-filter, m; None: no S-filter.

    Returns:
        AREAL_NAMES with their values (m; Ssk and Sku are numbers), empty if not one square fits; and the squares.
    """
    primary = np.where(keep, heights, np.nan)
    if short_cutoff is not None:
        primary = np.where(keep, gaussian_mean(primary, spacing, short_cutoff), np.nan)
    rough = primary - gaussian_mean(primary, spacing, cutoff)
    squares = []
    size, end = ([round(share * cutoff / step) for step in spacing] for share in (1.0, 0.5))
    inner = rough[end[0] : rough.shape[0] - end[0], end[1] : rough.shape[1] - end[1]]
    for row in range(0, inner.shape[0] - size[0] + 1, max(size[0], 1)):
        for column in range(0, inner.shape[1] - size[1] + 1, max(size[1], 1)):
            part = inner[row : row + size[0], column : column + size[1]]
            known = part[np.isfinite(part)]
            if part.size and len(known) >= 0.5 * part.size:
                squares.append(known)
    if not squares:
        return {}, 0
    sums, everything = np.array([moments(part) for part in squares]), np.concatenate(squares)
    span, nan = float(everything.max() - everything.min()), float("nan")
    values = {
        "Sa": with_interval(sums, mean_size),
        "Sq": with_interval(sums, root_mean_square),
        "Sz": Interval(span, nan, nan),
        "Ssk": with_interval(sums, skewness, signed=True),
        "Sku": with_interval(sums, kurtosis),
    }
    return values, len(squares)
