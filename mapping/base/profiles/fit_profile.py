"""The base of a single profile: a smooth curve that features do not bend."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from mapping import FloatArray, Surface, Trace
from mapping.base.profiles.form import AUTO, Form, form_line
from mapping.base.profiles.frame import ProfileFrame
from mapping.base.profiles.isolated_bends import Bend, isolated_bends, isolated_rest
from mapping.geometry.mesh import Spline, spline_design
from mapping.instrument import neighbour_scatter, robust_fit

# A base bends over no less than this many tip radii: shorter details are features.
SHORTEST_BEND = 8.0
# Pieces that are tried; the evidence chooses.
PIECES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
PROFILE_CELLS = 480
# A piece of a cubic has four coefficients: with fewer places between masked stretches than that nothing determines it
CELLS_PER_PIECE = 4


def fit_profile(trace: Trace, frame: ProfileFrame, form: Form = AUTO) -> tuple[Surface, dict[str, Any]]:
    """A ribbon under the smooth part of a profile.

    Splines of growing freedom (a line, a parabola, cubics) are fitted to the centres by robust least
    squares and the one with the best truncated evidence is taken; the ribbon is its parallel curve one tip
    radius inward.

    Args:
        trace: along one line.
        frame: of it.
        form: "auto", or what the base is instead of a spline; stretches that are masked do not count.

    Returns:
        The ribbon and what was fitted: degree, number of pieces and their length, m, or the form; "absorbed": what
        stands alone and was taken for form by "auto", and "left standing": what "auto" left although it is wider than
        fine features are, if anything: height, width (m) and place ([x, y, z], m) of each.

    Raises:
        FormError: a form that does not fit this profile.
    """
    offset = trace.centers - frame.origin
    along = offset @ frame.along
    start, stop = float(along.min()), float(along.max())
    keep = form.unmasked(trace)
    x, z = _cell_medians(along[keep], offset[keep] @ frame.outward)
    scale = neighbour_scatter(z)
    if form.kind != "auto":
        # the filter needs more places than cells
        places, line = form_line(x, z, form, scale, (start, stop))
        slope = np.gradient(line, places, edge_order=2)
        return _ribbon(trace.tip_radius, frame, places, line, slope), {"form": asdict(form)}
    limit = (stop - start) / (SHORTEST_BEND * trace.tip_radius)
    choices = [(1, 1), (2, 1), *((3, n) for n in PIECES if n == 1 or (n <= limit and 10 * n <= len(x)))]
    fits = []
    for degree, pieces in choices[: max(1, len(x) - 2)]:
        knots = np.concatenate([[start] * degree, np.linspace(start, stop, pieces + 1), [stop] * degree])
        if form.masks and np.histogram(x, knots[degree : len(knots) - degree])[0].min() < CELLS_PER_PIECE:
            continue
        fits.append((robust_fit(spline_design(x, knots, degree), z, scale), knots, degree, pieces))
    best, knots, degree, pieces = min(fits, key=lambda choice: choice[0].cost)
    curve, places = Spline(knots, best.coefficients, degree), np.linspace(start, stop, 64 * pieces + 1)
    ribbon = _ribbon(trace.tip_radius, frame, places, curve(places), curve.derivative()(places))
    fitted: dict[str, Any] = {"degree": float(degree), "pieces": float(pieces), "piece_length": (stop - start) / pieces}
    bends = isolated_bends(x, z, curve(x), scale) if pieces > 1 else []
    rest = isolated_rest(x, z, curve(x), scale, SHORTEST_BEND * trace.tip_radius)
    return ribbon, fitted | _listed("absorbed", bends, frame, curve) | _listed("left standing", rest, frame, curve)


def _listed(name: str, bends: list[Bend], frame: ProfileFrame, curve: Spline) -> dict[str, Any]:
    """Height, width and place [x, y, z] of each on the line of centres, m; nothing where there is none."""
    listed = [
        {"height": bend.height, "width": bend.width}
        | {"place": (frame.origin + bend.place * frame.along + float(curve(bend.place)) * frame.outward).tolist()}
        for bend in bends
    ]
    return {name: listed} if listed else {}


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


def _ribbon(tip_radius: float, frame: ProfileFrame, x: FloatArray, z: FloatArray, slope: FloatArray) -> Surface:
    """The strip of triangles under a line of centres, one tip radius inward, two radii longer at its ends."""
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
