"""Probing with a stage and a force sensor: pecks, slides, and the finger of both."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from hw.probing.grbl_finger import GrblFinger as GrblFinger
    from hw.probing.peck import Peck as Peck
    from hw.probing.slide import Slide as Slide

_PUBLIC = {
    "grbl_finger": ("GrblFinger",),
    "peck": ("Peck",),
    "slide": ("Slide",),
}
doorway(__name__, _PUBLIC)
