"""Slope of the traced surface across its sweeps, from the neighbouring rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.sweep_curve import SweepCurve
from mapping.sweep_tangents import lagrange, unit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Rows to either side that are looked at.
REACH = 4
# A one-sided polynomial must be smoother than the others by this factor.
CENTRAL = 1.25
# A higher term must be smaller than the curvature by this factor, or it speaks of a kink.
FALLING = 0.1


@dataclass(frozen=True, eq=False)
class CrossSlope:
    """The traced surface across its sweeps.

    Args:
        tangents: (N, 3) unit tangents across the sweeps; meaningless where `doubt` is NaN.
        curvature: (N,) curvature across, 1/m, positive where it bulges out; NaN where unknown.
        doubt: (N,) how far the slope may be off, rad; NaN where the neighbours do not tell.
    """

    tangents: FloatArray
    curvature: FloatArray
    doubt: FloatArray


def cross_slope(
    points: FloatArray, along: FloatArray, outward: FloatArray, rows: list[IntArray], curves: list[SweepCurve]
) -> CrossSlope:
    """Slope across the parallel sweeps `rows` at their samples (N, 3) with unit tangents `along` (N, 3).

    The surface is cut at each sample by the plane perpendicular to the sweep, which the neighbouring rows cross
    in a few points; their interpolant gives the slope, its last term the doubt.
    """
    across = unit(np.cross(outward, along))
    up = np.cross(along, across)
    up *= np.sign(np.einsum("ij,ij->i", up, outward))[:, None]
    slope, bend, doubt = np.full((3, len(points)), np.nan)
    for j, row in enumerate(rows):
        v, w = np.full((2, len(row), 2 * REACH + 1), np.nan)
        v[:, REACH] = w[:, REACH] = 0.0
        for shift in range(-REACH, REACH + 1):
            if shift and 0 <= j + shift < len(rows):
                arm = curves[j + shift].crossings(points[row], along[row]) - points[row]
                v[:, REACH + shift] = np.einsum("ij,ij->i", arm, across[row])
                w[:, REACH + shift] = np.einsum("ij,ij->i", arm, up[row])
        slope[row], bend[row], doubt[row] = smooth_slope(v, w)
        # Beside an outermost sweep nothing shows whether the surface goes on as it came.
        alone = np.isnan(v[:, REACH - 1]) | np.isnan(v[:, REACH + 1])
        doubt[row] = shared(np.where(alone & ~np.isnan(doubt[row]), np.pi / 2, doubt[row]))
    return CrossSlope(unit(across + slope[:, None] * up), -bend / (1 + slope**2) ** 1.5, doubt)


def shared(doubt: FloatArray, reach: int = 2) -> FloatArray:
    """Largest doubt (N,) of a few neighbours along a sweep: among the doubtful, one may agree with itself by chance."""
    padded = np.pad(doubt, reach, constant_values=np.nan)
    largest = np.fmax.reduce(np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1), axis=1)
    return np.asarray(np.where(np.isnan(doubt), doubt, largest))


def smooth_slope(v: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Slope, second derivative and doubt of the slope at the middle column of w(v), (N, 2 k + 1), NaN where missing.

    Essentially non-oscillatory (Harten et al. 1987): of all quartics, cubics and parabolas through the middle and
    its neighbours, the one of highest degree whose last term is small beside its curvature. A kink that runs along
    the sweeps therefore stays outside, even where it mimics a curvature in three rows.
    """
    middle = v.shape[1] // 2
    with np.errstate(invalid="ignore", divide="ignore"):  # missing rows are NaN and lose every comparison
        table = [w]
        for order in range(1, 5):
            table.append(np.diff(table[-1], axis=1) / (v[:, order:] - v[:, :-order]))
        slope, bend, doubt, _ = _polynomial(v, w, table, 2, middle)
        for order in (3, 4):
            candidate, curved, last, falling = _polynomial(v, w, table, order, middle)
            # A cubic that is refused still tells how little the parabola knew.
            doubt = np.where(falling, last, np.fmax(doubt, last) if order == 3 else doubt)
            slope, bend = np.where(falling, candidate, slope), np.where(falling, curved, bend)
    return slope, bend, doubt


def _polynomial(
    v: FloatArray, w: FloatArray, table: list[FloatArray], order: int, middle: int
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Slope and curvature of the smoothest polynomial of an order, doubt of the slope, if its last term is small."""
    index = np.arange(len(v))
    size = np.abs(table[order][:, middle - order : middle + 1])
    size = np.where(np.isnan(size), np.inf, size) * np.r_[CENTRAL, np.ones(order - 1), CENTRAL]
    best, second = np.argsort(size, axis=1, kind="stable")[:, :2].T
    first = middle - order + best
    slope, other = _slope(v, w, first, order), _slope(v, w, middle - order + second, order)
    inner = np.clip(middle - 1, first, first + order - 2)
    bend = 2 * table[2][index, inner]
    spacing = np.abs(v[index, first + order] - v[index, first]) / order
    last = np.abs(table[order][index, first]) * spacing ** (order - 1)
    # Where the second smoothest window sees another slope, a kink or a jump of curvature lies beside the sample.
    return slope, bend, np.fmax(last, np.abs(slope - other)), last <= FALLING * np.abs(bend) * spacing


def _slope(v: FloatArray, w: FloatArray, first: IntArray, order: int) -> FloatArray:
    """Slope at v = 0 of the polynomials through columns first to first + order."""
    nodes = first[:, None] + np.arange(order + 1)
    at, heights = np.take_along_axis(v, nodes, 1), np.take_along_axis(w, nodes, 1)
    return np.asarray(np.einsum("km,km->k", lagrange(at, np.zeros(len(v)))[1], heights))
