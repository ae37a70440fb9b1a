"""Paths of the tip over a mesh: limits, travel, strokes, pressed paths, level lines."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from planners.paths.carrier import Carrier as Carrier
    from planners.paths.felt_details import FeltDetails as FeltDetails
    from planners.paths.isolines import Isoline as Isoline, isolines as isolines
    from planners.paths.limits import Limits as Limits
    from planners.paths.pressed_path import (
        PRESS as PRESS,
        pressed_sweep as pressed_sweep,
        thinned as thinned,
        touched_points as touched_points,
    )
    from planners.paths.reach import reachable as reachable
    from planners.paths.sound import held_up as held_up, resampled as resampled, sound_parts as sound_parts
    from planners.paths.strokes import Strokes as Strokes, tangential as tangential, to_and_fro as to_and_fro
    from planners.paths.travel import Ways as Ways, routed as routed

_PUBLIC = {
    "carrier": ("Carrier",),
    "felt_details": ("FeltDetails",),
    "isolines": ("Isoline", "isolines"),
    "limits": ("Limits",),
    "pressed_path": ("PRESS", "pressed_sweep", "thinned", "touched_points"),
    "reach": ("reachable",),
    "sound": ("held_up", "resampled", "sound_parts"),
    "strokes": ("Strokes", "tangential", "to_and_fro"),
    "travel": ("Ways", "routed"),
}
doorway(__name__, _PUBLIC)
