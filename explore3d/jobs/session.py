"""Session: the output folder of one run or analysis; nothing half-written, nothing foreign overwritten."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any

from explore3d import FolderError, UserError, __version__
from explore3d.log import LOG, Recorder

MARKER = "session.json"
SESSION_SCHEMA = "explore3d/session/1"
_PART = ".part-"


class Session:
    """A folder that is filled while the `with` block runs; make it only when the inputs are known to be good.

    The folder may be new, empty, or an earlier session, whose own files are then replaced; other files in it
    are left alone. Files appear whole: they are written beside their place and renamed. If the block ends in a
    UserError before any sample was logged, all is as it was before; on any other error what is there stays,
    above all the log.

    Args:
        folder: where to write.
        keep: files of an earlier session in that folder that this one reads, its log for example.

    Raises:
        FolderError: (on entering) the path is a file, holds files that are not ours, is in use by another
            session, or cannot be written.
    """

    def __init__(self, folder: Path | str, keep: Sequence[Path | str] = ()) -> None:
        self.folder = Path(folder)
        self._keep = {Path(path).resolve() for path in keep}
        self._files: list[str] = []
        self._made: list[Path] = []
        self._log: Recorder | None = None
        self._started = datetime.now(UTC)
        self._lock: int | None = None
        self._aside: Path | None = None

    def __enter__(self) -> Session:
        earlier = self._check()
        undo = self._unmake
        try:
            self._make()
            self._lock_folder()
            undo = self._discard
            self._set_aside(earlier)
            self._mark("running")
        except OSError as error:
            undo()
            self._unlock()
            raise FolderError(f"{self.folder}: cannot write the output folder: {error.strerror or error}") from error
        except FolderError:
            self._unlock()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        try:
            if self._log is not None:
                self._log.close("closed" if error is None else f"{type(error).__name__}: {error}")
            if isinstance(error, UserError) and not (self._log and self._log.samples):
                self._discard()
            else:
                self._mark("complete" if error is None else "failed")
                self._sweep()
        except OSError as fault:
            raise FolderError(f"{self.folder}: cannot finish the output folder: {fault.strerror or fault}") from fault
        finally:
            self._unlock()

    @property
    def files(self) -> tuple[str, ...]:
        """Names of what has been written so far, relative to the folder."""
        return tuple(self._files)

    def open_log(self, **settings: Any) -> Recorder:
        """The session's log, closed with the session; `settings` as for Recorder."""
        self._note(LOG)
        self._log = Recorder(self.folder / LOG, **settings)
        return self._log

    def write(self, name: str, content: str | bytes) -> Path:
        """A whole file of that name (it may have folders), with that content.

        Raises:
            FolderError: it cannot be written.
        """
        with self.staging() as staging:
            path = staging / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        return self.folder / name

    @contextmanager
    def staging(self) -> Iterator[Path]:
        """An empty folder to fill; when the block ends well, each file in it moves to its place in the session.

        Raises:
            FolderError: the disk does not take it.
        """
        try:
            with tempfile.TemporaryDirectory(prefix=_PART, dir=self.folder) as name:
                yield Path(name)
                for path in sorted(Path(name).rglob("*")):
                    if path.is_file():
                        self._place(path, path.relative_to(name))
        except OSError as error:
            place = error.filename or self.folder
            raise FolderError(f"{place}: cannot write: {error.strerror or error}") from error

    def _place(self, path: Path, name: Path) -> None:
        with path.open("rb") as file:
            os.fsync(file.fileno())
        target = self.folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        self._note(name.as_posix())
        os.replace(path, target)

    def _note(self, name: str) -> None:
        """Claim a name before its file appears, so that even a killed session's files are known as ours."""
        if name not in self._files:
            if (self.folder / name).exists():
                raise FolderError(f"{self.folder / name}: is in the way and not ours; move it or choose another --out")
            self._files.append(name)
            self._mark("running")

    def _check(self) -> list[str]:
        """Files of an earlier session in the folder; refuses a folder that is not ours to fill."""
        try:
            names = sorted(path.name for path in self.folder.iterdir() if not path.name.startswith(_PART))
        except FileNotFoundError:
            return []
        except OSError as error:
            raise FolderError(f"{self.folder}: cannot be the output folder: {error.strerror}") from error
        if not names:
            return []
        try:
            record = json.loads((self.folder / MARKER).read_text("utf-8"))
            if record["schema"] != SESSION_SCHEMA:
                raise ValueError(record["schema"])
            return [str(name) for name in record["files"]]
        except (OSError, ValueError, KeyError, TypeError):
            some = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
            raise FolderError(
                f"{self.folder}: holds files that are not an explore3d session ({some}); "
                "choose a new or empty folder with --out"
            ) from None

    def _make(self) -> None:
        missing = [path for path in (self.folder, *self.folder.parents) if not path.exists()]
        for path in reversed(missing):
            path.mkdir()
            self._made.append(path)

    def _lock_folder(self) -> None:
        try:
            import fcntl
        except ImportError:  # a system without advisory locks: sessions there are not kept apart
            return
        self._lock = os.open(self.folder, os.O_RDONLY)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FolderError(f"{self.folder}: another session is writing there; choose another --out") from None

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _set_aside(self, earlier: list[str]) -> None:
        """Move what an earlier session wrote out of the way, but not what this one reads."""
        self._sweep()
        for name in [*earlier, MARKER] if earlier else []:
            path = self.folder / name
            if path.resolve() in self._keep:
                self._files.append(name)
            elif path.is_file() and path.resolve().is_relative_to(self.folder.resolve()):
                self._aside = self._aside or Path(tempfile.mkdtemp(prefix=_PART, dir=self.folder))
                (self._aside / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(path, self._aside / name)

    def _sweep(self) -> None:
        """Take away what is set aside or was left half-written by a killed session."""
        for path in self.folder.glob(_PART + "*"):
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()

    def _mark(self, state: str) -> None:
        now = datetime.now(UTC)
        record = {
            "schema": SESSION_SCHEMA,
            "state": state,
            "version": __version__,
            "started": self._started.isoformat(timespec="seconds"),
            "finished": None if state == "running" else now.isoformat(timespec="seconds"),
            "files": self._files,
        }
        part = self.folder / f"{_PART}{MARKER}"
        part.write_text(json.dumps(record, indent=1) + "\n", "utf-8")
        os.replace(part, self.folder / MARKER)

    def _discard(self) -> None:
        """Undo everything: the files written so far go, those that were set aside come back."""
        for name in [*self._files, MARKER]:
            if (self.folder / name).resolve() not in self._keep:
                (self.folder / name).unlink(missing_ok=True)
        if self._aside is not None:
            for path in [path for path in self._aside.rglob("*") if path.is_file()]:
                os.replace(path, self.folder / path.relative_to(self._aside))
        self._sweep()
        for name in self._files:
            for parent in list(Path(name).parents)[:-1]:
                _remove_empty(self.folder / parent)
        self._unmake()

    def _unmake(self) -> None:
        for path in reversed(self._made):
            _remove_empty(path)


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):  # somebody else put something there meanwhile: that stays
        folder.rmdir()
