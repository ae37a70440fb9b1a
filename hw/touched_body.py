"""TouchedBody: what an emulated stage with a round tip touches: exact first contact, spring force behind it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hw.frame import Frame
from mapping.contact import BallContact
from mapping.surface import Surface

FloatArray = NDArray[np.float64]


class TouchedBody:
    """A body in machine coordinates, under a tip that yields like a spring.

    Args:
        surface: the true body, m, object frame.
        tip_radius: m.
        frame: where the object stands on the machine.
        stiffness: of the tip, N/m.
    """

    def __init__(self, surface: Surface, tip_radius: float, frame: Frame | None = None, stiffness: float = 2e4) -> None:
        import igl

        self.frame = Frame.of() if frame is None else frame
        self.surface, self.tip_radius, self.stiffness = surface, tip_radius, stiffness
        self._ball = BallContact(surface, tip_radius)
        self._seen, self._clear = np.zeros(3), 0.0
        proper = surface.face_areas > 0.0
        self._vertices = np.ascontiguousarray(surface.vertices)
        self._faces = np.ascontiguousarray(surface.faces[proper])
        self._tree = igl.AABB()
        self._tree.init(self._vertices, self._faces)
        # what is compiled on first use must not be compiled in the midst of a motion
        self.distance(np.zeros(3), np.array([0.0, 0.0, 1.0]))

    def distance(self, start: FloatArray, direction: FloatArray) -> float:
        """Way (m) of the tip centre from `start` (3,), machine frame, along a unit direction to first contact."""
        origin = self.frame.to_object(start)[None, :]
        found = self._ball.first_contact(origin, self.frame.turn_to_object(direction)[None, :])
        return float(found.distance[0])

    def force(self, center: FloatArray) -> FloatArray:
        """(3,) force on the tip, N, machine frame: stiffness times overlap, away from the nearest point."""
        place = self.frame.to_object(center)
        # no distance changes faster than the tip moves: far from the body nothing needs to be looked up
        if self._clear - float(np.linalg.norm(place - self._seen)) > self.tip_radius:
            return np.zeros(3)
        square, nearest = self._look_up(place)
        self._seen, self._clear = place, square**0.5
        overlap = self.tip_radius - self._clear
        if overlap <= 0.0:
            return np.zeros(3)
        away = (place - nearest) / max(self._clear, 1e-12)
        return self.frame.turn_to_machine(self.stiffness * overlap * away)

    def _look_up(self, place: FloatArray) -> tuple[float, FloatArray]:
        squares, _, points = self._tree.squared_distance(self._vertices, self._faces, place[None, :])
        return float(squares[0]), points[0]
