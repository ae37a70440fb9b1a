"""Surveys: sweeps that cover a body, and their speed."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from planners.survey.baselines import RandomSweeps as RandomSweeps, Raster as Raster
    from planners.survey.ergodic import Ergodic as Ergodic
    from planners.survey.pace import CERTAIN_CREST_SDS as CERTAIN_CREST_SDS, fastest_speed as fastest_speed
    from planners.survey.survey import Survey as Survey

_PUBLIC = {
    "baselines": ("RandomSweeps", "Raster"),
    "ergodic": ("Ergodic",),
    "pace": ("CERTAIN_CREST_SDS", "fastest_speed"),
    "survey": ("Survey",),
}
doorway(__name__, _PUBLIC)
