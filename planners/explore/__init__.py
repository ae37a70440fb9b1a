"""Exploring: survey, look, follow, until nothing is left or the budget is spent."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from planners.explore.discover import APPROACH_SIDES as APPROACH_SIDES, Discover as Discover
    from planners.explore.explore import Explore as Explore
    from planners.explore.locate import Locate as Locate
    from planners.explore.surveyor import SurveyCount as SurveyCount

_PUBLIC = {
    "discover": ("APPROACH_SIDES", "Discover"),
    "explore": ("Explore",),
    "locate": ("Locate",),
    "surveyor": ("SurveyCount",),
}
doorway(__name__, _PUBLIC)
