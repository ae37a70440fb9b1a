"""The base when no mesh is given: a simple family by evidence, a freer one where none explains the trace."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial

import numpy as np

from mapping import BoolArray, FloatArray, FormError, IntArray, Trace, TraceError
from mapping.base.base import Base
from mapping.base.cells import Cells, rows_of
from mapping.base.extrusion import extrusion
from mapping.base.polyhedron import polyhedron
from mapping.base.profiles import AUTO, Form, fit_profile, profile_frame
from mapping.base.quadrics import (
    FAMILIES,
    MOST_BASE_CELLS,
    Cloud,
    Family,
    Fitted,
    cylinder,
    height_field,
    independent_share,
    plane,
    plane_design,
    quadric,
    quadric_design,
    sheet,
    sphere,
)
from mapping.base.round_bodies import star, tube
from mapping.base.terraces import END_SHARE, terraced_plane, terraced_quadric
from mapping.geometry.mesh import NearestPoint
from mapping.instrument import FEATURE_RESIDUAL_SDS, robust_scale, robust_sd, unshared

# Families for what no simple one explains
FREE: tuple[Family, ...] = (
    *(partial(sheet, shortest=shortest) for shortest in (5.0, 2.5)),
    *(partial(tube, waves=waves, shortest=shortest) for waves in (0, 2, 4, 6, 9) for shortest in (4.0, 2.0)),
    *(partial(star, degree=degree) for degree in (3, 5, 8, 12)),
)
# By how many times the scatter of neighbouring cells half of all cells may miss what keeps freer families from being
# tried: a simple one, and an extrusion or a polyhedron, which come near to anything round with enough bends or faces
EXPLAINED, EXACTLY = 5.0, 1.0


# Families of few parameters, by their kind: what is fitted to half of the sweeps foretells the others
SIMPLE: dict[str, tuple[Family, ...]] = {
    "plane": (plane, terraced_plane),
    "quadric": (quadric, terraced_quadric),
    "cylinder": (cylinder,),
    "sphere": (sphere,),
    "extrusion": (extrusion,),
}
# Share of the sweeps that may seem to pass through a body: by single wrong readings
MOST_WALKED = 0.25
# Sweeps of each half, at least: a bend across them takes three
FEWEST_HALF = 3
# A base foretells a path if it misses it by no more than so many times the scatter from cell to cell, that is if of the
# variance at most three quarters are of something else: of the fit's own error, and of noise that wanders
FORETOLD = 2.0
# Mean square, in the scale, of what is no noise but rounding: cells scatter by half of the scale at least from one to
# the next, and a fit that they miss by a tenth of it is exact
EXACT_SQUARE = 1e-2
# Variance of a median of Gaussian values over that of their mean
OF_MEDIAN = 0.5 * np.pi
# Rounds in which a base through the ends of sweeps takes in what lies as it does: each is a candidate, so that one
# more costs a fit and decides nothing
ENDS_ROUNDS = 3
# Share of the sweeps' ends that lie on one plane, at least, where all of them do: of two sides of an edge each may have
# up to nine tenths, and one in ten ends may be on a detail
ALL_ENDS = 0.9
# Share of the sweeps' ends that a base between details holds, more than: what the sum of absolute residuals finds
MOST_ENDS = 0.5
# Families that a form admits over an area
AREAL_FORMS: dict[str, tuple[Family, ...]] = {
    "auto": (*FAMILIES, terraced_plane, terraced_quadric),
    "line": (plane, terraced_plane),
    "arc": (cylinder, sphere),
}


def fit_base(
    trace: Trace, spacing: float | None = None, form: Form = AUTO, *, tested: bool = True, inside: bool | None = None
) -> Base:
    """The smooth body that explains most of a trace; details shorter than about eight tip radii are left out.

    A trace along one line gives a profile. Otherwise every family is fitted to the ball centres by robust
    least squares, and the one with the best truncated evidence is taken: a detail counts as an outlier, a
    further parameter must pay for itself. Where no plane, sphere, cylinder, quadric or stiff sheet comes near most of
    the trace, extrusions are tried, then polyhedra, supple sheets, tubes and star-shaped bodies. The base is the
    fitted surface's parallel, one tip radius inward.

    Which side is outside is taken from the contact normals; without them it is the side of +z for sheets
    and away from the centre for round bodies, unless all of it was felt below the centre, as in a bowl.

    Args:
        trace: ball centres in contact.
        spacing: longest side of the mesh's triangles, m, for bases that sweeps are planned on; None: as long as the
            shape allows.
        form: of a profile; over an area "auto", "line" (a plane) or "arc" (a cylinder or a sphere).
        tested: False to spare the test whether a fit to half of the sweeps foretells the others (Base.missed is None).
        inside: whether a round body was felt from inside, where that is known; None: as above.

    Raises:
        FormError: a form that is not possible over an area, or not for this profile.
        TraceError: fewer than three samples, or all samples in one place.
    """
    if len(trace) < 3 or not np.ptp(trace.centers, axis=0).any():
        found = f"{len(trace)} sample{'s' * (len(trace) != 1)}"
        raise TraceError(f"a base needs at least three samples in different places; found {found}")
    frame = profile_frame(trace)
    if frame is not None:
        surface, parameters = fit_profile(trace, frame, form)
        return Base(surface, "profile", dict(parameters))
    if form.kind not in AREAL_FORMS:
        raise FormError(
            f"form {form.kind!r} is for profiles along one line, and this trace covers an area; possible: "
            f"{', '.join(AREAL_FORMS)}"
        )
    cloud = Cloud.of(trace.select(form.unmasked(trace)) if form.masks else trace, MOST_BASE_CELLS, inside)
    fits = _fits(AREAL_FORMS[form.kind], cloud)
    if not fits:
        raise FormError(f"form {form.kind!r}: none of its bodies can be fitted to this trace; possible: auto, line")
    # levels explain the top of a block and of the table beneath it: its sides ask for a body
    if form.kind == "auto" and all(_missed(fit, cloud) > EXPLAINED for fit in fits if "levels" not in fit.parameters):
        if not _ends_in_a_plane(cloud):
            fits += _fits((extrusion,), cloud)
        if _unexplained(fits, cloud):
            bodies = _last_resort((polyhedron,), cloud)
            fits += [body for body in bodies if not _walked_through(body, cloud, trace)]
        if _unexplained(fits, cloud):
            fits += _last_resort(FREE, cloud)
    missed_by_all = all(_missed(fit, cloud) > EXPLAINED for fit in fits)
    through_ends = _of_ends(cloud) if missed_by_all else []
    fits += [fit for fit in through_ends if _holds_ends(fit, cloud)]
    nearest = min(fits, key=lambda fitted: fitted.cost(cloud.scale))
    # the details of a crowded plate take most of its path: what lies on them is no noise of the base between them
    on_base = np.abs(nearest.residual) < FEATURE_RESIDUAL_SDS * cloud.scale
    on_base |= nearest not in through_ends
    scale, share = _noise_of(nearest.residual[on_base], cloud.sweep[on_base], cloud.scale)
    alone = _alone(nearest.residual, cloud) if missed_by_all and nearest not in through_ends else None
    if alone is not None:
        # most of the path may lie on one detail, and what all sweeps miss there counts as one sweep's
        own, of_own = _noise_of(alone, cloud.sweep, cloud.scale)
        if all(np.median(np.abs(fit.residual)) > EXPLAINED * own for fit in fits):
            fits += through_ends
            scale, share = own, of_own / len(np.unique(cloud.sweep))
    best = min(fits, key=lambda fitted: fitted.cost(scale, share))
    missed = _foretold(best, trace, best in through_ends) if tested else None
    return Base(best.surface(cloud, spacing), best.kind, best.parameters, missed=missed)


def _walked_through(body: Fitted, cloud: Cloud, trace: Trace) -> bool:
    """True if many sweeps go from sample to sample straight through a body: it is not where they went.

    The upper side of a plate and what lies beyond its edge, deeper than a ball is wide, are else a slab's two sides.
    """
    step = np.diff(trace.centers, axis=0)
    along = (np.diff(trace.sweep) == 0) & (np.linalg.norm(step, axis=1) > 0.5 * trace.tip_radius)
    if not along.any():
        return False
    middles = (trace.centers[:-1] + 0.5 * step)[along]
    near = NearestPoint(body.surface(cloud, None)).query(middles)
    inside = np.einsum("ij,ij->i", middles - near.points, near.normals) < 0.0
    through = np.unique(trace.sweep[:-1][along][inside])
    return bool(len(through) > MOST_WALKED * len(np.unique(trace.sweep)))


def _foretold(best: Fitted, trace: Trace, through_ends: bool) -> float | None:
    """By how much a simple body fitted to every other sweep misses those between, m, if that is no more than noise.

    None if it misses them by more, as where noise wanders or the body is none of these, and of free bodies, which
    follow what they are fitted to. A base that the ends of the sweeps tell is asked of the ends of the others.
    """
    family = SIMPLE.get(best.kind)
    numbers = np.unique(trace.sweep)
    if family is None or len(numbers) < 2 * FEWEST_HALF:
        return None
    half = np.isin(trace.sweep, numbers[::2])
    cloud = Cloud.of(trace.select(half), MOST_BASE_CELLS)
    fits = [fit for fit in _of_ends(cloud) if fit.kind == best.kind] if through_ends else _fits(family, cloud)
    if not fits:
        return None
    fit = min(fits, key=lambda fitted: fitted.cost(cloud.scale))
    others = Cells.of(trace.select(~half), MOST_BASE_CELLS)
    asked = _ends(others.sweep) if through_ends else np.ones(len(others.sweep), dtype=bool)
    centers, sweep = others.centers[asked], others.sweep[asked]
    base = Base(fit.surface(cloud, None), fit.kind, fit.parameters)
    missed, scatter = base.misses(centers, trace.tip_radius)
    if missed > FORETOLD * scatter:
        return None
    # nor by more as a whole sweep than so many times what its cells make of that
    over = base.foot(centers, trace.tip_radius).height[:, None] - base.levels
    height = over[np.arange(len(over)), np.abs(over).argmin(axis=1)]
    alike, apart = _shares(height, sweep, max(scatter, cloud.scale))
    return missed if apart >= alike / FORETOLD**2 else None


def _fits(families: Iterable[Family], cloud: Cloud) -> list[Fitted]:
    return [fitted for family in families if (fitted := family(cloud)) is not None]


def _last_resort(families: Iterable[Family], cloud: Cloud) -> list[Fitted]:
    return [replace(fit, last_resort=True) for fit in _fits(families, cloud)]


def _missed(fit: Fitted, cloud: Cloud) -> float:
    """Distance within which half of the cells lie from the fitted surface, in the scatter of neighbouring cells."""
    return float(np.median(np.abs(fit.residual))) / cloud.scale


def _unexplained(fits: Iterable[Fitted], cloud: Cloud) -> bool:
    """True if nothing explains most of the cells by as much as they scatter."""
    return all(_missed(fit, cloud) > EXACTLY for fit in fits if fit.explains)


def _noise_of(residual: FloatArray, sweep: IntArray, floor: float) -> tuple[float, float]:
    """Scale of the scatter of cells (C,) of some sweeps (C,) about the freest fit, m, and the share of them that count
    as independent; the scale is no less than half of `floor`, m.

    Noise that is correlated along the path makes neighbours agree: by the scatter from cell to cell alone, a
    plane would be bent to follow it. So it would be by sweeps that stand off each other as a whole: as many count as
    their medians scatter like those of.
    """
    # the scatter from cell to cell is too large where sweeps are short and bend over features
    scale = max(0.5 * floor, robust_scale(residual))
    return scale, min(_independent(residual / scale), _shares(residual, sweep, scale)[1])


def _independent(residual: FloatArray) -> float:
    """The share of cells that count as independent by how alike those beside each other miss a fit, (C,) in its scale,
    where that is noise: a detail is even from cell to cell, and where a quarter of the path lies on some, one sound
    cell in seven would count."""
    near = np.abs(residual) < FEATURE_RESIDUAL_SDS
    square = max(float((residual[near] ** 2).sum()) / max(int(near.sum()), 1), EXACT_SQUARE)
    products = (residual[1:] * residual[:-1])[near[1:] & near[:-1]]
    return independent_share(float(products.sum()) / max(len(products), 1) / square)


def _shares(residual: FloatArray, sweep: IntArray, scale: float) -> tuple[float, float]:
    """The share of cells (C,) that count as independent, by how alike neighbours are along the sweeps, and by how far
    the sweeps' medians scatter; of few sweeps that is no less."""
    kept = np.clip(residual / scale, -FEATURE_RESIDUAL_SDS, FEATURE_RESIDUAL_SDS)
    square = max(float((kept**2).mean()), EXACT_SQUARE)
    alike = independent_share(float((kept[1:] * kept[:-1]).mean()) / square)
    own = [kept[sweep == number] for number in np.unique(sweep)]
    if len(own) < FEWEST_HALF:
        return alike, 1.0
    apart = max(robust_sd(np.array([np.median(each) for each in own])) ** 2, 1e-12)
    return alike, min(1.0, OF_MEDIAN * square / apart * len(own) / len(kept))


