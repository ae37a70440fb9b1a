"""Section height: what one section across a feature measures by ISO 5436-1, and what Wolf's pruning leaves of it."""

from __future__ import annotations

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.estimate.roughness.filters import gaussian_mean

# Samples that each of the standard's portions must hold: two more than the parabola has coefficients that is laid
# through the middle one
_FEWEST_IN_PORTION = 5
# S-filter before pruning, in parts of the felt half-width: of a round crest it takes (sd / half-width)^2 of its height,
# with sd = 0.187 of the nesting index 0.4 %, and noise of neighbouring samples with it
_PRUNED_FILTER = 1.0 / 3.0


def flat_height(u: FloatArray, z: FloatArray, width: float) -> float:
    """Height of a ridge with a flat top, or minus the depth of a groove with a flat bottom; NaN if it is not all there.

    Two parallel lines by least squares, z = alpha u + beta + d delta: delta is 1 in the middle third of the width and 0
    in the two portions outside, each two thirds of the width long and a third away from the edges.

    Args:
        u: (N,) places across the feature from its middle, m.
        z: (N,) heights, m.
        width: between the edges, m.

    Reference: ISO 5436-1:2000, 5.2 (type A1).
    """
    before, after, inner = _portions(u, width)
    return _parallel(u, z, (before | after, inner)) if _filled(before, after, inner) else float("nan")


def round_height(u: FloatArray, z: FloatArray, width: float) -> float:
    """The same of a rounded top or bottom: from the outer portions' line to the extremum of a parabola in the middle.

    Reference: ISO 5436-1:2000, 5.2 (type A2).
    """
    before, after, inner = _portions(u, width)
    if not _filled(before, after, inner):
        return float("nan")
    line = np.polyfit(u[before | after], z[before | after], 1)
    bend, slope, level = np.polyfit(u[inner], z[inner] - np.polyval(line, u[inner]), 2)
    top = float(np.clip(-slope / (2.0 * bend), -width / 6.0, width / 6.0)) if bend else 0.0
    return float((bend * top + slope) * top + level)


def level_difference(u: FloatArray, z: FloatArray, edge: float, side: float) -> float:
    """Height of the side u > 0 over the other one: the same parallel lines, beside one edge alone.

    Args:
        u: (N,) places across the step from its middle, m.
        z: (N,) heights, m.
        edge: half of what is left out in the middle, m.
        side: length of each portion, m.
    """
    outer = (np.abs(u) >= edge) & (np.abs(u) <= edge + side)
    below, above = outer & (u < 0.0), outer & (u > 0.0)
    return _parallel(u, z, (below, above)) if _filled(below, above) else float("nan")


def wolf_height(z: FloatArray, spacing: float, near: BoolArray, half_width: float, up: bool) -> float:
    """Up to which threshold Wolf's pruning leaves the hill (or the dale) of a feature standing; NaN if there is none.

    In a profile that is the peak's prominence: how far one must descend from it to reach a higher one, or the end.

    Args:
        z: (N,) heights of the whole profile, m.
        spacing: of them, m.
        near: (N,) true where the feature is felt.
        half_width: as far from its middle as it is felt, m.
        up: a hill; else a dale.

    Reference: Wolf, PhD thesis, Siegen 1991; ISO 16610-85 and ISO 25178-2 for surfaces; by scipy.signal.
    """
    from scipy.signal import find_peaks

    smooth = (1.0 if up else -1.0) * gaussian_mean(z, spacing, _PRUNED_FILTER * half_width)
    known = np.where(np.isfinite(smooth), smooth, np.nanmin(smooth))
    peaks, found = find_peaks(known, prominence=0.0)
    own = near[peaks]
    return float(found["prominences"][own].max()) if own.any() else float("nan")


def _portions(u: FloatArray, width: float) -> tuple[BoolArray, BoolArray, BoolArray]:
    """The standard's portions A, B beside the feature and C in its middle."""
    outer = (np.abs(u) >= 5.0 / 6.0 * width) & (np.abs(u) <= 1.5 * width)
    return outer & (u < 0.0), outer & (u > 0.0), np.abs(u) <= width / 6.0


def _filled(*portions: BoolArray) -> bool:
    return all(portion.sum() >= _FEWEST_IN_PORTION for portion in portions)


def _parallel(u: FloatArray, z: FloatArray, portions: tuple[BoolArray, BoolArray]) -> float:
    """How far the line of the second portion lies over the parallel one of the first."""
    low, high = portions
    used = low | high
    design = np.column_stack([u[used], np.ones(int(used.sum())), high[used]])
    return float(np.linalg.lstsq(design, z[used], rcond=None)[0][2])
