"""Bump or pit: crossed sweeps through its top give its centre, height and widths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, length_text
from mapping.detection import Crossing
from planners import Outcome, Plan
from planners.follow.sense import Sense
from planners.paths import Strokes

# Ratio of half-widths from which a bump is taken for a short ridge
ELONGATED = 1.25


@dataclass(frozen=True, eq=False)
class BumpSize:
    """A sized bump or pit.

    Args:
        point, normal: (3,) of the base under the top, m.
        height: signed height, m.
        half_widths: of the disturbance along the two crossed sweeps, m.
        ways: (2, 3) directions of these sweeps.
        sd: standard deviation of the centre along either, m.
    """

    point: FloatArray
    normal: FloatArray
    height: float
    half_widths: tuple[float, float]
    ways: FloatArray
    sd: float

    @property
    def long_way(self) -> FloatArray | None:
        """Direction (3,) in which it is so much longer than across that it is a short ridge, or None."""
        first, second = self.half_widths
        if max(first, second) < ELONGATED * min(first, second):
            return None
        return np.asarray(self.ways[0] if first > second else self.ways[1])

    def distance(self, point: FloatArray) -> float:
        """Distance of a point from the centre, m."""
        return float(np.linalg.norm(point - self.point))

    def explains(self, crossing: Crossing) -> bool:
        """True if the bump disturbs a sweep that passes there."""
        return self.distance(crossing.point) < 1.3 * max(self.half_widths)


@dataclass(frozen=True, eq=False)
class BumpSizer:
    """Sweeps through the top in two crossed directions, each moving on to the top that the last one found.

    It gives up where the first two show nothing.

    Args:
        strokes, sense: how to touch and to feel.
        precision: wanted standard deviation of the centre, m.
        most: largest number of sweeps.
    """

    strokes: Strokes
    sense: Sense
    precision: float
    most: int = 6

    def size(self, seed: Crossing) -> Plan:
        """The outcome's value is a BumpSize, or None if the bump was not found again."""
        point, sign = seed.point, float(np.sign(seed.height))
        across = np.cross(seed.normal, seed.tangent)
        found: list[list[Crossing]] = [[], []]
        for k in range(self.most):
            way = across if k % 2 == 0 else seed.tangent
            half = 2.5 * seed.half_width
            trace = yield self.strokes.line(point, way, half, half)
            lowest = 0.5 * abs(seed.height)
            crossing = self.sense.nearest(trace, point, sign, lowest, 1.5 * seed.half_width)
            if crossing is None:
                if k % 2 and not any(found):  # the same two sweeps again would show as little
                    break
                continue
            moved = float(np.linalg.norm(crossing.point - point))
            point = crossing.point
            found[k % 2].append(crossing)
            if all(found) and moved < 0.2 * seed.half_width and self._precise(found):
                break
        if not all(found):
            return Outcome("lost", "the bump was not found again", None)
        sized = self._sized(point, seed, found)
        return Outcome("done", f"a bump {length_text(sized.height)} high", sized)

    def _precise(self, found: list[list[Crossing]]) -> bool:
        return max(_sd(group) for group in found) <= self.precision

    def _sized(self, point: FloatArray, seed: Crossing, found: list[list[Crossing]]) -> BumpSize:
        best = max((c for group in found for c in group), key=lambda c: abs(c.height))
        across, along = (float(np.median([c.half_width for c in group])) for group in found)
        ways = np.stack([seed.tangent, np.cross(seed.normal, seed.tangent)])
        return BumpSize(point, seed.normal, best.height, (along, across), ways, max(_sd(group) for group in found))


def _sd(group: list[Crossing]) -> float:
    return float(sum(c.position_sd**-2 for c in group if c.position_sd > 0) ** -0.5) if group else np.inf
