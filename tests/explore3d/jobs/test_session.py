"""The session's folder: never half-written, never somebody else's, gone if the input was bad."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from explore3d.errors import FolderError, UserError
from explore3d.jobs.session import Job, Session
from explore3d.log.own.reader import read_log
from hw.move import Move
from mapping.trace import Trace

MOVE = Move([[0, 0, 0], [1, 0, 0]], [0, 0, -1])


def samples(count: int) -> Trace:
    return Trace(np.arange(count), np.ones((count, 3)), np.zeros(count, dtype=int), 0.01)


def contents(folder: Path) -> dict[str, str]:
    """Every file below the folder with its text, apart from the marker, and every empty folder."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.name != "session.json":
            found[path.relative_to(folder).as_posix()] = path.read_text()
        elif path.is_dir() and not any(path.iterdir()):
            found[path.relative_to(folder).as_posix() + "/"] = ""
    return found


def state(folder: Path) -> str:
    return str(json.loads((folder / "session.json").read_text())["state"])


def test_making_a_session_touches_nothing_until_it_is_entered(tmp_path: Path) -> None:
    Session(tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_a_session_ends_with_its_files_and_is_marked_complete(tmp_path: Path) -> None:
    with Session(tmp_path / "a" / "b") as session:
        assert state(session.folder) == "running"
        session.write("model.json", "{}")
        session.write("pictures/top.png", b"png")
        with session.staging() as folder:
            (folder / "x").mkdir()
            (folder / "x" / "y.txt").write_text("y")
            (folder / "z.txt").write_text("z")
    assert contents(tmp_path / "a" / "b") == {
        "model.json": "{}",
        "pictures/top.png": "png",
        "x/y.txt": "y",
        "z.txt": "z",
    }
    assert state(tmp_path / "a" / "b") == "complete"
    assert set(session.files) == {"model.json", "pictures/top.png", "x/y.txt", "z.txt"}


def test_an_earlier_session_is_replaced_and_other_files_are_left_alone(tmp_path: Path) -> None:
    with Session(tmp_path / "out") as session:
        session.write("old.txt", "old")
        session.write("both.txt", "old")
    (tmp_path / "out" / "notes.md").write_text("mine")
    with Session(tmp_path / "out") as session:
        session.write("both.txt", "new")
    assert contents(tmp_path / "out") == {"both.txt": "new", "notes.md": "mine"}


def test_a_folder_of_somebody_else_is_refused_untouched(tmp_path: Path) -> None:
    for name in ("thesis.tex", "session.json"):
        (tmp_path / name).write_text('{"schema": "other"}')
        with pytest.raises(FolderError, match=r"not an explore3d session \(.*(thesis|session)"), Session(tmp_path):
            pass
    assert {path.name for path in tmp_path.iterdir()} == {"thesis.tex", "session.json"}


def test_a_file_of_somebody_else_in_an_earlier_session_is_never_overwritten(tmp_path: Path) -> None:
    with Session(tmp_path / "out") as session:
        session.write("old.txt", "old")
    (tmp_path / "out" / "model.json").write_text("mine")
    with pytest.raises(FolderError, match=r"model\.json: is in the way"), Session(tmp_path / "out") as session:
        session.write("model.json", "ours")
    assert contents(tmp_path / "out") == {"old.txt": "old", "model.json": "mine"}


def test_bad_input_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="bad"), Session(tmp_path / "a" / "b") as session:
        session.open_log(tip_radius=0.01)
        session.write("pictures/top.png", b"png")
        raise UserError("bad input")
    assert list(tmp_path.iterdir()) == []


def test_bad_input_leaves_an_empty_folder_empty_and_an_earlier_session_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError), Session(tmp_path / "empty") as session:
        session.write("a.txt", "a")
        raise UserError("bad input")
    assert list((tmp_path / "empty").iterdir()) == []
    with Session(tmp_path / "out") as session:
        session.write("pictures/old.txt", "old")
        session.open_log(tip_radius=0.01).write(MOVE, samples(3))
    before = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
    with pytest.raises(UserError), Session(tmp_path / "out") as session:
        session.write("pictures/new.txt", "new")
        session.write("other/new.txt", "new")
        raise UserError("bad input")
    assert {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()} == before
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"session.json", "log.mcap", "pictures"}


