"""What was found, for the hand: felt with a display, or crossed as a vibration."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.report.display.devices import display_device as display_device, displays as displays
    from explore3d.report.display.feel import Felt as Felt, feel as feel, live as live
    from explore3d.report.display.haptic_files import VIBRATION_FORMATS as VIBRATION_FORMATS, haptic_file as haptic_file
    from explore3d.report.display.vibration import (
        Vibration as Vibration,
        human_threshold as human_threshold,
        vibration as vibration,
    )

_PUBLIC = {
    "devices": ("display_device", "displays"),
    "feel": ("Felt", "feel", "live"),
    "haptic_files": ("VIBRATION_FORMATS", "haptic_file"),
    "vibration": ("Vibration", "human_threshold", "vibration"),
}
doorway(__name__, _PUBLIC)
