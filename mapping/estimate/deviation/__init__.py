"""Deviation: what the model gets wrong at long wavelengths, before anything is looked for on it."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.estimate.deviation.explain import explain as explain
    from mapping.estimate.deviation.left_standing import LeftStanding as LeftStanding, left_standing as left_standing
    from mapping.estimate.deviation.result import CAUSES as CAUSES, Deviation as Deviation, Part as Part

_PUBLIC = {
    "explain": ("explain",),
    "left_standing": ("LeftStanding", "left_standing"),
    "result": ("CAUSES", "Deviation", "Part"),
}
doorway(__name__, _PUBLIC)
