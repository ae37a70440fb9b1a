"""Finger: the one interface that simulated and real fingers share."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from types import TracebackType
from typing import Any, Protocol, runtime_checkable

from hw.errors import FingerError
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


FINGERS: dict[str, str] = {
    "simulated": "hw.simulated.finger:SimulatedFinger",
    "dynamic": "hw.simulated.dynamic_finger:DynamicFinger",
    "grbl": "hw.probing.grbl_finger:GrblFinger",
}


def open_finger(kind: str = "simulated", **settings: Any) -> Finger:
    """The finger of that kind, made from its own settings (fields of its class).

    Raises:
        FingerError: an unknown kind, or settings that the kind does not have.
    """
    if kind not in FINGERS:
        raise FingerError(f"unknown finger {kind!r}; possible: {', '.join(sorted(FINGERS))}")
    module, name = FINGERS[kind].split(":")
    try:
        finger: Finger = getattr(import_module(module), name)(**settings)
    except TypeError as error:
        raise FingerError(f"finger {kind!r}: {error}") from error
    return finger
