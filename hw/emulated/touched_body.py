"""TouchedBody: what an emulated stage with a round tip touches: exact first contact, spring force behind it.

The ball is rigid and hangs on a spring: the body pushes it to the nearest place where it fits, and the spring pulls
it back. In a corner it rests against both sides, and the force points between their normals.
"""

from __future__ import annotations

import numpy as np

from hw.grbl import StageFrame
from mapping import FloatArray, Surface
from mapping.geometry.contact import BallContact

# What may be left of an overlap, in tip radii, and how many sides are looked for to push it out
LEFT_OVERLAP, MOST_LEFT_SIDES = 1e-6, 6
# Cosine of the angle between normals above which two contacts are one, on a curved side
SAME_SIDE = 0.995


class TouchedBody:
    """A body in machine coordinates, under a tip that yields like a spring.

    Args:
        surface: the true body, m, object frame.
        tip_radius: m.
        frame: where the object stands on the machine.
        stiffness: of the tip, N/m.
    """

    def __init__(
        self, surface: Surface, tip_radius: float, frame: StageFrame | None = None, stiffness: float = 2e4
    ) -> None:
        import igl

        self.frame = StageFrame.of() if frame is None else frame
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
        """(3,) force on the tip, N, machine frame: stiffness times the shortest way out of the body."""
        place = self.frame.to_object(center)
        # no distance changes faster than the tip moves: far from the body nothing needs to be looked up
        if self._clear - float(np.linalg.norm(place - self._seen)) > self.tip_radius:
            return np.zeros(3)
        overlap, away = self._overlap(place)
        self._seen, self._clear = place, self.tip_radius - overlap
        if overlap <= 0.0:
            return np.zeros(3)
        return self.frame.turn_to_machine(self.stiffness * self._way_out(place, overlap, away))

    def _way_out(self, place: FloatArray, overlap: float, away: FloatArray) -> FloatArray:
        """(3,) shortest way off all sides in reach; the nearest is overlapped by `overlap` and left along `away`."""
        normals, depths = [away], [overlap]
        way = overlap * away
        for _ in range(MOST_LEFT_SIDES):
            left, away = self._overlap(place + way)
            if left <= LEFT_OVERLAP * self.tip_radius:
                break
            depth = left + float(away @ way)  # as seen from where it began
            alike = [i for i, normal in enumerate(normals) if normal @ away > SAME_SIDE]
            for i in reversed(alike):
                del normals[i], depths[i]
            normals, depths = [*normals, away], [*depths, depth]
            way = _shortest(np.array(normals), np.array(depths))
        return way

    def _overlap(self, place: FloatArray) -> tuple[float, FloatArray]:
        """How far the body reaches into the ball (m, negative: not at all), and (3,) the direction off it."""
        squares, _, points = self._tree.squared_distance(self._vertices, self._faces, place[None, :])
        distance = float(squares[0]) ** 0.5
        return self.tip_radius - distance, np.asarray((place - points[0]) / max(distance, 1e-12))


def _shortest(normals: FloatArray, depths: FloatArray) -> FloatArray:
    """(3,) shortest way that leads at least `depths` (K,) along every one of the unit `normals` (K, 3).

    Reference: Lawson & Hanson, "Solving Least Squares Problems" (1974), chapter 23, problem LDP.
    """
    from scipy.optimize import nnls

    scale = float(depths.max())
    system = np.vstack([normals.T, depths / scale])
    weights, _ = nnls(system, np.array([0.0, 0.0, 0.0, 1.0]))
    residual = system @ weights - np.array([0.0, 0.0, 0.0, 1.0])
    return np.asarray(-scale * residual[:3] / residual[3])
