"""Where to touch next: exploratory procedures as generators of moves."""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOMES = {
    "Explore": "planners.explore",
    "Outcome": "planners.plan",
    "Plan": "planners.plan",
    "Survey": "planners.survey",
    "drive": "planners.drive",
}
__all__ = ["Explore", "Outcome", "Plan", "Survey", "drive"]


def __getattr__(name: str) -> Any:
    """The public names, each loaded when it is first asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module 'planners' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(_HOMES[name]), name)
