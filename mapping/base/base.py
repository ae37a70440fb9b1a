"""Base: the global model that fine features are found on, and the height of a trace above it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray, IntArray, Surface
from mapping.geometry.mesh import MovedNearestPoint, NearestPoint


@dataclass(frozen=True, eq=False)
class Feet:
    """Where ball centres stand over the base.

    Args:
        points: (N, 3) foot points on the base, m.
        normals: (N, 3) unit directions from the foot to the centre (the outward normal there).
        height: (N,) height of the trace over the base's own trace, m: zero on the bare base, positive
            over a bump, negative over a groove.
        face: (N,) base face under the centre.
        barycentric: (N, 3) coordinates of the foot in that face.
    """

    points: FloatArray
    normals: FloatArray
    height: FloatArray
    face: IntArray
    barycentric: FloatArray


@dataclass(frozen=True, eq=False)
class Base:
    """The body's known or fitted shape without its fine features.

    Args:
        surface: its mesh.
        kind: "mesh" if it was given, else the fitted family: "profile", "plane", "sphere", "cylinder",
            "quadric", "sheet", "polyhedron", "tube", "star body".
        parameters: what the fit found (JSON values, SI), empty for a given mesh; "missed" (m) of a base that was
            tested: by how much it missed sweeps that it was not fitted to.
    """

    surface: Surface
    kind: str = "mesh"
    parameters: dict[str, Any] = field(default_factory=dict)

    @property
    def known(self) -> bool:
        """True of a given mesh and of a base that predicted further sweeps: what it does not explain is a feature."""
        return self.kind == "mesh" or "missed" in self.parameters

    @cached_property
    def nearest(self) -> NearestPoint:
        """Nearest points of the surface, with the tree that `foot` searches."""
        return NearestPoint(self.surface)

    @property
    def edge_normals(self) -> FloatArray:
        """(F, 3, 3) mean normal of the faces on either side of the edge opposite to each corner of a face."""
        return self.nearest.edge_normals

    def moved(self, rotation: FloatArray, translation: FloatArray, parameters: dict[str, Any]) -> Base:
        """The base after a rigid motion, x to rotation @ x + translation, with other parameters."""
        moved = Base(self.surface.moved(rotation, translation), self.kind, parameters)
        moved.__dict__["nearest"] = MovedNearestPoint(moved.surface, self.nearest, rotation, translation)
        return moved

    def foot(self, centers: ArrayLike, tip_radius: float) -> Feet:
        """Foot points and heights of ball centres (N, 3), m.

        The trace of a body is where its distance equals the tip radius r, also over edges and corners, so
        the height is distance - r and the base's own edges explain themselves.
        """
        query = np.asarray(centers, dtype=np.float64)
        nearest = self.nearest.query(query)
        signed = nearest.side * nearest.distance
        away = nearest.side[:, None] * (query - nearest.points)
        # On the surface itself the direction to the centre has no digits left; the mesh normal has.
        clear = nearest.distance > 1e-6 * tip_radius
        safe = np.where(clear, nearest.distance, 1.0)[:, None]
        normals = np.where(clear[:, None], away / safe, nearest.normals)
        return Feet(nearest.points, normals, signed - tip_radius, nearest.face, nearest.barycentric)
