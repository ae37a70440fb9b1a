"""Profile parameters: Ra, Rq, Rz, Rsk, Rku, Rsm and Wa of what remains beside the features (ISO 21920-2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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

PROFILE_NAMES = ("Ra", "Rq", "Rz", "Rsk", "Rku", "Rsm", "Wa")
# A section of which less is left beside features is not evaluated: of half as many independent heights a parameter's
# sampling variance is twice that of a whole section
LEAST_SECTION_SHARE = 0.5
# A peak or valley counts for the spacing of profile elements if it is higher than this share of Rz (ISO 21920-2)
HEIGHT_DISCRIMINATION = 0.1


@dataclass(frozen=True, eq=False)
class Stretch:
    """An evenly sampled piece of a profile, its form removed.

    Args:
        heights: (N,) m.
        keep: (N,) False where a feature is.
        spacing: m.
    """

    heights: FloatArray
    keep: BoolArray
    spacing: float


def profile_parameters(
    stretches: Sequence[Stretch], cutoff: float, short_cutoff: float | None = None
) -> tuple[dict[str, Interval], int]:
    """The parameters of the profiles together, each with its 90 % interval, and the number of sections they rest on.

    The S-filter takes away what is shorter than `short_cutoff`, the L-filter splits what remains into waviness and
    roughness. Sections have the length of the cut-off; half a cut-off is given up at each end.

    Args:
        stretches: pieces of profiles.
        cutoff: nesting index of the L-filter, m.
        short_cutoff: of the S-filter, m; None: no S-filter.

    Returns:
        PROFILE_NAMES with their values (m; Rsk and Rku are numbers), empty if not one section fits; and the sections.
    """
    rough, wavy = [], []
    runs: list[tuple[FloatArray, int, float]] = []  # heights of adjoining sections, how many they are, spacing
    for stretch in stretches:
        primary = np.where(stretch.keep, stretch.heights, np.nan)
        if short_cutoff is not None:
            primary = np.where(stretch.keep, gaussian_mean(primary, stretch.spacing, short_cutoff), np.nan)
        mean = gaussian_mean(primary, stretch.spacing, cutoff)
        above = primary - mean
        size, end = round(cutoff / stretch.spacing), round(0.5 * cutoff / stretch.spacing)
        begun = None
        for first in [*range(end, len(primary) - end - size + 1, size), None]:
            part = slice(0, 0) if first is None else slice(first, first + size)
            if first is not None and np.isfinite(above[part]).mean() >= LEAST_SECTION_SHARE:
                rough.append(above[part])
                wavy.append(np.where(np.isfinite(primary[part]), mean[part], np.nan))
                begun, stop = (first if begun is None else begun), first + size
            elif begun is not None:
                runs.append((above[begun:stop], (stop - begun) // size, stretch.spacing))
                begun = None
    if not rough:
        return {}, 0
    sums = np.array([moments(part[np.isfinite(part)]) for part in rough])
    level = float(np.concatenate([part[np.isfinite(part)] for part in wavy]).mean())
    waves = np.array([moments(part[np.isfinite(part)] - level) for part in wavy])
    tall = np.array([[1.0, np.nanmax(part) - np.nanmin(part)] for part in rough])
    limit = HEIGHT_DISCRIMINATION * tall[:, 1].mean()
    elements = np.concatenate([_elements(*run, limit) for run in runs])
    values = {
        "Ra": with_interval(sums, mean_size),
        "Rq": with_interval(sums, root_mean_square),
        "Rz": with_interval(tall, lambda total: total[..., 1] / total[..., 0]),
        "Rsk": with_interval(sums, skewness, signed=True),
        "Rku": with_interval(sums, kurtosis),
        "Rsm": with_interval(elements, _mean_spacing),
        "Wa": with_interval(waves, mean_size),
    }
    return values, len(rough)


def _mean_spacing(total: FloatArray) -> FloatArray:
    return np.asarray(np.where(total[..., 0] > 0.0, total[..., 1] / np.maximum(total[..., 0], 1.0), np.nan))


def _elements(heights: FloatArray, sections: int, spacing: float, limit: float) -> FloatArray:
    """(S, 2) number and summed length (m) of the profile elements, a peak and the valley beside it, in each section.

    They are sought in all adjoining sections together: of those that one section holds whole, long ones are rare, and a
    stylus trace with two elements a section came out with a seventh of its spacing. Each counts where its middle lies;
    one that a feature interrupts does not.

    Elements begin where the profile crosses the mean line, upwards and, counted apart, downwards; what stays within
    `limit` of the mean line ends none.
    """
    table, size = np.zeros((sections, 2)), len(heights) // sections
    missing = np.concatenate([[0], np.cumsum(~np.isfinite(heights))])
    for sign in (1.0, -1.0):
        z = sign * heights
        side = np.where(z > limit, 1, np.where(z < -limit, -1, 0))
        told = np.flatnonzero(side)
        rises = told[1:][(side[told[1:]] == 1) & (side[told[:-1]] == -1)]
        # the last crossing before each peak
        below = np.maximum.accumulate(np.where(z > 0.0, 0, np.arange(len(z))))[rises - 1]
        below = below[np.isfinite(z[below]) & np.isfinite(z[below + 1])]
        places = below + z[below] / (z[below] - z[below + 1])
        begin, end = places[:-1], places[1:]
        whole = missing[begin.astype(np.int64)] == missing[end.astype(np.int64) + 1]
        begin, end = begin[whole], end[whole]
        section = np.minimum((0.5 * (begin + end)).astype(np.int64) // size, sections - 1)
        np.add.at(table, section, np.column_stack([np.ones(len(begin)), (end - begin) * spacing]))
    return table
