"""Errors of the hw package."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mapping import FloatArray


class FingerError(RuntimeError):
    """A finger that cannot be opened, refuses a move, or lost its connection; says what to do."""


class LinkError(FingerError):
    """A serial connection that cannot be opened, is lost, or does not answer in time."""


class StoppedError(FingerError):
    """The finger was stopped while it moved, by a limit, an alarm or the operator; says by which and what to do.

    Args:
        why: the sentence.
        touching: (3,) centre of the ball where it ran into something, m; None: it did not, or nobody knows.
    """

    def __init__(self, why: str, touching: FloatArray | None = None) -> None:
        super().__init__(why)
        self.touching = touching


class NotFeltError(StoppedError):
    """The tip went beyond the surface of the model and felt nothing."""


class UntrueForceError(StoppedError):
    """What the force sensor has said since it was last tested may be wrong, nobody knows since when."""


class MoveError(ValueError):
    """A move that is malformed."""


class GcodeError(ValueError):
    """A line that is answered by error:`number`."""

    def __init__(self, number: int) -> None:
        super().__init__(f"error:{number}")
        self.number = number