def test_a_failed_run_keeps_what_the_finger_felt(tmp_path: Path) -> None:
    for name, error in (("a", UserError("disk full")), ("b", RuntimeError("lost")), ("c", KeyboardInterrupt())):
        with pytest.raises(type(error)), Session(tmp_path / name) as session:
            session.open_log(tip_radius=0.01).write(MOVE, samples(7))
            raise error
        log = read_log(tmp_path / name / "log.mcap")
        assert len(log.trace) == 7 and log.complete
        assert state(tmp_path / name) == "stopped"
        assert "kept: " in error.__notes__[-1]


def test_a_file_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), Session(tmp_path / "out") as session, session.staging() as folder:
        (folder / "model.json").write_text('{"features": [')
        assert not (session.folder / "model.json").exists()
        raise RuntimeError("in the middle")
    assert contents(tmp_path / "out") == {}


def test_a_log_in_the_folder_can_be_analysed_into_the_same_folder(tmp_path: Path) -> None:
    with Session(tmp_path / "out") as session:
        session.open_log(tip_radius=0.01).write(MOVE, samples(7))
        session.write("report.html", "old")
    log = tmp_path / "out" / "log.mcap"
    for number in range(2):
        with Session(tmp_path / "out", keep=[log]) as session:
            assert len(read_log(log).trace) == 7
            assert (tmp_path / "out" / "report.html").exists() is (number == 0)  # until the new one is complete
            session.write("model.json", str(number))
    with pytest.raises(UserError), Session(tmp_path / "out", keep=[log]) as session:
        raise UserError("bad input")
    assert len(read_log(log).trace) == 7 and (tmp_path / "out" / "model.json").read_text() == "1"
    with Session(tmp_path / "out") as session:  # it is still known as ours, and replaced by another run
        session.open_log(tip_radius=0.01).write(MOVE, samples(2))
    assert len(read_log(log).trace) == 2


def test_two_sessions_cannot_write_into_one_folder(tmp_path: Path) -> None:
    with Session(tmp_path / "out") as session:
        session.write("a.txt", "first")
        with pytest.raises(FolderError, match="another session"), Session(tmp_path / "out"):
            pass
        assert contents(tmp_path / "out") == {"a.txt": "first"}
    with Session(tmp_path / "out"):
        assert contents(tmp_path / "out") == {"a.txt": "first"}  # it stays until the new one is complete
    assert contents(tmp_path / "out") == {}


def test_a_killed_session_keeps_its_log_and_can_be_replaced(tmp_path: Path) -> None:
    script = f"""
        import sys, time
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from test_session import MOVE, samples
        from explore3d.jobs.session import Job, Session
        with Session({str(tmp_path / "out")!r}) as session:
            session.open_log(tip_radius=0.01).write(MOVE, samples(9))
            with session.staging() as folder:
                (folder / "half.txt").write_text("half")
                print("ready", flush=True)
                time.sleep(60)
    """
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])}
    run = [sys.executable, "-c", textwrap.dedent(script)]
    process = subprocess.Popen(run, stdout=subprocess.PIPE, env=environment)
    assert process.stdout is not None and process.stdout.readline() == b"ready\n"
    process.send_signal(signal.SIGKILL)
    process.stdout.close()
    process.wait()
    assert state(tmp_path / "out") == "running" and not (tmp_path / "out" / "half.txt").exists()
    assert len(read_log(tmp_path / "out" / "log.mcap").trace) == 9
    with Session(tmp_path / "out") as session:
        assert len(read_log(tmp_path / "out" / "log.mcap").trace) == 9
        session.open_log(tip_radius=0.01).write(MOVE, samples(1))
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"session.json", "log.mcap"}


def older(folder: Path) -> dict[str, str]:
    """A whole session with a file of somebody else beside it."""
    with Session(folder) as session:
        session.write("old.txt", "old")
        session.write("both.txt", "old")
    (folder / "notes.md").write_text("mine")
    return contents(folder)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), SystemExit(143), RuntimeError("lost"), UserError("bad")])
