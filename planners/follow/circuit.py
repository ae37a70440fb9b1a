"""Circuit: a small closed path around a detection; the branches that leave it decide what it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.detection import Crossing
from planners import Outcome, Plan
from planners.follow.recross import slender
from planners.follow.sense import Sense
from planners.paths import Strokes, tangential

# Cosine of the angle between two branches of one line, at most
OPPOSITE = -0.4
NAMES_BY_BRANCHES = ("spot", "end of a line", "line", "junction")


@dataclass(frozen=True, eq=False)
class Circuit:
    """Goes round a detection once and counts what it crosses: 0 spot, 1 end, 2 line, 3 or more junction.

    Args:
        strokes, sense: how to touch and to feel.
        radius: of the circuit on the surface, m; larger than the disturbance's half-width.
    """

    strokes: Strokes
    sense: Sense
    radius: float

    def around(self, seed: Crossing) -> Plan:
        """The outcome's value is a tuple of crossings, one per branch, in the order of the circuit."""
        overlap = 1.2 * seed.half_width
        trace = yield self.strokes.circle(seed.point, seed.tangent, self.radius, overlap)
        sign = np.sign(seed.height)
        found = [c for c in self.sense.crossings(trace) if sign * c.height > 0.3 * abs(seed.height)]
        branches: list[Crossing] = []
        for crossing in sorted(found, key=lambda c: -abs(c.height)):
            if all(np.linalg.norm(crossing.point - other.point) > 0.35 * self.radius for other in branches):
                branches.append(crossing)
        count = len(branches)
        reason = NAMES_BY_BRANCHES[min(count, 3)] if len(trace) else "no contact"
        return Outcome(reason, f"the circuit crosses {count} branches", tuple(branches))


def headings(seed: Crossing, branches: tuple[Crossing, ...], tip_radius: float) -> list[FloatArray]:
    """Two directions (3,) in which to follow the line through a seed: one or two of the circuit's branches.

    Two opposite branches belong to one line. Otherwise the seed lies by an end, and the best branch is its
    line. The best are high and no wider than they must be: what the circuit only brushes is another's.
    """
    ways = [tangential(branch.point - seed.point, seed.normal) for branch in branches]
    worth = [abs(branch.height) * min(1.0, slender(branch, tip_radius)) for branch in branches]
    pairs = [
        (-float(a @ b) * min(worth[i], worth[j]), i, j)
        for i, a in enumerate(ways)
        for j, b in enumerate(ways)
        if i < j and float(a @ b) < OPPOSITE
    ]
    if pairs:
        _, i, j = max(pairs)
        return [ways[i], ways[j]]
    if not ways:
        return []
    best = ways[int(np.argmax(worth))]
    return [best, -best]
