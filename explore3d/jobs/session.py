"""Session: the output folder of one job. What it makes grows beside an older session and takes its place when whole.

    out/                a session that is whole: session.json and the files that it lists
    out/unfinished-1/   a later one that grows, or that ended early; numbered, never written over
    out/.part-commit/   a later one that is whole and is taking its place: whoever comes next finishes that

Where there is no older session, the new one grows in `out` itself. A rename of its folder decides; everything after it
can be repeated, so a kill at any moment leaves the old session or, once somebody finished it, the new one.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any

from explore3d import FolderError, UserError, __version__
from explore3d.log import LOG, Recorder, digest
from hw import SIGNALS

MARKER = "session.json"
SESSION_SCHEMA = "explore3d/session/1"
UNFINISHED = "unfinished-"
_PART = ".part-"
_COMMIT = ".part-commit"


@dataclass(frozen=True)
class Job:
    """What a session is of.

    Args:
        name: of the command.
        subject: what it works on, as a digest: a session of another subject is replaced only if that is asked for.
        replaces: commands whose session it may replace, whatever it is of: it holds nothing that cannot be made again.
        go_on: the command that goes on with it where it ended early.
        again: the command that begins it again, where nothing was recorded.
        reads: files that its scene names: the session's own scene may name them where they are, while they stay as
            they were (`unchanged_files`).
    """

    name: str = ""
    subject: str = ""
    replaces: tuple[str, ...] = ()
    go_on: str = ""
    again: str = ""
    reads: tuple[Path, ...] = ()

    def may_replace(self, earlier: dict[str, Any]) -> bool:
        """True if a session with that record is an earlier one of the same, or nothing is lost with it."""
        same = earlier.get("subject") == self.subject and earlier.get("job") == self.name
        return same or earlier.get("job") in self.replaces


class Session:
    """A folder that is filled while the `with` block runs.

    The folder may be new, empty, or hold an earlier session; that stays as it is, bit for bit, until this one is whole.
    Files that are nobody's session stay where they are. Files appear whole: they are written beside their place and
    renamed. If the block ends in an error, the log is kept if it holds a sample, and the error gets notes saying how
    far the job was (`reached`), where the log is and how to go on; else everything is as it was before.

    Args:
        folder: where the results belong.
        job: what it is.
        keep: files of an earlier session in that folder that this one reads, its log for example: they stay, and the
            session stays what it was, with new results.
        overwrite: replace an earlier session of something else, too.
        resume: go on with one that ended early; its log is `source`.

    Raises:
        FolderError: (on entering) the path is a file, holds files that are not ours or a session of something else,
            is in use by another session, holds nothing to go on with, or cannot be written.
    """

    def __init__(
        self,
        folder: Path | str,
        job: Job | None = None,
        *,
        keep: Sequence[Path | str] = (),
        overwrite: bool = False,
        resume: bool = False,
    ) -> None:
        self.folder = self.place = Path(folder)
        self.job = Job() if job is None else job
        self.source: Path | None = None
        self.stopped = ""
        # How far the job is when an error ends it, in words. Asked on leaving, whatever the job was at: a signal may
        # come between any two of its statements
        self.reached: Callable[[BaseException], str] = lambda error: ""
        self._keep = {Path(path).resolve() for path in keep}
        self._overwrite, self._resume = overwrite, resume
        self._earlier: dict[str, Any] | None = None
        self._files: list[str] = []
        self._stale: list[str] = []
        self._made: list[Path] = []
        self._goes_on_in_place = False
        self._log: Recorder | None = None
        self._started = datetime.now(UTC)
        self._reads = {str(path): digest(path) for path in self.job.reads}
        self._lock: int | None = None

    def __enter__(self) -> Session:
        self._refuse_foreign()
        try:
            self._make()
            self._lock_folder()
            self._finish_commit()
            self._earlier = _record(self.folder)
            self._refuse_other()
            self._choose_place()
            self._mark("running")
        except OSError as error:
            self._withdraw()
            raise FolderError(f"{self.folder}: cannot write the output folder: {error.strerror or error}") from error
        except FolderError:
            self._withdraw()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        with undisturbed():
            try:
                if error is None:
                    self._conclude()
                else:
                    self._break_off(error)
            except OSError as fault:
                what = f"{self.folder}: cannot finish the output folder: {fault.strerror or fault}"
                failed = FolderError(what)
                failed.add_note(self._kept())
                raise failed from fault
            finally:
                self._unlock()

    @property
    def files(self) -> tuple[str, ...]:
        """Names of what has been written so far, relative to the folder."""
        return tuple(self._files)

    @property
    def holds_samples(self) -> bool:
        """True if there is a log that must not be lost: the one being written, or the one whose place it takes."""
        return bool(self._log is not None and self._log.samples) or self._goes_on_in_place

    def open_log(self, **settings: Any) -> Recorder:
        """The session's log, closed with the session; `settings` as for Recorder.

        Where an earlier log is gone on with, the new one grows beside it until `settle`.

        Raises:
            FolderError: the disk does not take it.
        """
        try:
            self._note(LOG)
        except OSError as error:
            raise FolderError(f"{self.place}: cannot write: {error.strerror or error}") from error
        self._log = Recorder(self.place / (_PART + LOG if self._goes_on_in_place else LOG), **settings)
        return self._log

    def settle(self) -> None:
        """Put the log in the place of the one that it goes on with: it holds everything that that one held."""
        if self._log is not None and self._log.path.name != LOG:
            self._log.move_to(self.place / LOG)

    def write(self, name: str, content: str | bytes) -> Path:
        """A whole file of that name (it may have folders), with that content.

        Raises:
            FolderError: it cannot be written.
        """
        with self.staging() as staging:
            path = staging / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        return self.place / name

    @contextmanager
    def staging(self) -> Iterator[Path]:
        """An empty folder to fill; when the block ends well, each file in it moves to its place in the session.

        Raises:
            FolderError: the disk does not take it.
        """
        try:
            with tempfile.TemporaryDirectory(prefix=_PART, dir=self.place) as name:
                yield Path(name)
                for path in sorted(Path(name).rglob("*")):
                    if path.is_file():
                        self._place_file(path, path.relative_to(name))
        except OSError as error:
            place = error.filename or self.place
            raise FolderError(f"{place}: cannot write: {error.strerror or error}") from error

    def _place_file(self, path: Path, name: Path) -> None:
        with path.open("rb") as file:
            os.fsync(file.fileno())
        target = self.place / name
        target.parent.mkdir(parents=True, exist_ok=True)
        self._note(name.as_posix())
        os.replace(path, target)

    def _note(self, name: str) -> None:
        """Claim a name before its file appears, so that even a killed session's files are known as ours."""
        if name in self._stale:
            self._stale.remove(name)
        if name not in self._files:
            old = [] if self._earlier is None else self._earlier["files"]
            for place in {self.folder, self.place}:
                if (place / name).exists() and not (place == self.folder and name in old):
                    raise FolderError(f"{place / name}: is in the way and not ours; move it or choose another --out")
            self._files.append(name)
            self._mark("running")

    # entering

    def _refuse_foreign(self) -> None:
        """Refuse a folder that is not ours to fill, before anything in it is touched."""
        try:
            names = sorted(path.name for path in self.folder.iterdir() if not path.name.startswith(_PART))
        except FileNotFoundError:
            return
        except OSError as error:
            raise FolderError(f"{self.folder}: cannot be the output folder: {error.strerror}") from error
        if names and _record(self.folder) is None and not (self.folder / _COMMIT).is_dir():
            some = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
            raise FolderError(
                f"{self.folder}: holds files that are not an explore3d session ({some}); "
                "choose a new or empty folder with --out"
            )

    def _make(self) -> None:
        missing = [path for path in (self.folder, *self.folder.parents) if not path.exists()]
        for path in reversed(missing):
            path.mkdir()
            self._made.append(path)

    def _lock_folder(self) -> None:
        if os.name != "posix":  # elsewhere a folder cannot be opened: sessions there are not kept apart
            return
        self._lock = os.open(self.folder, os.O_RDONLY)
        if not locked(self._lock):
            raise FolderError(f"{self.folder}: another session is writing there; choose another --out")

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _refuse_other(self) -> None:
        """Refuse to replace a session of something else."""
        earlier = self._earlier
        if earlier is None or self._overwrite or self._own(earlier) or self.job.may_replace(earlier):
            return
        of_another = "of another input" if earlier.get("job") == self.job.name else "of another command"
        raise FolderError(
            f"{self.folder}: holds a session of explore3d {earlier.get('job') or '(unknown)'}, {of_another}; choose "
            "another --out, or give --overwrite to replace it as soon as the new one is complete"
        )

    def _own(self, earlier: dict[str, Any]) -> list[str]:
        """Names of the earlier session's files that are kept."""
        return [name for name in earlier["files"] if (self.folder / name).resolve() in self._keep]

    def _choose_place(self) -> None:
        """Where to grow: in the folder if it is free, in the one that is gone on with, else in a numbered one."""
        self._sweep()
        if self._resume:
            self.source = self._find_source()
            place = self.source.parent
            record = _record(place) or {}
            if record.get("state") != "complete":
                self.place, self._goes_on_in_place = place, True
                self._files = [name for name in record["files"] if _inside(place, name)]
                self._stale = [name for name in self._files if name != LOG]
                return
        if self._earlier is None:
            return
        number = 1
        while (self.folder / f"{UNFINISHED}{number}").exists():
            number += 1
        self.place = self.folder / f"{UNFINISHED}{number}"
        self.place.mkdir()

    def _find_source(self) -> Path:
        """The log to go on with: the largest of the unfinished sessions of the same, else that of the finished one."""
        places = [self.folder, *self.folder.glob(UNFINISHED + "*")]
        found = [(record, place) for place in places if (record := _record(place)) and (place / LOG).is_file()]
        same = [(record, place) for record, place in found if self.job.may_replace(record)]
        if not same:
            why = f"no {LOG} in it is of this scene" if found else f"no {LOG} in it"
            raise FolderError(f"{self.folder}: nothing to resume: {why}; leave --resume out")
        _, place = max(same, key=lambda pair: (pair[0]["state"] != "complete", (pair[1] / LOG).stat().st_size))
        return place / LOG

    def _sweep(self) -> None:
        """Take away what a killed session left half-written, and unfinished sessions of ours without a log."""
        places = [place for place in self.folder.glob(UNFINISHED + "*") if _record(place) or not any(place.iterdir())]
        for place in [self.folder, *places]:
            for path in place.glob(_PART + "*"):
                shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()
        for place in places:
            if not (place / LOG).exists():
                shutil.rmtree(place, ignore_errors=True)

    def _withdraw(self) -> None:
        if self.place != self.folder:
            _remove_empty(self.place)
        self._unlock()
        self._unmake()

    # leaving

    def _conclude(self) -> None:
        self.settle()
        if self._log is not None:
            self._log.close()
        for name in self._stale:
            (self.place / name).unlink(missing_ok=True)
        self._files = [name for name in self._files if name not in self._stale]
        if self.stopped:
            self._mark("stopped")
        elif self.place == self.folder:
            self._mark("complete")
        else:
            self._commit()

    def _break_off(self, error: BaseException) -> None:
        if self._log is not None:
            with suppress(UserError):  # a full disk: what is in the file already is whole, chunk by chunk
                self._log.close(f"{type(error).__name__}: {error}")
            if self._log.path.name != LOG:
                self._log.path.unlink(missing_ok=True)
        if not self.holds_samples:
            self._discard()
            if not isinstance(error, Exception) or isinstance(error, OSError):  # a signal, or the disk
                error.add_note(self._kept())
            return
        if self._log is not None and self._log.samples:
            self.stopped = self.stopped or self.reached(error)
        if self.stopped:
            error.add_note(self.stopped)
        error.add_note(self._kept())
        with suppress(OSError):  # a full disk: a session that says "running" and is not locked ended early, too
            self._mark("stopped")
            self._sweep()

    def _kept(self) -> str:
        """One sentence: what is there now, and the command that goes on."""
        if self.holds_samples:
            kept = f"kept: {self.place / LOG}"
            old = f", and {self.folder} as it was" if self.place != self.folder else ""
            return f"{kept}{old}; go on with: {self.job.go_on}" if self.job.go_on else kept + old
        as_it_was = f"{self.folder} is as it was" if self._earlier is not None else "nothing was written"
        return f"{as_it_was}; begin again with: {self.job.again}" if self.job.again else as_it_was

    def _commit(self) -> None:
        """Take the place of the earlier session."""
        assert self._earlier is not None
        own = self._own(self._earlier)
        if own:  # new results of an earlier session: it stays what it was
            self._mark(str(self._earlier["state"]), self._earlier, [*own, *self._files])
        else:
            self._mark("complete")
        os.rename(self.place, self.folder / _COMMIT)
        self.place = self.folder
        self._finish_commit()

    def _finish_commit(self) -> None:
        """Move a whole session from its commit folder to its place; may be repeated after a kill at any moment."""
        commit = self.folder / _COMMIT
        if not commit.is_dir():
            return
        record = _record(commit)
        if record is not None:
            old = (_record(self.folder) or {"files": []})["files"]
            for path in sorted(commit.rglob("*")):
                name = path.relative_to(commit)
                if path.is_file() and name.as_posix() != MARKER and not name.parts[0].startswith(_PART):
                    (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                    os.replace(path, self.folder / name)
            for name in old:
                if name not in record["files"] and _inside(self.folder, name):
                    (self.folder / name).unlink(missing_ok=True)
                    _remove_empty_parents(self.folder, name)
            os.replace(commit / MARKER, self.folder / MARKER)  # the last step: until then the old list is needed
        shutil.rmtree(commit)

    def _mark(self, state: str, of: dict[str, Any] | None = None, files: Sequence[str] | None = None) -> None:
        about = (
            {"job": self.job.name, "command": self.job.again, "subject": self.job.subject, "reads": self._reads}
            if of is None
            else of
        )
        now = datetime.now(UTC)
        record = {
            "schema": SESSION_SCHEMA,
            "state": state,
            "stopped": self.stopped or about.get("stopped"),
            "job": about.get("job"),
            "command": about.get("command", ""),
            "subject": about.get("subject"),
            "reads": about.get("reads", {}),
            "version": __version__,
            "started": self._started.isoformat(timespec="seconds"),
            "finished": None if state == "running" else now.isoformat(timespec="seconds"),
            "files": list(dict.fromkeys(self._files if files is None else files)),
        }
        part = self.place / f"{_PART}{MARKER}"
        part.write_text(json.dumps(record, indent=1) + "\n", "utf-8")
        os.replace(part, self.place / MARKER)

    def _discard(self) -> None:
        """Undo everything."""
        if self.place != self.folder:
            shutil.rmtree(self.place, ignore_errors=True)
        else:
            for name in [*self._files, MARKER]:
                (self.folder / name).unlink(missing_ok=True)
            self._sweep()
            for name in self._files:
                _remove_empty_parents(self.folder, name)
        self._unmake()

    def _unmake(self) -> None:
        for path in reversed(self._made):
            _remove_empty(path)


def locked(file: int) -> bool:
    """Lock an open file until it is closed, or its program has ended; False if another program holds it."""
    try:
        import fcntl
    except ImportError:  # a system without advisory locks
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _record(place: Path) -> dict[str, Any] | None:
    """What a session's marker says, None if there is none of ours."""
    try:
        record = json.loads((place / MARKER).read_text("utf-8"))
        if record["schema"] != SESSION_SCHEMA:
            return None
        return dict(record) | {"files": [str(name) for name in record["files"]], "state": str(record["state"])}
    except (OSError, ValueError, KeyError, TypeError):
        return None


def belongs_to_session(path: Path) -> bool:
    """True if a session lists the file as its own; sessions have folders for pictures, and none below these."""
    whole = path.resolve()
    records = ((folder, _record(folder)) for folder in whole.parents[:2])
    return any(
        record is not None and whole.relative_to(place).as_posix() in record["files"] for place, record in records
    )


def unchanged_files(place: Path) -> tuple[Path, ...]:
    """The files that the session in a folder read and that are what they were then.

    A session that somebody else hands over can state no digest of a file that it does not know.
    """
    reads = (_record(place) or {}).get("reads")
    known = reads if isinstance(reads, dict) else {}
    return tuple(Path(name) for name, sha256 in known.items() if Path(name).is_file() and digest(Path(name)) == sha256)


def _inside(folder: Path, name: str) -> bool:
    return (folder / name).resolve().is_relative_to(folder.resolve())


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):  # somebody else put something there meanwhile: that stays
        folder.rmdir()


def _remove_empty_parents(folder: Path, name: str) -> None:
    for parent in list(Path(name).parents)[:-1]:
        _remove_empty(folder / parent)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Signals do nothing until the block has ended: putting things away takes milliseconds."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, signal.SIG_IGN) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
