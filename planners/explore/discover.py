"""Discover: find an unknown body inside a box, and fit a base that says where its surface is felt next."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hw import Move
from mapping import FloatArray, SurfaceError, Trace, TraceError, length_text
from mapping.base import BASE_TRIANGLE_SIZE, FORETOLD, Base, Cells, fit_base, rolled_off, touched_part
from planners import Outcome, Plan, PlannerError
from planners.explore.feel_line import Felt, FeltLine, empty_at, facing
from planners.explore.warm_up import get_ready
from planners.survey import Survey

APPROACH_SIDES = ("+x", "-x", "+y", "-y", "+z", "-z")
# Lines along and across each side of the box, and sweeps that test a fit
LINES_ALONG, LINES_ACROSS, TESTING = 5, 3, 8
MOST_DISCOVERY_ROUNDS = 4
# A base is good if it misses the next sweeps by less than this share of the smallest feature, or than noise explains
GOOD = 0.1
MOST_DISCOVERY_CELLS = 4000


@dataclass(frozen=True, eq=False, kw_only=True)
class Discover:
    """Coarse lines from the box's sides, a fit, sweeps over the fit that test it, a better fit, until it predicts.

    The base is the family with the best evidence (plane, sphere, cylinder, quadric, smooth sheet), trimmed to where
    the finger felt the body inside the box.

    Args:
        low, high: (3,) corners of the box that holds the surface to be explored, m. Above each side that is
            approached the space must be free.
        tip_radius: m.
        smallest: height of the smallest feature to be found, m: so good the base must be.
        sides: from which to approach, of APPROACH_SIDES.
        speed, force: of the sweeps, m/s and N.
    """

    low: FloatArray
    high: FloatArray
    tip_radius: float
    smallest: float
    sides: tuple[str, ...] = ("+z",)
    speed: float = 0.03
    force: float = 1.0

    def __post_init__(self) -> None:
        unknown = [side for side in self.sides if side not in APPROACH_SIDES]
        if unknown or not self.sides:
            found = unknown or "none"
            raise PlannerError(f"discover: sides must be some of {', '.join(APPROACH_SIDES)}; found {found}")
        if not (np.asarray(self.low) < np.asarray(self.high)).all():
            raise PlannerError(f"discover: low must lie below high; found {self.low} and {self.high}")

    def plan(self) -> Plan:
        """The outcome's value is the Base, or None if nothing was touched inside the box."""
        get_ready(self.tip_radius)
        try:
            return (yield from self._everything())
        except (SurfaceError, TraceError) as error:
            return Outcome("nothing found", str(error))

    def _everything(self) -> Plan:
        felt = Felt()
        for side in self.sides:
            for line in self._lines(side):
                yield from line.feel(felt)
        if sum(len(trace) for trace in felt.traces) < MOST_DISCOVERY_CELLS // 100:
            return Outcome("nothing found", "no body was touched inside the region")
        base = self._fit(felt)
        for number in range(MOST_DISCOVERY_ROUNDS):
            fresh = []
            for move in self._testing(base, number):
                trace = yield move
                if len(trace):
                    fresh.append(facing(trace, move))
                else:
                    felt.empty.append(empty_at(move.path[len(move.path) // 2], move))
            if not fresh:
                return Outcome("lost", "the fitted surface was not met again", base)
            miss, allowed = self._miss(Trace.concatenate(fresh), base)
            felt.traces.extend(fresh)
            base = self._fit(felt)
            if miss <= allowed:
                tested = replace(base, missed=miss)
                return Outcome("done", f"a {base.kind} that missed the last sweeps by {length_text(miss)}", tested)
        return Outcome("done", f"a {base.kind} that still missed the last sweeps by {length_text(miss)}", base)

    def _lines(self, side: str) -> Iterator[FeltLine]:
        """Lines along the longer way over a side of the box, then some across, to and fro."""
        outward = _outward(side)
        axis, sign = int(np.abs(outward).argmax()), float(outward.sum())
        low, high = np.asarray(self.low, dtype=np.float64), np.asarray(self.high, dtype=np.float64)
        first, second = sorted((i for i in range(3) if i != axis), key=lambda i: low[i] - high[i])
        top = (high if sign > 0 else low)[axis] + sign * self.tip_radius
        for along, across, count in ((first, second, LINES_ALONG), (second, first, LINES_ACROSS)):
            for number in range(count):
                ends = np.zeros((2, 3))
                ends[:, axis] = top
                ends[:, along] = low[along], high[along]
                ends[:, across] = low[across] + (number + 0.5) / count * (high[across] - low[across])
                start, stop = ends[:: 1 if number % 2 == 0 else -1]
                depth = float(high[axis] - low[axis])
                yield FeltLine(start, stop, -outward, depth, self.tip_radius, self.speed, self.force)

    def _fit(self, felt: Felt) -> Base:
        trace = Trace.concatenate(felt.traces)
        cells = Cells.of(trace, MOST_DISCOVERY_CELLS)
        first = fit_base(cells.trace(self.tip_radius, np.ones(len(cells.sweep), dtype=bool)), tested=False)
        height = first.foot(cells.centers, self.tip_radius).height
        # where the ball rolled off the body's edges it does not tell how the body is curved
        kept = cells.trace(self.tip_radius, ~rolled_off(height, cells.sweep, self.tip_radius))
        base = fit_base(kept, spacing=BASE_TRIANGLE_SIZE * self.tip_radius)
        box = np.stack([self.low, self.high])
        outward = np.array([_outward(side) for side in self.sides])
        return touched_part(base, trace, np.concatenate([np.zeros((0, 6)), *felt.empty]), box, outward)

    def _testing(self, base: Base, number: int) -> list[Move]:
        """Some sweeps of a survey, in each round others."""
        survey = Survey(
            base=base, tip_radius=self.tip_radius, smallest=self.smallest, speed=self.speed, force=self.force
        )
        moves = list(survey.sweeps())
        every = max(1, len(moves) // TESTING)
        return moves[(1 + number * max(1, every // 2)) % every :: every]

    def _miss(self, trace: Trace, base: Base) -> tuple[float, float]:
        """Standard deviation of the heights over the base, m, without what stands out; and what is allowed."""
        missed, scatter = base.misses(Cells.of(trace, MOST_DISCOVERY_CELLS).centers, self.tip_radius)
        return missed, max(FORETOLD * scatter, GOOD * self.smallest)


def _outward(side: str) -> FloatArray:
    """Unit vector (3,) that points out of a side of the box, as "+x"."""
    return np.asarray((1.0 if side[0] == "+" else -1.0) * np.eye(3)["xyz".index(side[1])])
