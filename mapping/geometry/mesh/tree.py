"""TriangleTree: the faces of a body in a frame of their own, under a tree of boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapping import FloatArray, Surface


class TriangleTree:
    """Triangles centred, scaled by a power of two to a size of about 1, and ordered under a tree.

    The centre has few digits: subtracting it is exact to the coordinates' own rounding, and a body around
    the origin keeps its coordinates. Lengths scale exactly.

    Args:
        surface: the body.
        length: another length that must not exceed about 1 in the frame, m, for example a ball's radius.
    """

    def __init__(self, surface: Surface, length: float = 0.0) -> None:
        from mapping.geometry.mesh import bvh_kernels, triangle_row_kernels

        low, high = bvh_kernels.bounds(surface.vertices, surface.faces)
        self.extent = float((0.5 * high - 0.5 * low).max()) * 2.0
        exponent = int(np.frexp(max(self.extent, length))[1])
        # by a power of two a product is exact, and takes a quarter of ldexp's time
        self._unit, self._per_unit = 2.0**exponent, 2.0**-exponent
        self._center = np.round((0.5 * low + 0.5 * high) * self._per_unit) * self._unit
        vertices = self.into(surface.vertices)
        self.order: NDArray[np.int32] = bvh_kernels.leaf_order(vertices, surface.faces)
        self.rows: FloatArray = triangle_row_kernels.lay_out(vertices, surface.faces, self.order)
        del vertices  # a tenth of what the tree of a large mesh takes
        self.leaves, self.boxes, self.links = bvh_kernels.build_tree(self.rows)
        self.size = float(np.linalg.norm(np.abs(self.into(np.stack([low, high]))).max(axis=0)))

    @property
    def frame(self) -> tuple[float, float, float, float]:
        """The origin of the tree's frame and its unit, m, a power of two."""
        x, y, z = self._center.tolist()
        return x, y, z, self._unit

    def into(self, points: FloatArray) -> FloatArray:
        """Points (N, 3), m, in the tree's frame."""
        return np.asarray((points - self._center) * self._per_unit)

    def out(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) of the tree's frame, m."""
        return np.asarray(points * self._unit + self._center)

    def scale_in(self, lengths: ArrayLike) -> FloatArray:
        """Lengths, m, in the tree's frame."""
        return np.asarray(np.asarray(lengths) * self._per_unit)

    def scale_out(self, lengths: ArrayLike) -> FloatArray:
        """Lengths of the tree's frame, m."""
        return np.asarray(np.asarray(lengths) * self._unit)
