"""Plan: a generator that yields moves, is sent what each move felt, and returns why it ended."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from hw import Move
from mapping import FloatArray, Trace


@dataclass(frozen=True)
class Outcome:
    """Why a plan ended.

    Args:
        reason: a short word: "done", "lost", "budget", "limits", "nothing found", ...
        detail: one sentence for people.
        value: what the plan found, if anything.
    """

    reason: str
    detail: str = ""
    value: Any = field(default=None)


@dataclass(frozen=True, eq=False)
class Refused(Trace):
    """What a plan is sent for a move that was not made: no samples, and why.

    Args:
        reason: one sentence.
        touching: (3,) centre of the ball where it ran into something, m; None: it did not.
    """

    reason: str = ""
    touching: FloatArray | None = None

    @classmethod
    def because(cls, reason: str, tip_radius: float, touching: FloatArray | None = None) -> Refused:
        """Refused for a reason, by a finger with that tip radius (m)."""
        nothing = np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
        return cls(*nothing, tip_radius, reason=reason, touching=touching)


@dataclass(frozen=True, eq=False)
class Parted(Trace):
    """What a plan is sent for a move that was made in parts, or after travel to it: the samples of all of them.

    Args:
        moves: what was made, the travel included.
    """

    moves: tuple[Move, ...] = ()

    @classmethod
    def of(cls, traces: Sequence[Trace], moves: Sequence[Move]) -> Parted:
        """The traces of some parts, joined."""
        whole = Trace.concatenate(traces)
        return cls(**{each.name: getattr(whole, each.name) for each in fields(Trace)}, moves=tuple(moves))


def executed(move: Move, answer: Trace) -> tuple[Move, ...]:
    """What was carried out of a move, by the trace that the plan was sent for it; not the travel to it."""
    return tuple(part for part in made(move, answer) if part is move or part.purpose == move.purpose)


def made(move: Move, answer: Trace) -> tuple[Move, ...]:
    """What the finger did for a move, the travel to it included, by the trace that the plan was sent for it."""
    if isinstance(answer, Parted):
        return answer.moves
    return () if isinstance(answer, Refused) else (move,)


Plan = Generator[Move, Trace, Outcome]
