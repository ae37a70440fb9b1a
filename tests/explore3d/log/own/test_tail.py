"""LogTail: a log is followed while it grows, and gives in pieces what read_log gives in one."""

import os
from pathlib import Path

import numpy as np
import pytest
from sample_logs import MOVE, RADIUS, assert_same_samples, trace_of, write_log

from explore3d.log.own.reader import read_log
from explore3d.log.own.tail import LogTail, Piece, is_whole, newest_log
from explore3d.log.own.writer import LogWriter


def times(pieces: list[Piece]) -> np.ndarray:
    return np.concatenate([piece.samples["t"] for piece in pieces]) if pieces else np.zeros(0)


def test_what_a_log_grows_by_comes_once_and_in_order(tmp_path: Path) -> None:
    tail, seen, moves = LogTail(tmp_path / "log.mcap"), [], 0
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS, scene_text='title = "x"\n') as log:
        for number in range(5):
            log.write(MOVE, trace_of(number * 700, 700, number))
            pieces, events, anew = tail.look()
            assert anew == (number == 0)
            assert [len(piece.samples) for piece in pieces] == [700]
            assert pieces[0].move is not None and pieces[0].move.data["first"] == number * 700
            seen, moves = seen + pieces, moves + sum(event.kind == "move" for event in events)
        assert tail.look() == ([], [], False)
        assert not tail.closed
    tail.look()
    assert (tail.closed, tail.title, tail.tip_radius, moves) == (True, "x", RADIUS, 5)
    np.testing.assert_array_equal(times(seen), read_log(tmp_path / "log.mcap").trace.t)


@pytest.mark.parametrize("step", [977, 20011])
def test_a_half_written_chunk_waits_for_its_rest(tmp_path: Path, step: int) -> None:
    whole = write_log(tmp_path / "whole.mcap").read_bytes()
    growing = tmp_path / "log.mcap"
    growing.touch()
    tail, seen, events = LogTail(growing), [], []
    for end in [*range(step, len(whole), step), len(whole)]:
        with growing.open("ab") as file:
            file.write(whole[file.tell() : end])
        pieces, noted, _ = tail.look()
        seen, events = seen + pieces, events + noted
    log = read_log(tmp_path / "whole.mcap")
    np.testing.assert_array_equal(times(seen), log.trace.t)
    assert events == list(log.events)


def test_samples_of_a_move_under_way_are_shown_and_come_again_with_it(tmp_path: Path) -> None:
    tail = LogTail(tmp_path / "log.mcap")
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        log.felt(trace_of(0, 30))
        (piece,), _, _ = tail.look()
        assert piece.under_way and len(piece.samples) == 30
        log.felt(trace_of(30, 20))
        (piece,), _, _ = tail.look()
        assert piece.under_way and len(piece.samples) == 50
        log.write(MOVE, trace_of(0, 60))
        (piece,), _, _ = tail.look()
        assert not piece.under_way
        np.testing.assert_array_equal(piece.samples["t"], trace_of(0, 60).t)


def test_a_moved_log_goes_on_and_another_one_begins_anew(tmp_path: Path) -> None:
    (tmp_path / "unfinished-1").mkdir()
    log = LogWriter(tmp_path / "unfinished-1" / "log.mcap", tip_radius=RADIUS)
    log.write(MOVE, trace_of(0, 10))
    tail = LogTail(newest_log(tmp_path) or "")
    tail.look()
    log.move_to(tmp_path / "log.mcap")
    log.write(MOVE, trace_of(10, 10))
    with pytest.raises(FileNotFoundError):
        tail.look()
    tail.path = newest_log(tmp_path) or Path()
    pieces, _, anew = tail.look()
    assert not anew
    np.testing.assert_array_equal(times(pieces), trace_of(10, 10).t)
    assert not is_whole(tail.path)
    log.close()
    assert is_whole(tail.path)
    write_log(tmp_path / "other.mcap", moves=1, count=5)
    os.replace(tmp_path / "other.mcap", tail.path)
    pieces, _, anew = tail.look()
    assert anew and len(pieces[0].samples) == 5
    assert_same_samples(read_log(tail.path).trace, np.arange(5))
