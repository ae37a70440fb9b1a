"""The base of a single profile: a smooth curve that features do not bend."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mapping import FloatArray, Surface, Trace
from mapping.base.profiles.evidence import Scatter
from mapping.base.profiles.form import AUTO, Form, form_line
from mapping.base.profiles.frame import ProfileFrame
from mapping.base.profiles.isolated_bends import Bend, isolated_bends, isolated_rest
from mapping.base.profiles.jumps import MOST_JUMPS, are_apart, possible_jumps, steps_up, told_apart
from mapping.geometry.mesh import Spline, spline_design
from mapping.instrument import RobustFit, fit_on_densest, neighbour_scatter, robust_fit, robust_scale, span_of

# A base bends over no less than this many tip radii: shorter details are features.
SHORTEST_BEND = 8.0
# Pieces that are tried; the evidence chooses.
PIECES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
PROFILE_CELLS = 480
# Of the greatest height: an exact profile has no smaller scatter than its digits
LEAST_DIGITS = 1e-12
# A place is a parameter that only one cell in n fits: it costs twice what a height does (2 log n against log n)
EDGE_FREEDOM = 2
# A piece of a cubic has four coefficients: with fewer places between masked stretches than that nothing determines it
CELLS_PER_PIECE = 4


def fit_profile(trace: Trace, frame: ProfileFrame, form: Form = AUTO) -> tuple[Surface, dict[str, Any]]:
    """A ribbon under the smooth part of a profile.

    Splines of growing freedom (a line, a parabola, cubics) are fitted to the centres by robust least squares and the
    one with the best evidence is taken: most places lie on it, others stand off it by anything. The ribbon is its
    parallel curve one tip radius inward. Where the profile steps for good from one level to another the spline keeps
    to the longest of them, if by the same evidence the edges are worth their places and heights.

    Args:
        trace: along one line.
        frame: of it.
        form: "auto", or what the base is instead of a spline; stretches that are masked do not count.

    Returns:
        The ribbon and what was fitted: degree, number of pieces and their length, m, "on_base" (the share of the
        profile that lies on it), or the form; "open_ends" that do not come back to it (from, to, height); "absorbed":
        what stands alone and was taken for form by "auto", and "left standing": what "auto" left although it is wider
        than fine features are, if anything: height, width (m) and place ([x, y, z], m) of each.

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
    splines = []
    for degree, pieces in choices[: max(1, len(x) - 2)]:
        knots = np.concatenate([[start] * degree, np.linspace(start, stop, pieces + 1), [stop] * degree])
        if form.masks and np.histogram(x, knots[degree : len(knots) - degree])[0].min() < CELLS_PER_PIECE:
            continue
        splines.append(_Spline(spline_design(x, knots, degree), knots, degree, pieces))
    best, chosen, edges, scatter = _likeliest(splines, x, z, scale, trace.tip_radius)
    knots, degree, pieces = chosen.knots, chosen.degree, chosen.pieces
    heights = np.append(0.0, np.cumsum(best.coefficients[chosen.design.shape[1] :]))
    level = steps_up(edges, len(x)).sum(axis=1).astype(np.int64)
    ground = heights[np.bincount(level).argmax()]  # the base is the level with the most places
    heights, z = heights - ground, z - (heights - ground)[level]
    # the pieces of a spline sum to one: a constant is one of every coefficient
    curve = Spline(knots, best.coefficients[: chosen.design.shape[1]] + ground, degree)
    places = np.linspace(start, stop, 64 * pieces + 1)
    ribbon = _ribbon(trace.tip_radius, frame, places, curve(places), curve.derivative()(places))
    fitted: dict[str, Any] = {"degree": float(degree), "pieces": float(pieces), "piece_length": (stop - start) / pieces}
    fitted["on_base"] = scatter.share_on(best.residual)
    felt = scatter.felt_part(best.residual, EDGE_FREEDOM * scatter.price(len(x)))
    bends = isolated_bends(x, z, curve(x), scale) if pieces > 1 else []
    rest = isolated_rest(x, z, curve(x), scale, SHORTEST_BEND * trace.tip_radius)
    if edges:
        fitted["levels"] = told_apart(heights, scatter.within(best.residual)).tolist()
    if ends := _open_ends(x, z - curve(x), felt, frame, curve):
        fitted["open_ends"] = ends
    return ribbon, fitted | _listed("absorbed", bends, frame, curve) | _listed("left standing", rest, frame, curve)


