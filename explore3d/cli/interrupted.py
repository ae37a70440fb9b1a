"""What a command says when a signal or a full disk ends it: one line, never a traceback."""

from __future__ import annotations

import errno
from collections.abc import Callable
from functools import wraps
from typing import Any

# What a disk that takes no more, or nothing at all, answers, and a path that leads nowhere
DISK_ERRORS = (
    errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOENT, errno.ENOTDIR, errno.EISDIR,
    errno.EEXIST, errno.ENAMETOOLONG, errno.ELOOP,
)  # fmt: skip


class InterruptedJobError(RuntimeError):
    """A command that a signal ended; typer, which would end the program without a word, lets it pass.

    Args:
        status: exit status.
    """

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


def one_line(command: Callable[..., None]) -> Callable[..., None]:
    """The command, ended by a signal with an InterruptedJobError that says what is kept and how to go on."""

    @wraps(command)
    def guarded(*given: Any, **options: Any) -> None:
        try:
            command(*given, **options)
        except KeyboardInterrupt as error:
            raise InterruptedJobError(told(error), 130) from None
        except SystemExit as error:
            if not isinstance(error.code, int) or error.code <= 128:
                raise
            raise InterruptedJobError(told(error), error.code) from None

    return guarded


def is_kept(error: BaseException) -> bool:
    """True if the job that the error ended had recorded something."""
    return any(note.startswith(("stopped", "kept")) for note in getattr(error, "__notes__", ()))


def told(error: BaseException) -> str:
    """An error in one line: how far the job was and why it ended, what is kept, how to go on."""
    from explore3d.jobs import cause

    notes = [" ".join(note.split()) for note in getattr(error, "__notes__", ())]
    return "; ".join(notes if notes and notes[0].startswith("stopped") else [cause(error), *notes])
