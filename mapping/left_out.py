"""LeftOut: a stage that a run did without, and why."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LeftOut:
    """One stage that was not needed or could not be done.

    Args:
        stage: name of the stage, for example "contact algorithms".
        reason: one sentence saying why.
        saved: what leaving it out saved, in words ("" if not known).
    """

    stage: str
    reason: str
    saved: str = ""
