"""Following: one detail is looked at by a circuit, followed, and its ends are found."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from planners.follow.axis_track import AxisTrack as AxisTrack
    from planners.follow.bump import BumpSize as BumpSize, BumpSizer as BumpSizer
    from planners.follow.circuit import Circuit as Circuit, headings as headings
    from planners.follow.end_finder import Crest as Crest, EndFinder as EndFinder
    from planners.follow.recross import (
        SEEN_CHI_SQUARE_FALL as SEEN_CHI_SQUARE_FALL,
        is_step as is_step,
        slender as slender,
    )
    from planners.follow.ridge_follower import RidgeFollower as RidgeFollower
    from planners.follow.sense import Sense as Sense

_PUBLIC = {
    "axis_track": ("AxisTrack",),
    "bump": ("BumpSize", "BumpSizer"),
    "circuit": ("Circuit", "headings"),
    "end_finder": ("Crest", "EndFinder"),
    "recross": ("SEEN_CHI_SQUARE_FALL", "is_step", "slender"),
    "ridge_follower": ("RidgeFollower",),
    "sense": ("Sense",),
}
doorway(__name__, _PUBLIC)
