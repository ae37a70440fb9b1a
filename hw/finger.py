"""Finger: the one interface that simulated and real fingers share."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Any, Protocol, runtime_checkable

from hw.move import Move
from mapping import FloatArray, Trace


@dataclass(frozen=True, eq=False)
class Workspace:
    """What the finger may do: `low`, `high` (3,) m bound the tip centre, `max_speed` m/s, `max_force` N."""

    low: FloatArray
    high: FloatArray
    max_speed: float
    max_force: float


@runtime_checkable
class Finger(Protocol):
    """Executes moves and returns what it felt; a context manager that always lets go of its port."""

    @property
    def workspace(self) -> Workspace:
        """Limits in the object frame."""
        ...

    @property
    def tip_radius(self) -> float:
        """Radius of the spherical tip, m."""
        ...

    @property
    def info(self) -> dict[str, Any]:
        """What the finger is: kind, versions, rates, noise as known; JSON values only."""
        ...

    def execute(self, move: Move) -> Trace:
        """Carry out one move; the samples in contact (none for travel and retreat).

        Raises:
            FingerError: the move is refused or the finger is lost.
        """
        ...

    def __enter__(self) -> Finger: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None: ...
