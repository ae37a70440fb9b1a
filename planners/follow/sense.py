"""Sense: what one sweep felt, while exploring."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, Trace
from mapping.base import Base
from mapping.detection import Crossing, detect
from mapping.instrument import Noise
from planners.follow.recross import is_step


@dataclass(frozen=True, eq=False)
class Sense:
    """Detects on single sweeps over a known base.

    Args:
        base: the global model.
        noise: of the samples; None: estimated from each sweep.
        false_alarms_per_metre: 1/m.
    """

    base: Base
    noise: Noise | None = None
    false_alarms_per_metre: float = 0.01

    def crossings(self, trace: Trace) -> tuple[Crossing, ...]:
        """Crossings of one sweep; none if it felt nothing."""
        if len(trace) < 16:
            return ()
        found = detect(trace, self.base, noise=self.noise, false_alarms_per_metre=self.false_alarms_per_metre)
        return found.crossings

    def nearest(self, trace: Trace, point: FloatArray, sign: float, lowest: float, reach: float) -> Crossing | None:
        """The crossing of a crest or dip nearest to a point, with a sign and at least a height, or None.

        Args:
            sign: +1 for bumps and ridges, -1 for pits and grooves.
            lowest: least |height|, m.
            reach: how far from the point it may lie, m.
        """
        fits = [
            c
            for c in self.crossings(trace)
            if not is_step(c) and sign * c.height >= lowest and np.linalg.norm(c.point - point) <= reach
        ]
        return min(fits, key=lambda c: float(np.linalg.norm(c.point - point)), default=None)
