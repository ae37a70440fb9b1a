"""Drive: the loop that carries a plan out, one checked move after another."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice

from hw.errors import FingerError
from hw.moves import Move
from mapping.trace import Trace
from planners.plan import Outcome, Plan

# After so many refusals in a row the finger is taken for lost
PATIENCE = 5


def drive(
    plan: Plan,
    execute: Callable[[Move], Trace],
    *,
    check: Callable[[Move], str | None] | None = None,
    note: Callable[[str], None] | None = None,
) -> tuple[list[tuple[Move, Trace]], Outcome]:
    """Carry the plan out; every executed move with what it felt, and why the plan ended.

    A move that the check forbids or the finger refuses is not executed: the plan is sent an empty trace in
    its place and decides what to do without it. The drive gives up if the first move is refused, or too many
    in a row are.

    Args:
        plan: the generator.
        execute: carries out one move, for example a Finger's execute followed by a log's write.
        check: what is wrong with a move, or None if nothing is (planners.checks.Limits.violation).
        note: told about every move that was not executed.
    """
    record: list[tuple[Move, Trace]] = []
    refused = 0
    try:
        move = next(plan)
        while True:
            reason = check(move) if check else None
            try:
                trace = None if reason else execute(move)
            except FingerError as error:
                reason, trace = str(error), None
            if trace is None:
                refused += 1
                if note:
                    note(f"{move.purpose} not executed: {reason}")
                if refused >= PATIENCE or not record:
                    plan.close()
                    return record, Outcome("finger refuses", f"{_moves(refused)} refused: {reason}")
                trace = record[-1][1].select(slice(0, 0))
            else:
                refused = 0
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
