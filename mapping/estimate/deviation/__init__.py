"""Deviation: what the model gets wrong at long wavelengths, before anything is looked for on it."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.estimate.deviation.blocks import lay_out as lay_out
    from mapping.estimate.deviation.explain import explain as explain, felt_enough as felt_enough
    from mapping.estimate.deviation.left_standing import LeftStanding as LeftStanding, left_standing as left_standing
    from mapping.estimate.deviation.on_details import WIDE_PART as WIDE_PART
    from mapping.estimate.deviation.result import CAUSES as CAUSES, Deviation as Deviation, Part as Part
    from mapping.estimate.deviation.unclimbed import (
        UnclimbedLevel as UnclimbedLevel,
        unclimbed_levels as unclimbed_levels,
    )
    from mapping.estimate.deviation.yielding import Yielding as Yielding, yielding as yielding

_PUBLIC = {
    "blocks": ("lay_out",),
    "explain": ("explain", "felt_enough"),
    "left_standing": ("LeftStanding", "left_standing"),
    "on_details": ("WIDE_PART",),
    "result": ("CAUSES", "Deviation", "Part"),
    "unclimbed": ("UnclimbedLevel", "unclimbed_levels"),
    "yielding": ("Yielding", "yielding"),
}
doorway(__name__, _PUBLIC)
