"""Following: one detail is looked at by a circuit, followed, and its ends are found."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from planners.follow.axis_track import AxisEnd as AxisEnd, AxisTrack as AxisTrack
    from planners.follow.bump import BumpSize as BumpSize, BumpSizer as BumpSizer
    from planners.follow.circuit import Circuit as Circuit, headings as headings
    from planners.follow.end_finder import Crest as Crest, EndFinder as EndFinder
    from planners.follow.faint_follower import (
        DECISIVE as DECISIVE,
        FaintFollower as FaintFollower,
        FaintLead as FaintLead,
    )
    from planners.follow.recross import is_step as is_step, slender as slender
    from planners.follow.ridge_follower import RidgeFollower as RidgeFollower
    from planners.follow.sense import Sense as Sense

_PUBLIC = {
    "axis_track": ("AxisEnd", "AxisTrack"),
    "bump": ("BumpSize", "BumpSizer"),
    "circuit": ("Circuit", "headings"),
    "end_finder": ("Crest", "EndFinder"),
    "faint_follower": ("DECISIVE", "FaintFollower", "FaintLead"),
    "recross": ("is_step", "slender"),
    "ridge_follower": ("RidgeFollower",),
    "sense": ("Sense",),
}
doorway(__name__, _PUBLIC)
