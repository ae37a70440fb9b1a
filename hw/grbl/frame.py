"""Frame: where the object stands on the machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray


@dataclass(frozen=True, eq=False)
class StageFrame:
    """The object frame seen from the machine: machine = origin + rotation @ object.

    Args:
        origin: (3,) machine coordinates of the object's origin, m.
        rotation: (3, 3) columns are the object's axes in machine coordinates.
    """

    origin: FloatArray
    rotation: FloatArray

    @classmethod
    def of(cls, origin: ArrayLike = (0.0, 0.0, 0.0), turn: ArrayLike = (0.0, 0.0, 0.0)) -> StageFrame:
        """From the origin (m) and a rotation vector (3,): axis times angle, rad."""
        axis = np.asarray(turn, dtype=np.float64)
        angle = float(np.linalg.norm(axis))
        x, y, z = axis / angle if angle > 0 else axis
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rotation = np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
        return cls(np.array(origin, dtype=np.float64), rotation)

    def to_machine(self, points: FloatArray) -> FloatArray:
        """Machine coordinates of object points (..., 3)."""
        return np.asarray(self.origin + points @ self.rotation.T)

    def to_object(self, points: FloatArray) -> FloatArray:
        """Object coordinates of machine points (..., 3)."""
        return np.asarray((points - self.origin) @ self.rotation)

    def turn_to_machine(self, directions: FloatArray) -> FloatArray:
        """Machine directions of object directions (..., 3)."""
        return np.asarray(directions @ self.rotation.T)

    def turn_to_object(self, directions: FloatArray) -> FloatArray:
        """Object directions of machine directions (..., 3)."""
        return np.asarray(directions @ self.rotation)
