"""The base of a single profile: a smooth curve that features do not bend."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mapping import FloatArray, Surface, Trace
from mapping.base.profiles.climbs import possible_climbs
from mapping.base.profiles.edges import BESIDE_KINK, EDGE_FREEDOM, Edge, Slopes, are_apart, climbed, returning
from mapping.base.profiles.evidence import Scatter
from mapping.base.profiles.form import AUTO, Form, form_line
from mapping.base.profiles.frame import ProfileFrame
from mapping.base.profiles.isolated_bends import Bend, isolated_bends, isolated_rest
from mapping.base.profiles.jumps import MOST_JUMPS, SHORTEST_LEVEL, possible_jumps, told_apart
from mapping.geometry.mesh import Spline, spline_design
from mapping.instrument import (
    RobustFit,
    fit_on_densest,
    least_noise,
    neighbour_scatter,
    robust_fit,
    robust_scale,
    span_of,
)

# A base bends over no less than this many tip radii: shorter details are features.
SHORTEST_BEND = 8.0
# Pieces that are tried; the evidence chooses.
PIECES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
PROFILE_CELLS = 480
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
    order = np.flatnonzero(keep)[np.argsort(along[keep], kind="stable")]
    samples = along[order], offset[order] @ frame.outward
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
    best, chosen, edges, scatter = _likeliest(splines, x, z, samples, scale, trace.tip_radius)
    knots, degree, pieces = chosen.knots, chosen.degree, chosen.pieces
    rise = best.coefficients[chosen.design.shape[1] :]
    wide = np.array([edge.run > SHORTEST_BEND * trace.tip_radius for edge in edges], dtype=bool)
    slopes = Slopes([edges[k] for k in np.flatnonzero(wide)], rise[wide], trace.tip_radius)
    edges, rise = [edges[k] for k in np.flatnonzero(~wide)], rise[~wide]
    heights = np.append(0.0, np.cumsum(rise))
    level = np.searchsorted([edge.index for edge in edges], np.arange(len(x)))
    ground = heights[np.bincount(level).argmax()]  # the base is the level with the most places
    heights, z = heights - ground, z - (climbed(edges, x, trace.tip_radius) @ rise - ground)
    # the pieces of a spline sum to one: a constant is one of every coefficient
    curve = _Line(Spline(knots, best.coefficients[: chosen.design.shape[1]] + ground, degree), slopes)
    places = slopes.sampled(np.linspace(start, stop, 64 * pieces + 1))
    ribbon = _ribbon(trace.tip_radius, frame, places, curve(places), curve.slope(places))
    fitted: dict[str, Any] = {"degree": float(degree), "pieces": float(pieces), "piece_length": (stop - start) / pieces}
    fitted["on_base"] = scatter.share_on(best.residual)
    felt = scatter.felt_part(best.residual, EDGE_FREEDOM * scatter.price(len(x)))
    bends = isolated_bends(x, z, curve(x), scale) if pieces > 1 else []
    rest = isolated_rest(x, z, curve(x), scale, SHORTEST_BEND * trace.tip_radius)
    if edges:
        # heights over a base are normal to it: the frame leans by the step itself
        lean = float(np.median(np.hypot(1.0, curve.slope(x))))
        fitted["levels"] = (told_apart(heights, scatter.within(best.residual)) / lean).tolist()
    for name, some, up in (("climbs", edges, rise), ("slopes", slopes.edges, slopes.rises)):
        told = zip(some, up.tolist(), strict=True)
        fitted |= _listed(name, [Bend(h, each.run, each.place) for each, h in told if each.run > 0.0], frame, curve)
    if ends := _open_ends(x, z - curve(x), felt, frame, curve):
        fitted["open_ends"] = ends
    return ribbon, fitted | _listed("absorbed", bends, frame, curve) | _listed("left standing", rest, frame, curve)


@dataclass(frozen=True, eq=False)
class _Line:
    """What a base follows: a smooth curve, and the climbs upon it that are too wide for features."""

    smooth: Spline
    slopes: Slopes

    def __call__(self, x: FloatArray | float) -> FloatArray:
        """(N,) heights, m."""
        smooth = np.asarray(self.smooth(x))
        return np.asarray(smooth + self.slopes(x)) if self.slopes.edges else smooth

    def slope(self, x: FloatArray) -> FloatArray:
        """(N,) slopes."""
        beside = 0.5 * BESIDE_KINK * self.slopes.tip_radius
        own = np.asarray(self.smooth.derivative()(x))
        if not self.slopes.edges:
            return own
        return np.asarray(own + (self.slopes(x + beside) - self.slopes(x - beside)) / (2.0 * beside))


@dataclass(frozen=True, eq=False)
class _Spline:
    """A family of curves: its design (N, P) at the places, knots, degree and number of pieces."""

    design: FloatArray
    knots: FloatArray
    degree: int
    pieces: int


def _likeliest(
    splines: list[_Spline],
    x: FloatArray,
    z: FloatArray,
    samples: tuple[FloatArray, FloatArray],
    scale: float,
    tip_radius: float,
) -> tuple[RobustFit, _Spline, list[Edge], Scatter]:
    """The spline with the edges that are worth their price, these, and by which scatter it was judged.

    Its further coefficients are the edges' heights. What slanted edges lead to and back from is no level but a detail.
    """
    upright = [Edge.upright(int(i)) for i in possible_jumps(x, z, scale, tip_radius)]
    least = max(scale, least_noise(z, tip_radius))
    slanted = possible_climbs(x, z, samples, _scatter(splines, x, z, upright, least, tip_radius)[0], least, tip_radius)
    while slanted:
        found = fit, spline, edges, scatter = _chosen(splines, x, z, [*slanted, *upright], least, tip_radius)
        heights = fit.coefficients[spline.design.shape[1] :]
        back = returning(edges, heights, scatter.within(fit.residual), len(x))
        if not back and any(edge.run > 0.0 for edge in edges):
            return found
        slanted = [edge for edge in slanted if edge in back] and [edge for edge in slanted if edge not in back]
    return _chosen(splines, x, z, upright, least, tip_radius)


def _scatter(
    splines: list[_Spline], x: FloatArray, z: FloatArray, candidates: list[Edge], least: float, tip_radius: float
) -> tuple[Scatter, FloatArray]:
    """By which scatter curves are judged: as the freest leaves it, and (N,) what that leaves, m."""
    freest = robust_fit(np.hstack([splines[-1].design, climbed(candidates, x, tip_radius)]), z, least).residual
    span = span_of(robust_fit(splines[0].design, z, least).residual, least)
    return Scatter.left_by(freest, least, span), freest


def _chosen(
    splines: list[_Spline], x: FloatArray, z: FloatArray, candidates: list[Edge], least: float, tip_radius: float
) -> tuple[RobustFit, _Spline, list[Edge], Scatter]:
    """The likeliest spline with some of the candidates for edges."""
    count = len(z)
    scatter, freest = _scatter(splines, x, z, candidates, least, tip_radius)

    def best(edges: list[Edge]) -> tuple[float, RobustFit, _Spline]:
        up = climbed(edges, x, tip_radius)
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
            return scatter.misfit(fit.residual) + price * (len(fit.coefficients) + sum(edge.freedom for edge in edges))

        return min(((cost(fit), fit, each) for fit, each in fits), key=lambda found: found[0])

    edges = list[Edge]()
    cost, fit, spline = best(edges)
    while len(edges) < MOST_JUMPS:
        further = [[*edges, one] for one in candidates if one not in edges and are_apart([*edges, one], count)]
        further = [sorted(some, key=lambda edge: edge.index) for some in further]
        tried = [(*best(some), some) for some in further]
        tried = [each for each in tried if scatter.ends_on(each[1].residual, _at(each[-1]))]
        if not tried or min(each[0] for each in tried) >= cost:
            break
        cost, fit, spline, edges = min(tried, key=lambda each: each[0])
    # of stairs a single edge may be worth nothing: so from all of them, one after another less
    fewer = _apart(candidates, count)
    while len(fewer) > 1:
        whole = best(fewer)
        if whole[0] < cost and scatter.ends_on(whole[1].residual, _at(fewer)):
            (cost, fit, spline), edges = whole, fewer
        fewer = min(([other for other in fewer if other != one] for one in fewer), key=lambda some: best(some)[0])
    return fit, spline, edges, scatter


def _apart(candidates: list[Edge], count: int) -> list[Edge]:
    """The highest edges that leave levels which are long enough, along the profile."""
    edges = list[Edge]()
    for one in candidates:
        if len(edges) < MOST_JUMPS and are_apart([*edges, one], count):
            edges.append(one)
    return sorted(edges, key=lambda edge: edge.index)


def _at(edges: list[Edge]) -> list[int]:
    return [edge.index for edge in edges]


def _open_ends(
    x: FloatArray, off: FloatArray, felt: tuple[int, int], frame: ProfileFrame, curve: _Line
) -> list[dict[str, Any]]:
    """Of each end that leaves the curve for good: from where and to where, [x, y, z], and how high at most, m."""
    first, last = felt

    def place(k: int) -> list[float]:
        return [float(each) for each in frame.origin + x[k] * frame.along + float(curve(x[k])) * frame.outward]

    ends = [(first, 0, off[:first])] * (first > 0) + [(last - 1, len(x) - 1, off[last:])] * (last < len(x))
    return [{"from": place(a), "to": place(b), "height": float(part[np.abs(part).argmax()])} for a, b, part in ends]


def _listed(name: str, bends: list[Bend], frame: ProfileFrame, curve: _Line) -> dict[str, Any]:
    """Height, width and place [x, y, z] of each on the line of centres, m; nothing where there is none."""
    listed = [
        {"height": bend.height, "width": bend.width}
        | {"place": (frame.origin + bend.place * frame.along + float(curve(bend.place)) * frame.outward).tolist()}
        for bend in bends
    ]
    return {name: listed} if listed else {}


def _cell_medians(x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Medians over PROFILE_CELLS cells of equal length, in the order of x: details narrower than a cell vanish.

    Of heights over the usual slope: a frame that leans, as a step makes it, would else put cells of an even number of
    samples beside those of an odd one, and an exact profile's levels off any line.
    """
    order = np.argsort(x, kind="stable")
    x, z = x[order], z[order]
    if len(x) <= 4 * PROFILE_CELLS:
        return x, z
    apart = int(SHORTEST_LEVEL * len(x))
    slope = float(np.median((z[apart:] - z[:-apart]) / np.maximum(x[apart:] - x[:-apart], np.finfo(float).tiny)))
    over = z - slope * x
    edges = np.linspace(x[0], x[-1], PROFILE_CELLS + 1)
    cell = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, PROFILE_CELLS - 1)
    starts = np.flatnonzero(np.diff(cell, prepend=-1))
    counts = np.diff(np.append(starts, len(x)))
    middle = np.lexsort((over, cell))[starts + counts // 2]
    mean_x = np.add.reduceat(x, starts) / counts
    return np.asarray(mean_x), np.asarray(over[middle] + slope * mean_x)


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