def _alone(residual: FloatArray, cloud: Cloud) -> FloatArray | None:
    """Residuals (C,) of the cells without what their sweeps share with those beside them; None if that is no more than
    noise (see `unshared`)."""
    rest = unshared(rows_of(cloud.points, residual, cloud.sweep))
    return None if rest is None else np.concatenate(rest)


def _of_ends(cloud: Cloud) -> list[Fitted]:
    """Height fields through the ends of the sweeps, and what lies as they do.

    What sweeps were laid over to feel it lies in their middle; where that is most of them no sum of residuals finds the
    base.
    """
    found = []
    for design, kind in ((plane_design, "plane"), (quadric_design, "quadric")):
        near = _ends(cloud.sweep)
        for _ in range(ENDS_ROUNDS):
            fit = height_field(design, kind, cloud, among=near)
            near = np.abs(fit.residual) < FEATURE_RESIDUAL_SDS * cloud.scale
            if near.sum() < len(near) // END_SHARE:
                break
            found.append(fit)
    return found


def _ends_in_a_plane(cloud: Cloud) -> bool:
    """True if nearly all sweeps begin and end on one plane: what bends between its ends is a detail on it, or steps."""
    ends = _ends(cloud.sweep)
    fit = height_field(plane_design, "plane", cloud, among=ends)
    return bool(np.mean(np.abs(fit.residual[ends]) < FEATURE_RESIDUAL_SDS * cloud.scale) > ALL_ENDS)


def _holds_ends(fit: Fitted, cloud: Cloud) -> bool:
    """True if most of the sweeps' ends lie on a base: as many as tell it against details that the others end on."""
    off = np.abs(fit.residual[_ends(cloud.sweep)])
    return bool(np.mean(off < FEATURE_RESIDUAL_SDS * cloud.scale) > MOST_ENDS)


def _ends(sweep: IntArray) -> BoolArray:
    """(C,) True for the first and the last cells of each sweep."""
    begins = np.flatnonzero(np.diff(sweep, prepend=sweep[0] - 1))
    counts = np.diff(np.append(begins, len(sweep)))
    place = np.arange(len(sweep)) - np.repeat(begins, counts)
    end = np.repeat(np.maximum(1, counts // END_SHARE), counts)
    return np.asarray((place < end) | (place >= np.repeat(counts, counts) - end))
