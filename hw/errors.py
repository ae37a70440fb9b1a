"""Errors of the hw package."""


class FingerError(RuntimeError):
    """A finger that cannot be opened, refuses a move, or lost its connection; says what to do."""


class LinkError(FingerError):
    """A serial connection that cannot be opened, is lost, or does not answer in time."""


class StoppedError(FingerError):
    """The finger was stopped while it moved, by a limit, an alarm or the operator; says by which and what to do."""


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
