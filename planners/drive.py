"""Drive: the loop that carries a plan out, one checked move after another."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice

from hw import FingerError, Move, StoppedError
from mapping import Trace, TraceError
from planners.plan import Outcome, Plan, Refused

# After so many refusals in a row the finger is taken for lost, and the plan for one that cannot be carried out
MOST_REFUSALS, FORBIDDEN = 5, 100

Check = Callable[[Move, Move | None], str | None]


def drive(
    plan: Plan,
    execute: Callable[[Move], Trace],
    *,
    check: Check | None = None,
    note: Callable[[str], None] | None = None,
    refused_move: Callable[[Move, str], None] | None = None,
    empty: Trace | None = None,
) -> tuple[list[tuple[Move, Trace]], Outcome]:
    """Carry the plan out; every executed move with what it felt, and why the plan ended.

    A move that the check forbids, that the finger refuses, or whose readings are unusable gives nothing: the plan
    is sent a planners.Refused in its place and decides what to do without it. The drive gives up if too many in a row
    fail.

    Args:
        plan: the generator.
        execute: carries out one move, for example a Finger's execute followed by a log's write.
        check: what is wrong with a move after the last executed one (None before the first), or None if nothing
            is (planners.paths.limits.Limits.violation).
        note: told about every move that gave nothing for one of these reasons.
        refused_move: told the move itself and the reason, besides.
        empty: a trace without samples, to go on with where even the first move fails; without it that ends the plan.
    """
    record: list[tuple[Move, Trace]] = []
    refused = forbidden = 0
    try:
        move = next(plan)
        while True:
            last = record[-1][0] if record else None
            reason = check(move, last) if check else None
            forbidden = forbidden + 1 if reason else 0
            trace = touching = None
            if reason is None:
                try:
                    trace, refused = execute(move), 0
                except (FingerError, TraceError) as error:
                    reason, refused = str(error), refused + 1
                    touching = error.touching if isinstance(error, StoppedError) else None
            if trace is None:
                if refused_move:
                    refused_move(move, reason or "")
                if note:
                    note(f"{move.purpose} not executed: {reason}" if forbidden else f"{move.purpose} failed: {reason}")
                if refused >= MOST_REFUSALS or forbidden >= FORBIDDEN or (not record and empty is None):
                    plan.close()
                    return record, Outcome("finger refuses", f"{_moves(max(refused, forbidden))} refused: {reason}")
                tip_radius = (empty if empty is not None else record[-1][1]).tip_radius
                trace = Refused.because(reason or "", tip_radius, touching)
            else:
                record.append((move, trace))
            move = plan.send(trace)
    except StopIteration as end:
        outcome = end.value if isinstance(end.value, Outcome) else Outcome("done")
        return record, outcome


def _moves(refused: int) -> str:
    return "the first move was" if refused == 1 else f"{refused} moves in a row were"


def dry_run(plan: Plan, empty: Trace, limit: int = 100_000) -> tuple[list[Move], Outcome]:
    """The moves that the plan would make if nothing were ever felt, at most `limit` of them."""
    moves: list[Move] = []
    try:
        moves.append(next(plan))
        for _ in islice(iter(int, 1), limit - 1):
            moves.append(plan.send(empty))
    except StopIteration as end:
        return moves, end.value
    plan.close()
    return moves, Outcome("budget", f"stopped after {limit} moves")