def test_whatever_ends_a_session_the_older_one_stays(tmp_path: Path, error: BaseException) -> None:
    before, marker = older(tmp_path), (tmp_path / "session.json").read_bytes()
    with pytest.raises(type(error)), Session(tmp_path) as session:
        session.write("both.txt", "new")
        session.open_log(tip_radius=0.01).write(MOVE, samples(4))
        raise error
    assert {name: (tmp_path / name).read_text() for name in before} == before
    assert (tmp_path / "session.json").read_bytes() == marker
    assert len(read_log(tmp_path / "unfinished-1" / "log.mcap").trace) == 4
    assert str(tmp_path / "unfinished-1" / "log.mcap") in error.__notes__[-1]


@pytest.mark.parametrize("steps", range(8))
def test_a_kill_in_the_midst_of_the_exchange_is_finished_by_the_next_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, steps: int
) -> None:
    older(tmp_path)
    left = [steps]

    def mortal(real: Callable[..., None]) -> Callable[..., None]:
        def call(*given: object, **options: object) -> None:
            left[0] -= committing[0]
            if left[0] < 0:
                raise Killed
            real(*given, **options)

        return call

    committing = [0]
    with suppress(Killed), Session(tmp_path) as session:
        session.write("both.txt", "new")
        session.write("pictures/new.txt", "new")
        committing[0] = 1
        for name in ("rename", "replace", "unlink", "rmdir"):
            monkeypatch.setattr(os, name, mortal(getattr(os, name)))
    monkeypatch.undo()
    assert (tmp_path / "notes.md").read_text() == "mine"
    with suppress(UserError), Session(tmp_path):
        now = {name: text for name, text in contents(tmp_path).items() if not name.startswith("unfinished")}
        raise UserError("look only")
    whole = {"both.txt": "new", "pictures/new.txt": "new", "notes.md": "mine"}
    assert now in (whole, {"both.txt": "old", "old.txt": "old", "notes.md": "mine"})
    assert steps < 2 or now == whole


class Killed(BaseException):
    """A kill: nothing of the program runs after it."""


def test_another_subject_needs_overwrite(tmp_path: Path) -> None:
    with Session(tmp_path, Job("run", "one")) as session:
        session.write("a.txt", "one")
    for other in (Job("run", "two"), Job("analyze", "one")):
        with pytest.raises(FolderError, match="--overwrite"), Session(tmp_path, other):
            pass
    assert contents(tmp_path) == {"a.txt": "one"}
    with Session(tmp_path, Job("run", "two"), overwrite=True) as session:
        session.write("b.txt", "two")
    assert contents(tmp_path) == {"b.txt": "two"}


# --- folders that cannot be written ---------------------------------------------------------------------


def unwritable(path: Path) -> None:
    start = time.monotonic()
    with pytest.raises(FolderError) as error, Session(path):
        pass
    assert str(path) in str(error.value) and "\n" not in str(error.value)
    assert time.monotonic() - start < 1


def test_a_file_in_the_way_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    unwritable(tmp_path / "file")
    unwritable(tmp_path / "file" / "below")
    assert (tmp_path / "file").read_text() == "x"


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs /proc")
def test_a_place_where_no_folder_can_be_made_is_refused() -> None:
    unwritable(Path("/proc/explore3d"))
    unwritable(Path("/proc/explore3d/a/b"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_refused(tmp_path: Path) -> None:
    (tmp_path / "shut").mkdir(mode=0o555)
    unwritable(tmp_path / "shut")
    unwritable(tmp_path / "shut" / "a" / "b")
    assert list((tmp_path / "shut").iterdir()) == []


def test_a_name_too_long_for_the_disk_leaves_nothing(tmp_path: Path) -> None:
    unwritable(tmp_path / "new" / ("x" * 300))
    assert list(tmp_path.iterdir()) == []


def test_a_marker_cannot_send_the_next_session_after_files_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("precious")
    with Session(tmp_path / "out"):
        pass
    record = json.loads((tmp_path / "out" / "session.json").read_text())
    record["files"] = ["../precious.txt", str(tmp_path / "precious.txt")]
    (tmp_path / "out" / "session.json").write_text(json.dumps(record))
    with Session(tmp_path / "out"):
        pass
    assert (tmp_path / "precious.txt").read_text() == "precious"
