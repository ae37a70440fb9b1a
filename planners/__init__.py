"""Where to touch next: exploratory procedures as generators of moves."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planners.errors import PlannerError
    from planners.explore import Explore
    from planners.plan import Outcome, Plan
    from planners.survey import Survey

# public name: where it lives; loaded when it is first asked for, so that importing the package stays light
_PUBLIC = {
    "Plan": "planners.plan",
    "Outcome": "planners.plan",
    "Survey": "planners.survey",
    "Explore": "planners.explore",
    "PlannerError": "planners.errors",
}
__all__ = ["Explore", "Outcome", "Plan", "PlannerError", "Survey"]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'planners' has no attribute {name!r}; its public names: {', '.join(__all__)}")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
