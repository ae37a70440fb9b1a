"""DisplayFinger: a simulated finger that explores what a display shows, in place of the body that was explored."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hw import FingerError, Move
from hw.simulated import SimulatedFinger
from mapping import BoolArray, FloatArray, Trace
from mapping.geometry.contact import Contacts
from mapping.geometry.proxy import ProxyBody, pressed_along


@dataclass(kw_only=True)
class DisplayFinger(SimulatedFinger):
    """Like SimulatedFinger, but what it feels is the proxy: the hand presses into the display's spring.

    The device is led along the commanded path, pressed in until the force is held; the samples are the proxy's centres.
    It closes the circle: explore, display, and explore what is displayed.

    Args:
        object: the base of what is displayed: it bounds the workspace, and stands in the stem's way.
        display: what is displayed.
        stiffness: of the spring, N/m. Deep in a soft spring the proxy dwells at kinks and hurries over crests, so that
            bins are no longer means over their length: at 1 N and 1 kN/m ridges are found narrower by a tenth.
        friction: coefficient.

    Raises:
        FingerError: a stiffness that is not positive, a ball of another size than the tip.
    """

    display: ProxyBody
    stiffness: float = 1e5
    friction: float = 0.0
    _force: float = field(init=False, default=1.0)

    def __post_init__(self, margin: float | None) -> None:
        super().__post_init__(margin)
        self._require_positive("stiffness")
        if self.display.radius != self.tip_radius:
            raise FingerError(
                f"the display is made for a ball of {self.display.radius} m, the finger's tip has {self.tip_radius} m"
            )

    @property
    def info(self) -> dict[str, Any]:
        """Settings of the simulation."""
        return super().info | {"kind": "display", "stiffness": self.stiffness, "friction": self.friction}

    def execute(self, move: Move) -> Trace:
        """Carry out one move; see SimulatedFinger."""
        self._force = move.force
        return super().execute(move)

    def _pressed(self, path: FloatArray, approach: FloatArray) -> tuple[Contacts, BoolArray]:
        felt = pressed_along(self.display, path, approach, self._force / self.stiffness, self.friction)
        centers, touching, device = felt.centers, felt.touching, felt.device
        pull = centers - device
        size = np.linalg.norm(pull, axis=1)
        touching = touching & (size > 0.0)
        normals = np.where(touching[:, None], pull / np.where(size > 0.0, size, 1.0)[:, None], -approach)
        keep = touching & (-(normals * approach).sum(axis=1) >= np.cos(self.field_angle))
        points, count = centers - self.tip_radius * normals, touching.astype(np.int64)
        nothing = np.zeros(len(path), dtype=bool)
        return Contacts(centers, points, normals, count.astype(np.int8), count, np.zeros(len(path)), nothing), keep
