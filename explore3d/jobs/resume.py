"""Resume: go on where an earlier, broken-off session of the same scene stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from explore3d import UserError
from explore3d.log import LOG, Log, read_log
from hw import Move
from mapping import Trace

# The earlier log under another name, until the new one holds all that it held
EARLIER = "earlier.mcap"
# Between the last sample of the earlier log and the clock's new beginning, s: times must rise
PAUSE = 1e-3

Execute = Callable[[Move], Trace]


class Replay:
    """Answers the moves that an earlier log holds from the log, all later ones from the finger.

    A plan is a function of what it was sent, so it asks for the same moves again. The last move of a log that
    was not closed in good order may be cut short: it is made again.

    Args:
        log: of the earlier session.
    """

    def __init__(self, log: Log) -> None:
        self._moves = _moves(log)
        if not _ended_well(log) and self._moves:
            self._moves.pop()
        self.replayed = 0
        self._sweeps = max((int(t.sweep.max()) for _, t in self._moves if len(t)), default=0)
        self._time = max((float(t.t[-1]) for _, t in self._moves if len(t)), default=0.0) + PAUSE

    def before(self, execute: Execute, skip: Callable[[Move], None] | None = None) -> Execute:
        """`execute`, with the earlier log's answers in front of it.

        Args:
            skip: told every move that is answered from the log, by a finger that then keeps count of sweeps and
                time itself, as a simulated one does; without it its sweeps and times are put after the log's.
        """

        def resumed(move: Move) -> Trace:
            if self._moves and _same(self._moves[0][0], move):
                self.replayed += 1
                if skip is not None:
                    skip(move)
                return self._moves.pop(0)[1]
            self._moves.clear()  # from the first difference on the plan goes another way
            trace = execute(move)
            if skip is not None:
                return trace
            return replace(trace, t=trace.t + self._time, sweep=trace.sweep + self._sweeps)

        return resumed


def earlier_log(folder: Path | str) -> tuple[Log, bytes]:
    """The log to go on from in a session's folder, and its bytes: the one that holds more.

    Raises:
        UserError: there is none.
    """
    paths = [path for name in (LOG, EARLIER) if (path := Path(folder) / name).is_file()]
    if not paths:
        raise UserError(f"{folder}: nothing to resume: no {LOG} in it; leave --resume out")
    logs = []
    for path in paths:
        try:
            logs.append((read_log(path), path))
        except UserError:
            if len(paths) == 1:
                raise
    if not logs:
        raise UserError(f"{folder}: nothing to resume: no log in it holds a sample; leave --resume out")
    log, path = max(logs, key=lambda pair: len(pair[0].trace))
    return log, path.read_bytes()


def _moves(log: Log) -> list[tuple[Move, Trace]]:
    moves = []
    for event in log.events:
        if event.kind != "move":
            continue
        data = event.data
        move = Move(np.array(data["path"]), np.array(data["approach"]), data["speed"], data["force"], data["purpose"])
        first = int(data["first"])
        if first + int(data["samples"]) > len(log.trace):
            break  # what the log lost
        moves.append((move, log.trace.select(slice(first, first + int(data["samples"])))))
    return moves


def _ended_well(log: Log) -> bool:
    """True if the plan came to its end: nothing was cut short."""
    reasons = [event.data.get("reason") for event in log.events if event.kind == "outcome"]
    return bool(reasons) and reasons[-1] != "finger refuses"


def _same(one: Move, other: Move) -> bool:
    return (
        one.purpose == other.purpose
        and one.path.shape == other.path.shape
        and bool(np.allclose(one.path, other.path, rtol=0.0, atol=1e-9))
        and bool(np.allclose(one.approach, other.approach, rtol=0.0, atol=1e-9))
    )
