"""What physically touches: a Move, and fingers that execute it and return a Trace."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hw.errors import FingerError, MoveError
    from hw.finger import Finger, Workspace, open_finger
    from hw.moves import Move
    from hw.simulated import SimulatedFinger

# public name: where it lives; loaded when it is first asked for, so that importing the package stays light
_PUBLIC = {
    "Move": "hw.moves",
    "Finger": "hw.finger",
    "Workspace": "hw.finger",
    "open_finger": "hw.finger",
    "SimulatedFinger": "hw.simulated",
    "FingerError": "hw.errors",
    "MoveError": "hw.errors",
}
__all__ = ["Finger", "FingerError", "Move", "MoveError", "SimulatedFinger", "Workspace", "open_finger"]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'hw' has no attribute {name!r}; its public names: {', '.join(__all__)}")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
