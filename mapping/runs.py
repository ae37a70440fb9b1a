"""Runs: sweeps that ran along a ridge or groove instead of across it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mapping.base import Base
from mapping.crossing import Crossing

FloatArray = NDArray[np.float64]


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
    steps = [c for c in crossings if c.kind.startswith("step")]
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
