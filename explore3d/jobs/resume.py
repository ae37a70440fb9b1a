"""Resume: go on where an earlier, broken-off session of the same scene stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from explore3d import EmptyLogError
from explore3d.log import OUTCOME, Log, read_log
from hw import Move
from mapping import Trace

# Between the last sample of the earlier log and the clock's new beginning, s: times must rise
PAUSE = 1e-3
# Reason of an outcome that an exception or a signal brought about
BROKEN_OFF = "broken off"

Execute = Callable[[Move], Trace]


class Replay:
    """Answers the moves that an earlier log holds from the log, all later ones from the finger.

    A plan is a function of what it was sent, so it asks for the same moves again. The last move of a log that
    was not closed in good order may be cut short: it is made again. What it gave before is kept if it gives less now,
    for the machine may fail again, and sooner. What the earlier log holds and the plan does not ask for any more is
    handed over all the same: nothing that was felt is lost.

    Args:
        log: of the earlier session.
    """

    def __init__(self, log: Log) -> None:
        self._moves, self._begun = _moves(log)
        # where samples of a later move follow, the last whole one was not cut short
        self._doubtful = bool(self._moves) and not _ended_well(log) and not len(self._begun)
        self.samples = len(log.trace)
        self.replayed = 0
        self.live = False
        self._sweeps, self._time = 0, PAUSE

    def before(
        self,
        execute: Execute,
        skip: Callable[[Move], None] | None = None,
        keep: Callable[[Move, Trace], None] = lambda move, trace: None,
    ) -> Execute:
        """`execute`, with the earlier log's answers in front of it.

        Args:
            skip: told every move that is answered from the log, by a finger that then keeps count of sweeps and
                time itself, as a simulated one does; without it its sweeps and times are put after the log's.
            keep: handed every move of the earlier log that is not asked for again, with what it gave.
        """

        def resumed(move: Move) -> Trace:
            same = bool(self._moves) and _same(self._moves[0][0], move)
            if same and not (self._doubtful and len(self._moves) == 1):
                self.replayed += 1
                if skip is not None:
                    skip(move)
                return self._passed(self._moves.pop(0)[1])
            before = self._before(same)
            self.rest(keep, skip)  # from the first difference on the plan goes another way
            try:
                trace = execute(move)
            except BaseException:
                if len(before):
                    keep(move, self._passed(before))
                raise
            self.live = True
            if skip is None and len(trace) < len(before):
                keep(move, self._passed(before))
            if skip is not None:
                return trace
            return replace(trace, t=trace.t + self._time, sweep=trace.sweep + self._sweeps)

        return resumed

    def _before(self, same: bool) -> Trace:
        """What the earlier log holds of a move that is made now: the doubtful last one if it is the `same`, else what
        was begun after all that were whole.
        """
        before, self._begun = self._begun, self._begun.select(slice(0, 0))
        if same:
            return self._moves.pop(0)[1]
        return self._begun if self._moves else before

    def rest(self, keep: Callable[[Move, Trace], None], skip: Callable[[Move], None] | None = None) -> None:
        """Hand over what was not asked for again."""
        for move, trace in self._moves:
            keep(move, self._passed(trace))
            if skip is not None:
                skip(move)
        self._moves.clear()

    def _passed(self, trace: Trace) -> Trace:
        """The trace; what the finger feels later counts its sweeps and its time from there on."""
        if len(trace):
            self._sweeps = max(self._sweeps, int(trace.sweep.max()))
            self._time = max(self._time, float(trace.t[-1]) + PAUSE)
        return trace


def replay_of(path: Path) -> Replay | None:
    """The moves of the session whose log that is; None if it was killed before it felt anything: all are made anew.

    Raises:
        UserError: it cannot be read.
    """
    try:
        return Replay(read_log(path))
    except EmptyLogError:
        return None


def _moves(log: Log) -> tuple[list[tuple[Move, Trace]], Trace]:
    """The moves that were made, with what they gave, and what was felt of one that never ended."""
    moves, known = [], 0
    for event in log.events:
        if event.kind != "move":
            continue
        data = event.data
        move = Move(np.array(data["path"]), np.array(data["approach"]), data["speed"], data["force"], data["purpose"])
        first = int(data["first"])
        if first + int(data["samples"]) > len(log.trace):
            break  # what the log lost
        known = first + int(data["samples"])
        moves.append((move, log.trace.select(slice(first, known))))
    return moves, log.trace.select(slice(known, None))


def _ended_well(log: Log) -> bool:
    """True if the plan came to its end: nothing was cut short."""
    reasons = [event.data.get("reason") for event in log.events if event.kind == OUTCOME]
    return bool(reasons) and reasons[-1] not in (BROKEN_OFF, "finger refuses")


def _same(one: Move, other: Move) -> bool:
    return (
        one.purpose == other.purpose
        and one.path.shape == other.path.shape
        and bool(np.allclose(one.path, other.path, rtol=0.0, atol=1e-9))
        and bool(np.allclose(one.approach, other.approach, rtol=0.0, atol=1e-9))
    )
