"""The base of a single profile: a smooth curve that features do not bend."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, Surface, Trace
from mapping.base.robust import RobustFit, robust_fit, robust_scale

# A base bends over no less than this many tip radii: shorter details are features.
SHORTEST_BEND = 8.0
# Pieces that are tried; the evidence chooses.
PIECES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
PROFILE_CELLS = 480


@dataclass(frozen=True, eq=False)
class ProfileFrame:
    """The plane of a profile: `origin` (3,), unit rows `along`, `lateral`, `outward`."""

    origin: FloatArray
    along: FloatArray
    lateral: FloatArray
    outward: FloatArray


def profile_frame(trace: Trace) -> ProfileFrame | None:
    """The frame of a trace that runs along one line, or None if it covers an area or turns back on itself."""
    origin = trace.centers.mean(axis=0)
    offset = trace.centers - origin
    _, values, axes = np.linalg.svd(offset[:: max(1, len(offset) // 20000)], full_matrices=False)
    if values[0] == 0.0:
        return None
    along = axes[0] * (1.0 if axes[0][np.abs(axes[0]).argmax()] > 0 else -1.0)
    hint = np.array([0.0, 0.0, 1.0]) if trace.normals is None else trace.normals.mean(axis=0)
    outward = hint - (hint @ along) * along
    if np.linalg.norm(outward) < 1e-6:
        outward = axes[1]
    outward = outward / np.linalg.norm(outward)
    lateral = np.cross(outward, along)
    extent = float(np.ptp(offset @ along))
    if float(np.ptp(offset @ lateral)) > min(trace.tip_radius, 0.2 * extent):
        return None
    if float(np.ptp(offset @ outward)) > extent:
        return None
    return ProfileFrame(origin, along, lateral, outward)


def fit_profile(trace: Trace, frame: ProfileFrame) -> tuple[Surface, dict[str, float]]:
    """A ribbon under the smooth part of a profile.

    Splines of growing freedom (a line, a parabola, cubics) are fitted to the centres by robust least
    squares and the one with the best truncated evidence is taken; the ribbon is its parallel curve one tip
    radius inward.

    Returns:
        The ribbon and what was fitted: degree, number of pieces and their length, m.
    """
    offset = trace.centers - frame.origin
    along = offset @ frame.along
    start, stop = float(along.min()), float(along.max())
    x, z = _cell_medians(along, offset @ frame.outward)
    scale = _roughness(z)
    limit = (stop - start) / (SHORTEST_BEND * trace.tip_radius)
    choices = [(1, 1), (2, 1), *((3, n) for n in PIECES if n == 1 or (n <= limit and 10 * n <= len(x)))]
    fits = []
    for degree, pieces in choices[: max(1, len(x) - 2)]:
        knots = np.concatenate([[start] * degree, np.linspace(start, stop, pieces + 1), [stop] * degree])
        fits.append((robust_fit(_design(x, knots, degree), z, scale), knots, degree, pieces))
    best, knots, degree, pieces = min(fits, key=lambda choice: choice[0].cost)
    ribbon = _ribbon(trace.tip_radius, frame, np.linspace(start, stop, 64 * pieces + 1), best, knots, degree)
    return ribbon, {"degree": float(degree), "pieces": float(pieces), "piece_length": (stop - start) / pieces}


def _roughness(z: FloatArray) -> float:
    """Standard deviation of values from one cell to the next, from second differences (features are rare)."""
    if len(z) < 4:
        return 0.0
    return float(robust_scale(np.diff(z, 2)) / np.sqrt(6.0))


def _design(x: FloatArray, knots: FloatArray, degree: int) -> FloatArray:
    from scipy.interpolate import BSpline

    return np.asarray(BSpline.design_matrix(x, knots, degree).toarray())


def _cell_medians(x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Medians over PROFILE_CELLS cells of equal length, in the order of x: details narrower than a cell vanish."""
    if len(x) <= 4 * PROFILE_CELLS:
        order = np.argsort(x, kind="stable")
        return x[order], z[order]
    edges = np.linspace(x.min(), x.max(), PROFILE_CELLS + 1)
    cell = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, PROFILE_CELLS - 1)
    order = np.lexsort((z, cell))
    starts = np.flatnonzero(np.diff(cell[order], prepend=-1))
    counts = np.diff(np.append(starts, len(x)))
    middle = order[starts + counts // 2]
    mean_x = np.add.reduceat(x[order], starts) / counts
    return np.asarray(mean_x), z[middle]


def _ribbon(
    tip_radius: float, frame: ProfileFrame, x: FloatArray, fit: RobustFit, knots: FloatArray, degree: int
) -> Surface:
    """The strip of triangles under the spline of centres, one tip radius inward, two radii longer at its ends."""
    from scipy.interpolate import BSpline

    curve = BSpline(knots, fit.coefficients, degree)
    z, slope = curve(x), curve.derivative()(x)
    overhang = 2.0 * tip_radius
    x = np.concatenate([[x[0] - overhang], x, [x[-1] + overhang]])
    z = np.concatenate([[z[0] - overhang * slope[0]], z, [z[-1] + overhang * slope[-1]]])
    slope = np.concatenate([slope[:1], slope, slope[-1:]])
    unit = np.sqrt(1.0 + slope**2)
    centre = frame.origin + np.outer(x, frame.along) + np.outer(z, frame.outward)
    normal = (np.outer(-slope, frame.along) + frame.outward) / unit[:, None]
    middle = centre - tip_radius * normal
    half = max(3.0 * tip_radius, 0.01 * float(x[-1] - x[0])) * frame.lateral
    vertices = np.concatenate([middle - half, middle + half])
    left = np.arange(len(x) - 1)
    right = left + len(x)
    faces = np.concatenate([np.column_stack([left, left + 1, right + 1]), np.column_stack([left, right + 1, right])])
    return Surface(vertices, faces)
