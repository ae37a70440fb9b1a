"""Run crest: where, beside a sweep that ran along a line, the crest of the line lies, as the other sweeps felt it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mapping.base import Base
from mapping.crest_trace import crest_trace, misfit
from mapping.crossing import Crossing
from mapping.inspection import Inspection
from mapping.runs import RunPoint

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# Half-widths to either side, within which the crest may lie and places tell it; and along the sweep, within which the
# line is straight.
ASIDE, ALONG = 1.2, 0.5
STEPS = 49
# A crest is told if places so near felt it on both sides, in half-widths, and its place is known to this share of one;
# it is as high as what was felt, up to this factor.
BESIDE, TOLD, HIGH = 0.9, 0.25, 1.35
# Signal-to-noise ratio from which the other sweeps show the crest there by themselves.
PLAIN = 6.0
# Square of the usual residual, in standard deviations, up to which it is a crest: a step's edge is not.
FITS = 3.0
# A crossing wider than so many thin wires of its height was made at a slant: the sweep ran along for a while.
SLANT = 2.0


def told_crests(places: Sequence[Crossing], inspection: Inspection, tip_radius: float) -> list[Crossing]:
    """Crossings at the crests beside places of a sweep along a line; without those where other sweeps tell none.

    Args:
        places: on the sweep, with its direction as tangent.
        inspection: heights of all sweeps.
        tip_radius: m.
    """
    found = (_told(place, inspection, tip_radius) for place in places)
    return [crest for crest in found if crest is not None]


def along(crossing: Crossing, spacing: float, base: Base, tip_radius: float) -> list[RunPoint]:
    """Places that a sweep passed while it crossed a line at a slant; none if it crossed squarely."""
    width = float(np.sqrt(2.0 * tip_radius * abs(crossing.height)))
    if crossing.half_width < SLANT * width:
        return []
    reach = crossing.half_width - width
    count = 2 * int(np.ceil(reach / spacing)) + 1
    points = crossing.point + np.linspace(-reach, reach, count)[:, None] * crossing.tangent
    feet = base.foot(points + tip_radius * crossing.normal, tip_radius)
    plain = RunPoint(**{name: getattr(crossing, name) for name in Crossing.__dataclass_fields__})
    return [
        replace(plain, point=point, normal=up, half_width=width)
        for point, up in zip(feet.points, feet.normals, strict=True)
    ]


def _told(place: Crossing, inspection: Inspection, tip_radius: float) -> Crossing | None:
    """The crossing of a crest that the places about one of a sweep tell together, or None."""
    width = float(np.sqrt(2.0 * tip_radius * abs(place.height)))
    aside = np.cross(place.normal, place.tangent)
    near = inspection.near(place.point[None], 2.0 * ASIDE * width)
    offset = inspection.points[near] - place.point
    near_by = (np.abs(offset @ place.tangent) < ALONG * width) & (np.abs(offset @ place.normal) < width)
    near, across = near[near_by], (offset @ aside)[near_by]
    other = inspection.sweep[near] != place.sweep
    if not other.any():
        return None
    crest = _fitted(across, inspection.height[near], inspection.sd[near], other, place.height, width)
    if crest is None:
        return None
    fields = {name: getattr(place, name) for name in Crossing.__dataclass_fields__}
    fields |= {"point": place.point + crest.pop("aside") * aside, "half_width": width}
    return Crossing(**fields | crest)


def _fitted(
    across: FloatArray, heights: FloatArray, sds: FloatArray, other: BoolArray, height: float, width: float
) -> dict[str, float] | None:
    """Place aside, height and standard deviations of the crest of a given width that (M,) heights show, or None.

    Args:
        across: (M,) places, m.
        other: (M,) True for those of other sweeps than the one that ran along.
        height: felt by that sweep, m.
    """
    offsets = np.linspace(-ASIDE, ASIDE, STEPS) * width
    sign = float(np.sign(height))
    shapes = sign * crest_trace(across[None] - offsets[:, None], sign, width)
    square = np.maximum((shapes**2 / sds**2).sum(axis=1), np.finfo(float).tiny)
    crests = (shapes * heights / sds**2).sum(axis=1) / square
    costs = misfit(heights - crests[:, None] * shapes, sds, height).sum(axis=1)
    best = int(costs.argmin())
    sd = 0.5 * max(float(np.ptp(offsets[costs < costs[best] + 1.0])), float(offsets[1] - offsets[0]))
    said = (shapes[best] / sds)[other]
    seen = float(said @ (heights / sds)[other]) / max(float(np.linalg.norm(said)), np.finfo(float).tiny)
    beside = (across - offsets[best])[np.abs(across - offsets[best]) < BESIDE * width]
    bracketed = len(beside) > 0 and beside.min() < 0.0 < beside.max()
    alike = 1.0 / HIGH < crests[best] / height < HIGH
    if not (alike and bracketed and seen > PLAIN and sd < TOLD * width and costs[best] < FITS * len(across)):
        return None
    height_sd = 1.0 / float(np.sqrt(square[best]))
    return {"aside": float(offsets[best]), "height": float(crests[best]), "height_sd": height_sd, "position_sd": sd}
