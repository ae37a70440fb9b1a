"""Evidence of a curve through a profile: most places lie on it, some stand off it by anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.instrument import FEATURE_RESIDUAL_SDS, core_of

# A correlation below which further ones are of chance: of 480 places each is off by 0.05 (one standard deviation)
LEAST_CORRELATION = 0.05


@dataclass(frozen=True)
class Scatter:
    """What a profile's places are taken to do beside any curve.

    Args:
        least: standard deviation from place to place, m: no curve is followed closer.
        span: heights that a detail may have, m: it stands anywhere among them.
        places: over how many places deviations are alike; 1 of white noise. So many count once.
    """

    least: float
    span: float
    places: float

    @classmethod
    def left_by(cls, residual: FloatArray, least: float, span: float) -> Scatter:
        """Scatter as the freest curve leaves it: what that does not follow, none does."""
        sd = core_of(residual, least, span).sd
        near = np.where(np.abs(residual) < FEATURE_RESIDUAL_SDS * sd, residual, 0.0)
        near = near - near.mean()
        variance, places = float(near @ near), 1.0
        for lag in range(1, len(near) // 10 if variance > 0.0 else 0):
            correlation = float(near[lag:] @ near[:-lag]) / variance
            if correlation < LEAST_CORRELATION:
                break
            places += 2.0 * correlation
        return cls(least, span, places)

    def price(self, count: int) -> float:
        """What one free coefficient of a curve through so many places costs: the logarithm of their number."""
        return float(np.log(max(count / self.places, 2.0)))

    def misfit(self, residual: FloatArray) -> float:
        """-2 log likelihood of residuals (N,), m, at the likeliest scatter and share of places that stand off.

        The scatter is free: truncated squares at a stated one prefer any curve that is about right everywhere to a
        line on which one half of a thread's profile lies and the other does not.
        """
        return core_of(residual, self.least, self.span).misfit / self.places

    def share_on(self, residual: FloatArray) -> float:
        """Share of the places that lie on the curve."""
        return 1.0 - core_of(residual, self.least, self.span).off

    def within(self, residual: FloatArray) -> float:
        """How far a place on the curve lies off it at most, m."""
        return FEATURE_RESIDUAL_SDS * core_of(residual, self.least, self.span).sd

    def ends_on(self, residual: FloatArray, edges: Sequence[int]) -> bool:
        """True if most of what lies before the first edge, and beyond the last one, lies on the level there."""
        within = self.within(residual)
        ends = residual[: min(edges) + 1], residual[max(edges) + 1 :]
        return all(float(np.median(np.abs(end))) < within for end in ends)

    def felt_part(self, residual: FloatArray, price: float) -> tuple[int, int]:
        """Indices [first, last) of the part of a profile that comes back to its curve (N,) at either end.

        What stands off beyond the last place on it may go on anywhere: it is left out where its places there cost more
        than `price`.
        """
        found = core_of(residual, self.least, self.span)
        density = found.density(residual, self.span)
        usual = 1.0 - 2.0 * np.log((1.0 - found.off) / (np.sqrt(2.0 * np.pi) * found.sd))
        saved = (-2.0 * np.log(density) - usual) / self.places
        cut = [0, 0]
        for side, order in enumerate((slice(None), slice(None, None, -1))):
            off = residual[order]
            out = np.sign(off[0]) * off > FEATURE_RESIDUAL_SDS * found.sd
            run = int(np.argmin(out))  # 0 if all of it were off: then it is no base that anything leaves
            if run and float(saved[order][:run].sum()) > price:
                cut[side] = run + int(np.argmax(np.sign(off[0]) * off[run:] < found.sd))
        return cut[0], len(residual) - cut[1]
