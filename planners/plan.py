"""Plan: a generator that yields moves, is sent what each move felt, and returns why it ended."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Any

from hw import Move
from mapping import Trace


@dataclass(frozen=True)
class Outcome:
    """Why a plan ended.

    Args:
        reason: a short word: "done", "lost", "budget", "limits", "nothing found", ...
        detail: one sentence for people.
        value: what the plan found, if anything.
    """

    reason: str
    detail: str = ""
    value: Any = field(default=None)


Plan = Generator[Move, Trace, Outcome]
