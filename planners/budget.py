"""Budget: finger time and path that a plan may spend."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from hw import Move
from mapping import Trace
from planners.plan import Outcome, Plan, made


@dataclass
class Spent:
    """Finger time (s) and path (m) of the moves that passed by, ways between sweeps included.

    Args:
        travel_speed: at which the finger is taken to move between sweeps, m/s.
    """

    travel_speed: float
    seconds: float = 0.0
    metres: float = 0.0
    _end: np.ndarray | None = None

    def count(self, move: Move) -> None:
        """Add one move."""
        gap = 0.0 if self._end is None else float(np.linalg.norm(move.path[0] - self._end))
        self._end = move.path[-1]
        self.seconds += move.duration + gap / self.travel_speed
        self.metres += move.length + gap


def within(plan: Plan, spent: Spent, seconds: float, metres: float = np.inf) -> Plan:
    """The plan, ended with the reason "budget" before the first move that would overspend."""
    trace: Trace | None = None
    while True:
        try:
            move = next(plan) if trace is None else plan.send(trace)
        except StopIteration as end:
            return end.value if isinstance(end.value, Outcome) else Outcome("done")
        if spent.seconds + move.duration > seconds or spent.metres + move.length > metres:
            plan.close()
            return Outcome("budget", f"{spent.seconds:.1f} s and {spent.metres:.3f} m of finger path spent")
        trace = yield from _charged(move, spent)


def _charged(move: Move, spent: Spent) -> Generator[Move, Trace, Trace]:
    """Yield a move; what of it was carried out is charged, a refused move is not."""
    before = replace(spent)
    spent.count(move)
    trace = yield move
    done = made(move, trace)
    if done != (move,):
        spent.seconds, spent.metres, spent._end = before.seconds, before.metres, before._end
        for part in done:
            spent.count(part)
    return trace
