"""Roughness: the standards' parameters of what a trace shows beside its features, its form removed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from explore3d import UserError, count_text
from mapping import BoolArray, Feature, FloatArray, Interval, Trace, length_text
from mapping.base import Base, LaidSweep, LaidTrace
from mapping.detection import terraced
from mapping.estimate.roughness import (
    EVALUATED_SECTIONS,
    NESTING_INDICES,
    Stretch,
    areal_parameters,
    profile_parameters,
    suited_cutoff,
)
from mapping.geometry.mesh import distances
from mapping.inference.kinds import feature_trace, kind_of, sizes_of

# Nesting index of the S-filter that belongs to each of the L-filter's (ISO 21920-3), m
SHORT_INDICES = dict(zip(NESTING_INDICES, (2.5e-6, 2.5e-6, 2.5e-6, 8e-6, 25e-6), strict=True))
# What belongs to a feature: its trace, and so many standard deviations of its place
_PLACE_SDS = 3.0
# Half-widths up to which what runs out of a feature is looked for (wider ones are no fine features), and at how many
# places
_FARTHEST, _PLACES = 4.0, 61
# Rounding of the mean distance of samples
SPACING_ROUNDING = 1e-3
# Directions of a raster's sweeps agree to this cosine, their distances to this share
PARALLEL, EVEN_ROWS = 0.9998, 0.1
# Samples in the S-filter's length, and rows in the L-filter's, at least: fewer do not show the shape of what passes
FEWEST_IN_SHORT, FEWEST_ROWS = 2.0, 5.0


@dataclass(frozen=True, eq=False)
class Roughness:
    """Parameters by ISO 21920-2 and ISO 25178-2.

    Args:
        cutoff: nesting index of the L-filter, m.
        short_cutoff: of the S-filter, m; None: the samples lie too far apart for one.
        profile: Ra, Rq ... with 90 % intervals.
        sections: as long as the cut-off, that they rest on.
        areal: Sa, Sq ..., empty where the sweeps are no raster.
        squares: as wide as the cut-off, that these rest on.
        why_no_areal: one sentence, "" if there are areal ones.
        noise: of a sample as the detection took it, m: instrument and surface are one there.
        form: what was taken off before the filters, in words.
    """

    cutoff: float
    short_cutoff: float | None
    profile: dict[str, Interval]
    sections: int
    areal: dict[str, Interval]
    squares: int
    why_no_areal: str
    noise: float
    form: str

    @property
    def parameters(self) -> dict[str, Interval]:
        """All of them by name."""
        return self.profile | self.areal

    def record(self) -> dict[str, Any]:
        """The same in JSON's types, m."""
        values = {
            name: {"median": each.median, "low": each.low, "high": each.high} for name, each in self.parameters.items()
        }
        about = ("cutoff", "short_cutoff", "sections", "squares", "why_no_areal", "noise", "form")
        return {name: getattr(self, name) for name in about} | {"parameters": values}

    def rows(self) -> list[tuple[str, str, str]]:
        """Name, value and 90 % range of each parameter, as text."""
        return [(name, *_text(name, each)) for name, each in self.parameters.items()]

    def sentence(self) -> str:
        """Which filters, and how much of the surface they left to be evaluated."""
        short = "no S-filter" if self.short_cutoff is None else f"an S-filter of {length_text(self.short_cutoff)}"
        kind = f"{self.sections} sections" + (f" and {self.squares} squares" if self.squares else "")
        return (
            f"Taken off before the filters: {self.form}. Gaussian L-filter of {length_text(self.cutoff)}, {short}; "
            f"{kind} beside the features. Ranges are 90 % intervals, from section to section. The noise of a sample is "
            f"{length_text(self.noise, 2)}: the detection counts instrument and roughness as one."
        )


def _text(name: str, value: Interval) -> tuple[str, str]:
    if name.endswith(("sk", "ku")):
        known = np.isfinite([value.low, value.high]).all()
        return f"{value.median:.3g}", f"{value.low:.3g} to {value.high:.3g}" if known else ""
    return value.text()


def why_no_roughness_of(trace: LaidTrace, cutoff: float | None) -> str:
    """Why a trace has no parameters of roughness, "" if it may have."""
    longest = max((float(sweep.arclength[-1]) for sweep in trace.laid_sweeps if len(sweep.trace) > 1), default=0.0)
    index = suited_cutoff(longest, EVALUATED_SECTIONS) if cutoff is None else cutoff
    if index is None:
        return f"no sweep is long enough for {EVALUATED_SECTIONS} sections of {length_text(NESTING_INDICES[0])}"
    if trace.tip_radius > index:
        return f"a tip of {length_text(trace.tip_radius)} bridges what a filter of {length_text(index)} leaves"
    return ""


