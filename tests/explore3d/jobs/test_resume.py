"""Resuming: what was felt is not felt again, what was cut short is, and nothing is lost on the way."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from explore3d.errors import FolderError
from explore3d.jobs.resume import Replay, replay_of
from explore3d.jobs.session import Session
from explore3d.log.own.reader import read_log
from explore3d.log.own.writer import LogWriter
from hw.move import Move
from hw.simulated.finger import SimulatedFinger
from mapping.surface import Surface
from mapping.trace import Trace
from planners.drive import drive
from planners.plan import Outcome, Plan

R = 0.01


def finger() -> SimulatedFinger:
    corners = 0.1 * np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    return SimulatedFinger(object=Surface(corners, [[0, 1, 2], [0, 2, 3]]), tip_radius=R, rate=200.0)


def plan(count: int = 8) -> Plan:
    """Each sweep lies where the one before it ended: the plan depends on what it is sent."""
    y = 0.02
    for _ in range(count):
        path = np.array([[0.02, y, R], [0.05, y, R]])
        trace = yield Move(path, np.array([0.0, 0.0, -1.0]))
        y += 0.1 * float(trace.centers[-1, 0])
    return Outcome("done")


def logged(execute: Callable[[Move], Trace], log: LogWriter) -> Callable[[Move], Trace]:
    def both(move: Move) -> Trace:
        trace = execute(move)
        log.write(move, trace)
        return trace

    return both


def broken_off(path: Path, after: int, outcome: str = "") -> None:
    """A log of a session that ended after so many moves."""
    with LogWriter(path, tip_radius=R) as log:
        drive(plan(after), logged(finger().execute, log))
        if outcome:
            log.event("outcome", {"reason": outcome, "detail": ""})


def test_the_resumed_session_feels_what_the_whole_one_would_have_felt(tmp_path: Path) -> None:
    broken_off(tmp_path / "log.mcap", 5)
    replay, live = Replay(read_log(tmp_path / "log.mcap")), finger()
    made = []

    def execute(move: Move) -> Trace:
        made.append(move)
        return live.execute(move)

    record, outcome = drive(plan(), replay.before(execute))
    whole, _ = drive(plan(), finger().execute)
    assert outcome.reason == "done"
    assert replay.replayed == 4 and len(made) == 4  # the fifth may have been cut short: it is made again
    for (_, one), (_, other) in zip(record, whole, strict=True):
        assert np.allclose(one.centers, other.centers, atol=1e-12)
    trace = Trace.concatenate([trace for _, trace in record])
    assert (np.diff(trace.t) > 0).all()
    assert np.unique(trace.sweep).tolist() == list(range(1, 9))


@pytest.mark.parametrize("after", [2, 5, 7])
def test_a_resumed_simulation_has_the_noise_and_the_time_of_the_whole_one(tmp_path: Path, after: int) -> None:
    noisy = replace(finger(), white=1e-4, correlated=1e-5)
    whole, _ = drive(plan(), noisy.execute)
    with LogWriter(tmp_path / "log.mcap", tip_radius=R) as log:
        drive(plan(after), logged(replace(finger(), white=1e-4, correlated=1e-5).execute, log))
    again = replace(finger(), white=1e-4, correlated=1e-5)
    record, _ = drive(plan(), Replay(read_log(tmp_path / "log.mcap")).before(again.execute, again.skip))
    assert len(record) == len(whole) == 8
    for (_, one), (_, other) in zip(record, whole, strict=True):
        assert np.allclose(one.centers, other.centers, atol=1e-9) and np.allclose(one.t, other.t, atol=1e-9)
        assert (one.sweep == other.sweep).all()


def test_a_finished_session_is_replayed_whole_and_moves_nothing(tmp_path: Path) -> None:
    broken_off(tmp_path / "log.mcap", 8, "done")

    def refuse(move: Move) -> Trace:
        raise AssertionError("moved")

    replay = Replay(read_log(tmp_path / "log.mcap"))
    drive(plan(), replay.before(refuse))
    assert replay.replayed == 8


def test_from_the_first_difference_on_the_finger_moves(tmp_path: Path) -> None:
    broken_off(tmp_path / "log.mcap", 5)
    replay, made = Replay(read_log(tmp_path / "log.mcap")), []

    def other() -> Plan:
        yield Move(np.array([[0.02, 0.02, R], [0.05, 0.02, R]]), np.array([0.0, 0.0, -1.0]))
        for _ in range(3):
            yield Move(np.array([[0.02, 0.09, R], [0.05, 0.09, R]]), np.array([0.0, 0.0, -1.0]))
        return Outcome("done")

    live = finger()
    drive(other(), replay.before(lambda move: made.append(move) or live.execute(move)))  # type: ignore[func-returns-value]
    assert replay.replayed == 1 and len(made) == 3


def test_what_the_plan_does_not_ask_for_again_is_handed_over(tmp_path: Path) -> None:
    broken_off(tmp_path / "log.mcap", 5)
    log = read_log(tmp_path / "log.mcap")
    replay, kept = Replay(log), list[Trace]()

    def other() -> Plan:
        yield Move(np.array([[0.02, 0.02, R], [0.05, 0.02, R]]), np.array([0.0, 0.0, -1.0]))
        yield Move(np.array([[0.02, 0.09, R], [0.05, 0.09, R]]), np.array([0.0, 0.0, -1.0]))
        return Outcome("done")

    record, _ = drive(other(), replay.before(finger().execute, keep=lambda move, trace: kept.append(trace)))
    assert replay.replayed == 1 and replay.live and len(kept) == 4
    everything = [record[0][1], *kept, record[1][1]]
    assert sum(map(len, everything)) == len(log.trace) + len(record[1][1])
    assert [int(trace.sweep[0]) for trace in everything] == [1, 2, 3, 4, 5, 6]
    assert (np.diff(Trace.concatenate(everything).t) > 0).all()


@pytest.mark.parametrize("ends_better", [False, True])
def test_what_was_felt_of_a_sweep_is_kept_unless_it_is_felt_again(tmp_path: Path, ends_better: bool) -> None:
    first, cut_short = finger(), list[Trace]()
    with LogWriter(tmp_path / "log.mcap", tip_radius=R) as log:

        def killed_in_the_third(move: Move) -> Trace:
            trace = first.execute(move)
            if int(trace.sweep[0]) < 3:
                log.write(move, trace)
                return trace
            cut_short.append(trace.select(slice(0, 50)))
            log.felt(cut_short[0])
            raise KeyboardInterrupt

        with suppress(KeyboardInterrupt):
            drive(plan(), killed_in_the_third)
    replay, kept, live = Replay(read_log(tmp_path / "log.mcap")), list[Trace](), finger()

    def fails(move: Move) -> Trace:
        if not ends_better:
            raise KeyboardInterrupt
        return live.execute(move)

    with suppress(KeyboardInterrupt):
        drive(plan(), replay.before(fails, keep=lambda move, trace: kept.append(trace)))
    assert replay.replayed == 2  # the second one was whole, for a third had begun
    assert len(kept) == (0 if ends_better else 1)
    assert ends_better or np.array_equal(kept[0].centers, cut_short[0].centers)


def test_a_sweep_that_gives_less_than_before_is_kept_both_times(tmp_path: Path) -> None:
    broken_off(tmp_path / "log.mcap", 3)
    replay, kept, live = Replay(read_log(tmp_path / "log.mcap")), list[Trace](), finger()

    def cut_short(move: Move) -> Trace:
        return live.execute(move).select(slice(0, 10))

    record, _ = drive(plan(3), replay.before(cut_short, keep=lambda move, trace: kept.append(trace)))
    assert len(kept) == 1 and len(record[2][1]) == 10 < len(kept[0])
    assert [int(trace.sweep[0]) for trace in (kept[0], record[2][1])] == [3, 4]
    assert record[2][1].t[0] > kept[0].t[-1]


def test_a_session_that_was_killed_before_it_felt_anything_begins_anew(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log.mcap", tip_radius=R) as log:
        travel = Move(np.array([[0.02, 0.02, 3 * R]]), np.array([0.0, 0.0, -1.0]), purpose="travel")
        log.write(travel, finger().execute(travel))
    assert replay_of(tmp_path / "log.mcap") is None
    broken_off(tmp_path / "felt.mcap", 3)
    replay = replay_of(tmp_path / "felt.mcap")
    assert replay is not None and replay.samples > 0


def test_a_folder_without_a_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FolderError, match="nothing to resume"), Session(tmp_path / "out", resume=True):
        pass
    assert not (tmp_path / "out").exists()


def test_the_unfinished_session_with_the_larger_log_is_gone_on_from(tmp_path: Path) -> None:
    for count in (0, 3, 5, 2):  # the first one is whole
        with suppress(KeyboardInterrupt), Session(tmp_path) as session:
            log = session.open_log(tip_radius=R)
            drive(plan(max(count, 1)), logged(finger().execute, log))
            if count:
                raise KeyboardInterrupt
    with Session(tmp_path, resume=True) as session:
        assert session.source == tmp_path / "unfinished-2" / "log.mcap"
        replay = Replay(read_log(session.source))
        log = session.open_log(tip_radius=R)
        drive(plan(), logged(replay.before(finger().execute), log))
        assert len({int(sweep) for sweep in read_log(session.source).trace.sweep}) == 5  # until the new one holds all
        session.settle()
        assert len({int(sweep) for sweep in read_log(session.source).trace.sweep}) == 8
    assert len({int(sweep) for sweep in read_log(tmp_path / "log.mcap").trace.sweep}) == 8
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "log.mcap",
        "session.json",
        "unfinished-1",
        "unfinished-3",
    ]
