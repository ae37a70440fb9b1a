"""The simulated finger in a scene: its tables, and how it is made."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from explore3d.scene.finger import FingerNoise, FingerTable, Setting
from explore3d.scene.values import Angle, Extent, LengthUnit, Rate, Table
from hw import Finger
from hw.simulated import TOP_SPEED_RADII, DynamicFinger, Dynamics, SimulatedFinger
from mapping.geometry.templates import kink_angle


class SimulatedNoise(FingerNoise):
    """Noise of the centre, and of what a finger that feels contacts feels: normal (rad) and contact point (m)."""

    angle: Angle = 0.0
    contact: Extent = 0.0


class DynamicsTable(Table):
    """Inertia and stiffness of the simulated finger: mass (kg), stiffness (N/m), force gain (no unit, below 1)."""

    mass: Annotated[float, Field(gt=0)] = 0.1
    stiffness: Annotated[float, Field(gt=0)] = 1e5
    gain: Annotated[float, Field(ge=0, lt=1)] = 0.5


class SimulatedFingerTable(FingerTable):
    """It touches the mesh `object`, the truth, and samples at `rate` Hz; with `dynamics` it has inertia."""

    kind: Literal["simulated"] = "simulated"
    noise: SimulatedNoise = SimulatedNoise()
    object: Path
    units: LengthUnit = "m"
    rate: Rate = 5000.0
    contact_data: bool = False
    dynamics: DynamicsTable | None = None

    @property
    def is_real(self) -> bool:
        """False: nothing moves but numbers."""
        return False

    @property
    def feels_normals(self) -> bool:
        """With contact data alone."""
        return self.contact_data

    @property
    def touched(self) -> tuple[Path, str]:
        """Mesh and unit of the truth."""
        return self.object, self.units

    def finger(self, setting: Setting) -> Finger:
        """A rigid ball on the exact surface, or one with inertia."""
        noise = self.noise
        settings: dict[str, Any] = {
            "object": setting.mesh(self.object, self.units),
            "tip_radius": setting.tip_radius,
            "rate": self.rate,
            "contact_data": self.contact_data,
            "white": noise.white,
            "correlated": noise.correlated,
            "correlation_length": noise.correlation_length,
            "angle": noise.angle,
            "contact": noise.contact,
            "seed": setting.seed,
        }
        if self.dynamics is None:
            return SimulatedFinger(**settings)
        return DynamicFinger(**settings, dynamics=Dynamics(**self.dynamics.model_dump()))

    def follows(self, tip_radius: float, smallest: float) -> tuple[float, float]:
        """As fast as the ball can go, and as its inertia lets it follow the smallest feature's kinks in the noise."""
        limit = TOP_SPEED_RADII * tip_radius
        if self.dynamics is not None:
            # what is as high as the ball's radius is met as a wall, which is followed at no speed
            height = min(smallest, tip_radius)
            kink = float(kink_angle(height, 0.5 * height, tip_radius))
            sigma = float((self.noise.white**2 + self.noise.correlated**2) ** 0.5)
            limit = min(limit, Dynamics(**self.dynamics.model_dump()).fastest(kink, sigma))
        return limit, self.rate
