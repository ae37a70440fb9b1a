"""Displays: devices that a hand holds, and the loop that lets it feel a body."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from hw.display.device import Calls as Calls, Display as Display, python_calls as python_calls
    from hw.display.finger import DisplayFinger as DisplayFinger
    from hw.display.loop import DisplayLoop as DisplayLoop, Rendering as Rendering, Run as Run
    from hw.display.simulated import Hand as Hand, SimulatedDisplay as SimulatedDisplay

_PUBLIC = {
    "device": ("Calls", "Display", "python_calls"),
    "finger": ("DisplayFinger",),
    "loop": ("DisplayLoop", "Rendering", "Run"),
    "simulated": ("Hand", "SimulatedDisplay"),
}
doorway(__name__, _PUBLIC)