def surely_taken(trace: Trace, cutoff: float | None) -> bool:
    """True if a trace tells of roughness even if its sweeps are no longer than the way between their ends.

    Asked before anything is laid on the base. Every sample is laid for the parameters: then that comes first, and
    whatever else is asked of the base follows from it.
    """
    ways = [float(np.linalg.norm(sweep.centers[-1] - sweep.centers[0])) for _, sweep in trace.sweeps()]
    index = suited_cutoff(max(ways, default=0.0), EVALUATED_SECTIONS) if cutoff is None else cutoff
    return index is not None and trace.tip_radius <= index


def roughness_of(
    trace: LaidTrace,
    features: Sequence[Feature],
    noise: float,
    cutoff: float | None = None,
    short_cutoff: float | None = None,
) -> Roughness | None:
    """The parameters of a trace over its base, beside the features; None if too little is left.

    Args:
        trace: laid on its base.
        features: found on it.
        noise: of a sample, m.
        cutoff: nesting index of the L-filter, m; None: the largest standard one that fits EVALUATED_SECTIONS times.
        short_cutoff: of the S-filter, m; None: what belongs to the L-filter, if the samples are close enough.

    Raises:
        UserError: the samples lie too far apart for the S-filter that was asked for.
    """
    longest = max(float(sweep.arclength[-1]) for sweep in trace.laid_sweeps)
    index = cutoff or suited_cutoff(longest, EVALUATED_SECTIONS)
    if index is None:
        return None
    reaches = [(each, reach_above(each, noise, trace.tip_radius)) for each in features]
    pieces = [piece for sweep in trace.laid_sweeps for piece in _pieces(sweep, trace, reaches, over_terraces=True)]
    spacing = float(np.median([piece.spacing for piece, _ in pieces])) if pieces else np.inf
    short = short_cutoff or SHORT_INDICES.get(index, index / 300.0)
    usable = None if spacing * FEWEST_IN_SHORT > short * (1.0 + SPACING_ROUNDING) else short
    if short_cutoff is not None and usable is None:
        raise UserError(
            f"an S-filter of {length_text(short_cutoff)} needs samples at most {length_text(short / FEWEST_IN_SHORT)} "
            f"apart; these lie {length_text(spacing)} apart"
        )
    profile, sections = profile_parameters([piece for piece, _ in pieces], index, usable)
    if not profile:
        return None
    areal, squares, why_not = _areal(pieces, index, usable)
    return Roughness(index, usable, profile, sections, areal, squares, why_not, noise, form_text(trace.base))


def form_text(base: Base) -> str:
    """What a base takes off as form, in words."""
    if base.kind == "mesh":
        return "the global model"
    if base.kind != "profile":
        return f"a fitted {base.kind}"
    fitted: Any = base.parameters
    if "form" in fitted:
        asked = fitted["form"]
        size = {"poly": f":{asked['degree']}", "gaussian": f":{length_text(asked['cutoff'])}"}.get(asked["kind"], "")
        return f"the form that was asked for, {asked['kind']}{size}"
    degree, pieces = int(fitted["degree"]), int(fitted["pieces"])
    if degree == 1 and pieces == 1:
        return "a straight line"
    curve = f"a curve of {count_text(pieces, 'piece')} of degree {degree}"
    return f"{curve}, {length_text(fitted['piece_length'], 2)} long each (--form line takes off less)"


def reach_above(feature: Feature, level: float, tip_radius: float) -> float:
    """How far to the side of a feature's axis its trace stands off by more than a level, m, over a base that is flat
    there: at least its half-width, and further where its flank runs out.

    Args:
        feature: any.
        level: m.
        tip_radius: m.
    """
    half_width, kind = sizes_of(feature, tip_radius).half_width, kind_of(feature)
    if kind.sided:  # what a step leaves goes on to wherever its level does
        return half_width
    middle = (len(feature.axis) - 1) // 2
    normal = feature.normals[middle]
    along = feature.axis[middle + 1] - feature.axis[middle] if kind.line else np.roll(normal, 1)
    aside = np.cross(normal, along)
    aside /= max(float(np.linalg.norm(aside)), np.finfo(float).tiny)
    away = half_width * np.linspace(1.0, _FARTHEST, _PLACES)
    feet = feature.axis[middle] + away[:, None] * aside
    left = feature_trace(feature, feet, np.tile(normal, (len(feet), 1)), tip_radius)
    return float(away[np.flatnonzero(np.abs(left) > level)].max(initial=half_width))