@dataclass(frozen=True, eq=False)
class _Spline:
    """A family of curves: its design (N, P) at the places, knots, degree and number of pieces."""

    design: FloatArray
    knots: FloatArray
    degree: int
    pieces: int


def _likeliest(
    splines: list[_Spline], x: FloatArray, z: FloatArray, scale: float, tip_radius: float
) -> tuple[RobustFit, _Spline, list[int], Scatter]:
    """The spline with the edges that are worth their price, these, and by which scatter it was judged.

    Its further coefficients are the edges' heights.
    """
    count = len(z)
    candidates = [int(i) for i in possible_jumps(x, z, scale, tip_radius)]
    least = max(scale, LEAST_DIGITS * float(np.abs(z).max()), np.finfo(float).tiny)
    freest = robust_fit(np.hstack([splines[-1].design, steps_up(candidates, count)]), z, least).residual
    span = span_of(robust_fit(splines[0].design, z, least).residual, least)
    scatter = Scatter.left_by(freest, least, span)

    def best(edges: list[int]) -> tuple[float, RobustFit, _Spline]:
        up = steps_up(edges, count)
        # a curve may be held by the half of a profile that is fine, or by all of it where all is rough
        scales = {least, max(least, robust_scale(freest))}
        fits = list[tuple[RobustFit, _Spline]]()
        for each in splines:
            design = np.hstack([each.design, up])
            own = [robust_fit(design, z, sd) for sd in scales]
            if each.pieces == 1:
                own += [fit_on_densest(design, fit, least, scatter.span) for fit in own]
            fits += [(fit, each) for fit in own]
        price = scatter.price(count)

        def cost(fit: RobustFit) -> float:
            return scatter.misfit(fit.residual) + price * (len(fit.coefficients) + EDGE_FREEDOM * len(edges))

        return min(((cost(fit), fit, each) for fit, each in fits), key=lambda found: found[0])

    edges = list[int]()
    cost, fit, spline = best(edges)
    while len(edges) < MOST_JUMPS:
        further = [[*edges, i] for i in candidates if i not in edges and are_apart([*edges, i], count)]
        tried = [(*best(some), some) for some in further]
        tried = [each for each in tried if scatter.ends_on(each[1].residual, each[-1])]
        if not tried or min(each[0] for each in tried) >= cost:
            break
        cost, fit, spline, edges = min(tried, key=lambda each: each[0])
    # of stairs a single edge may be worth nothing: so from all of them, one after another less
    fewer = _apart(candidates, count)
    while len(fewer) > 1:
        whole = best(fewer)
        if whole[0] < cost and scatter.ends_on(whole[1].residual, fewer):
            (cost, fit, spline), edges = whole, fewer
        fewer = min(([i for i in fewer if i != one] for one in fewer), key=lambda some: best(some)[0])
    return fit, spline, sorted(edges), scatter


def _apart(candidates: list[int], count: int) -> list[int]:
    """The highest edges that leave levels which are long enough."""
    edges = list[int]()
    for i in candidates:
        if len(edges) < MOST_JUMPS and are_apart([*edges, i], count):
            edges.append(i)
    return edges


def _open_ends(
    x: FloatArray, off: FloatArray, felt: tuple[int, int], frame: ProfileFrame, curve: Spline
) -> list[dict[str, Any]]:
    """Of each end that leaves the curve for good: from where and to where, [x, y, z], and how high at most, m."""
    first, last = felt

    def place(k: int) -> list[float]:
        return [float(each) for each in frame.origin + x[k] * frame.along + float(curve(x[k])) * frame.outward]

    ends = [(first, 0, off[:first])] * (first > 0) + [(last - 1, len(x) - 1, off[last:])] * (last < len(x))
    return [{"from": place(a), "to": place(b), "height": float(part[np.abs(part).argmax()])} for a, b, part in ends]


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
