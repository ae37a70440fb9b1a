"""Errors of the hw package."""


class FingerError(RuntimeError):
    """A finger that cannot be opened, refuses a move, or lost its connection; says what to do."""


class MoveError(ValueError):
    """A move that is malformed."""
