"""Where to touch next: exploratory procedures as generators of moves."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from planners.budget import Spent as Spent, within as within
    from planners.drive import drive as drive, dry_run as dry_run
    from planners.errors import PlannerError as PlannerError
    from planners.explore.explore import Explore as Explore
    from planners.meanwhile import Meanwhile as Meanwhile
    from planners.plan import (
        Outcome as Outcome,
        Parted as Parted,
        Plan as Plan,
        Refused as Refused,
        executed as executed,
        made as made,
    )
    from planners.survey.survey import Survey as Survey

_PUBLIC = {
    "budget": ("Spent", "within"),
    "drive": ("drive", "dry_run"),
    "errors": ("PlannerError",),
    "explore.explore": ("Explore",),
    "meanwhile": ("Meanwhile",),
    "plan": ("Outcome", "Parted", "Plan", "Refused", "executed", "made"),
    "survey.survey": ("Survey",),
}
doorway(__name__, _PUBLIC)
