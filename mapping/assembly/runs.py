"""Runs: sweeps that ran along a ridge or groove instead of across it (tangential sweeps).

Where the crest lies beside such a sweep is read from the other sweeps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.assembly.linking import Inspection
from mapping.base import Base
from mapping.detection import Crossing
from mapping.geometry.templates import crest_trace, robust_cost


@dataclass(frozen=True, eq=False)
class RunPoint(Crossing):
    """A place on a run: the line passes within a half-width of it, on either side."""


@dataclass(frozen=True, eq=False)
class Run:
    """One plateau of one sweep: where the trace left the base's height and where it came back."""

    first: Crossing
    last: Crossing

    @property
    def length(self) -> float:
        """Distance between both edges, m."""
        return float(np.linalg.norm(self.last.point - self.first.point))

    def points(self, spacing: float, base: Base, tip_radius: float) -> list[RunPoint]:
        """Places along the run no further apart than `spacing`, m, as crossings of unknown lateral position."""
        count = max(2, int(np.ceil(self.length / spacing)) + 1)
        share = np.linspace(0.0, 1.0, count)
        chord = self.first.point + share[:, None] * (self.last.point - self.first.point)
        normal = self.first.normal + share[:, None] * (self.last.normal - self.first.normal)
        feet = base.foot(chord + tip_radius * normal, tip_radius)
        half_width = float(np.sqrt(2 * tip_radius * abs(self.first.height)))
        kind = "convex" if self.first.height > 0 else "concave"
        fields = {name: getattr(self.first, name) for name in Crossing.__dataclass_fields__}
        plain = RunPoint(**fields)
        return [
            replace(
                plain,
                kind=kind,
                t=self.first.t + f * (self.last.t - self.first.t),
                point=point,
                normal=up,
                half_width=half_width,
                position_sd=0.5 * half_width,
            )
            for f, point, up in zip(share, feet.points, feet.normals, strict=True)
        ]

    def is_band(self, others: Sequence[Crossing], pitch: float, tip_radius: float) -> bool:
        """True if another sweep found the same plateau further away than a line's own disturbance reaches."""
        middle = 0.5 * (self.first.point + self.last.point)
        along = (self.last.point - self.first.point) / max(self.length, 1e-300)
        line = 2.2 * float(np.sqrt(2 * tip_radius * abs(self.first.height)))
        for other in others:
            offset = other.point - middle
            lateral = float(np.linalg.norm(offset - (offset @ along) * along))
            inside = abs(offset @ along) < 0.5 * self.length + line
            alike = other.height * self.first.height > 0 and 0.7 < other.height / self.first.height < 1.4
            if other.sweep != self.first.sweep and inside and alike and line < lateral < 2.5 * max(pitch, line):
                return True
        return False


def split_runs(crossings: Sequence[Crossing]) -> tuple[list[Run], list[Crossing]]:
    """Plateaus with both edges on one sweep, and the steps that have no partner."""
    steps = [c for c in crossings if c.is_step]
    runs, single = [], []
    while steps:
        first = steps.pop(0)
        # both edges of a plateau were measured by one fit
        partner = next(
            (c for c in steps if c.sweep == first.sweep and c.height == first.height and c.kind != first.kind), None
        )
        if partner is None:
            single.append(first)
        else:
            steps.remove(partner)
            runs.append(Run(first, partner))
    return runs, single


# Half-widths to either side, within which the crest may lie and places tell it; and along the sweep, within which the
# line is straight.
CREST_SEARCH_REACH, STRAIGHT_REACH = 1.2, 0.5
CREST_SEARCH_STEPS = 49
# A crest is told if places so near felt it on both sides, in half-widths, and its place is known to this share of one;
# it is as high as what was felt, up to this factor.
BRACKET_REACH, MOST_PLACE_SD, HIGH = 0.9, 0.25, 1.35
# Signal-to-noise ratio from which the other sweeps show the crest there by themselves.
PLAIN_CREST_SNR = 6.0
# Square of the usual residual, in standard deviations, up to which it is a crest: a step's edge is not.
FITS = 3.0
# A crossing wider than so many thin wires of its height was made at a slant: the sweep ran along for a while.
SLANTED_WIRE_RATIO = 2.0


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
    if crossing.half_width < SLANTED_WIRE_RATIO * width:
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
    near = inspection.near(place.point[None], 2.0 * CREST_SEARCH_REACH * width)
    offset = inspection.points[near] - place.point
    near_by = (np.abs(offset @ place.tangent) < STRAIGHT_REACH * width) & (np.abs(offset @ place.normal) < width)
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
    offsets = np.linspace(-CREST_SEARCH_REACH, CREST_SEARCH_REACH, CREST_SEARCH_STEPS) * width
    sign = float(np.sign(height))
    shapes = sign * crest_trace(across[None] - offsets[:, None], sign, width)
    square = np.maximum((shapes**2 / sds**2).sum(axis=1), np.finfo(float).tiny)
    crests = (shapes * heights / sds**2).sum(axis=1) / square
    costs = robust_cost(heights - crests[:, None] * shapes, sds, height).sum(axis=1)
    best = int(costs.argmin())
    sd = 0.5 * max(float(np.ptp(offsets[costs < costs[best] + 1.0])), float(offsets[1] - offsets[0]))
    said = (shapes[best] / sds)[other]
    seen = float(said @ (heights / sds)[other]) / max(float(np.linalg.norm(said)), np.finfo(float).tiny)
    beside = (across - offsets[best])[np.abs(across - offsets[best]) < BRACKET_REACH * width]
    bracketed = len(beside) > 0 and beside.min() < 0.0 < beside.max()
    alike = 1.0 / HIGH < crests[best] / height < HIGH
    if not (
        alike
        and bracketed
        and seen > PLAIN_CREST_SNR
        and sd < MOST_PLACE_SD * width
        and costs[best] < FITS * len(across)
    ):
        return None
    height_sd = 1.0 / float(np.sqrt(square[best]))
    return {"aside": float(offsets[best]), "height": float(crests[best]), "height_sd": height_sd, "position_sd": sd}