def _pieces(
    sweep: LaidSweep, trace: LaidTrace, reaches: Sequence[tuple[Feature, float]], over_terraces: bool = False
) -> list[tuple[Stretch, FloatArray]]:
    """A sweep's evenly sampled pieces, without what lies within the reach (m) of features, and the places (N, 3) of
    their samples."""
    if len(sweep.trace) < 3:
        return []
    # a bin holds one sample: where they all stand is known, and between neighbours it is a line
    found, feet = [], sweep.feet().points.T
    for piece in sweep.heights(float(sweep.arclength[-1]) / (len(sweep.trace) - 1)):
        under = np.column_stack([np.interp(piece.s, sweep.arclength, known) for known in feet])
        keep = np.ones(len(piece.height), dtype=bool)
        for feature, half_width in reaches:
            reach = half_width + _PLACE_SDS * feature.position_sd
            low, high = feature.axis.min(axis=0) - reach, feature.axis.max(axis=0) + reach
            near = np.flatnonzero(((under >= low) & (under <= high)).all(axis=1))
            keep[near] &= distances(under[near], feature.axis) > reach
        # a body's levels are none of its roughness
        level = terraced(piece, trace.base, trace.tip_radius).profile.height if over_terraces else piece.height
        found.append((Stretch(level, keep, piece.spacing), np.asarray(piece.centers)))
    return found


def residual(trace: Trace, base: Base, features: Sequence[Feature]) -> tuple[FloatArray, tuple[float, float]]:
    """Heights over the base of a profile (N,) or a raster (M, N), m, NaN where a feature is; spacing of rows, columns.

    Raises:
        UserError: several sweeps that are no raster.
    """
    laid = LaidTrace.of(trace, base)
    reaches = [(each, sizes_of(each, trace.tip_radius).half_width) for each in features]
    pieces = [piece for sweep in laid.laid_sweeps for piece in _pieces(sweep, laid, reaches)]
    if len(pieces) == 1:
        stretch = pieces[0][0]
        return np.where(stretch.keep, stretch.heights, np.nan), (0.0, stretch.spacing)
    raster = _raster(pieces)
    if isinstance(raster, str):
        raise UserError(f"heights on a grid need one profile or a raster: {raster}")
    heights, keep, spacing = raster
    return np.where(keep, heights, np.nan), spacing


def _areal(
    pieces: Sequence[tuple[Stretch, FloatArray]], cutoff: float, short_cutoff: float | None
) -> tuple[dict[str, Interval], int, str]:
    """Areal parameters where the sweeps are a raster; else the reason why not."""
    raster = _raster(pieces)
    if isinstance(raster, str):
        return {}, 0, raster
    heights, keep, spacing = raster
    row, _ = spacing
    if row * FEWEST_ROWS > cutoff:
        return {}, 0, f"the rows lie {length_text(row, 2)} apart, too far for a filter of {length_text(cutoff)}"
    short = short_cutoff if short_cutoff is not None and row * FEWEST_IN_SHORT <= short_cutoff else None
    values, squares = areal_parameters(heights, keep, spacing, cutoff, short)
    return values, squares, "" if values else f"not one square of {length_text(cutoff)} fits on the raster"


def _raster(
    pieces: Sequence[tuple[Stretch, FloatArray]],
) -> tuple[FloatArray, BoolArray, tuple[float, float]] | str:
    """Heights and what is kept (M, N) of parallel, evenly spaced sweeps, and the spacing (m); else why not."""
    if len(pieces) < FEWEST_ROWS:
        return f"{count_text(len(pieces), 'sweep is', 'sweeps are')} no raster"
    ways = np.array([place[-1] - place[0] for _, place in pieces])
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), np.finfo(float).tiny)
    along = ways[0]
    if np.abs(ways @ along).min() < PARALLEL:
        return "the sweeps are not parallel"
    middles = np.array([place.mean(axis=0) for _, place in pieces])
    off = middles - middles[0] - np.outer((middles - middles[0]) @ along, along)
    across = off[np.linalg.norm(off, axis=1).argmax()]
    offset = off @ (across / max(float(np.linalg.norm(across)), np.finfo(float).tiny))
    order = np.argsort(offset)
    gaps = np.diff(offset[order])
    row = float(np.median(gaps))
    if row <= 0.0 or np.abs(gaps - row).max() > EVEN_ROWS * row:
        return "the sweeps are not evenly spaced"
    low = max(float((place @ along).min()) for _, place in pieces)
    high = min(float((place @ along).max()) for _, place in pieces)
    column = float(np.median([piece.spacing for piece, _ in pieces]))
    grid = np.arange(low, high, column)
    if not len(grid):
        return "the sweeps have no stretch in common"
    rows = [_on_grid(pieces[k][0], pieces[k][1] @ along, grid) for k in order]
    return np.array([each for each, _ in rows]), np.array([each for _, each in rows]), (row, column)


def _on_grid(piece: Stretch, at: FloatArray, grid: FloatArray) -> tuple[FloatArray, BoolArray]:
    order = np.argsort(at)
    heights = np.interp(grid, at[order], piece.heights[order])
    return heights, np.interp(grid, at[order], piece.keep[order].astype(np.float64)) > 0.999
