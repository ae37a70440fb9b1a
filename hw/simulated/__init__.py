"""Simulated fingers: exact contact, dynamics, noise."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from hw.simulated.dynamic_finger import DynamicFinger as DynamicFinger
    from hw.simulated.dynamics import Dynamics as Dynamics
    from hw.simulated.finger import TOP_SPEED_RADII as TOP_SPEED_RADII, SimulatedFinger as SimulatedFinger
    from hw.simulated.noise_source import NoiseSource as NoiseSource

_PUBLIC = {
    "dynamics": ("Dynamics",),
    "dynamic_finger": ("DynamicFinger",),
    "finger": ("TOP_SPEED_RADII", "SimulatedFinger"),
    "noise_source": ("NoiseSource",),
}
doorway(__name__, _PUBLIC)
