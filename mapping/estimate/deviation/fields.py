"""Fields: how a cause displaces the surface, as columns of heights that it gives, and as displacements of places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, Surface

# Reference points of a smooth field stand so many of its lengths apart, and are at most so many
KNOT_SPACING, MOST_KNOTS = 0.6, 128
# Share of the largest eigenvalue below which a combination of knots says nothing
LEAST_EIGENVALUE = 1e-7


@dataclass(frozen=True, eq=False)
class RigidFrame:
    """Turns, shifts and a scale about one middle; all coefficients are lengths, m.

    Args:
        middle: (3,) m.
        length: distance at which a turn and a scale count, m.
    """

    middle: FloatArray
    length: float

    @classmethod
    def of(cls, surface: Surface) -> RigidFrame:
        """About the centroid of a surface, with the root mean square distance of its triangles from it."""
        middles, areas = surface.vertices[surface.faces].mean(axis=1), surface.face_areas / surface.face_areas.sum()
        middle = areas @ middles
        return cls(middle, float(np.sqrt(areas @ ((middles - middle) ** 2).sum(axis=1))))

    def offset(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """(N, 1) heights of a ball, or a coat, that is larger by one unit."""
        return np.ones((len(points), 1))

    def pose(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """(N, 6) heights of three turns times `length`, and three shifts."""
        return np.column_stack([np.cross(points - self.middle, normals) / self.length, normals])

    def scale(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """(N, 1) heights of a scale times `length`."""
        return np.asarray(((points - self.middle) * normals).sum(axis=1) / self.length)[:, None]


@dataclass(frozen=True, eq=False)
class SmoothField:
    """A displacement of space whose three components are Gaussian processes of one length, by their values at knots.

    The body follows, edges and both sides of a thin wall included: what a height shows is the part along the normal.

    Args:
        knots: (M, 3) m.
        length: of the squared-exponential covariance, m.
        roots: (M, J) what maps the kernel at the knots to independent coefficients of unit variance.

    Reference: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, section 8.3 (subset of
    regressors).
    """

    knots: FloatArray
    length: float
    roots: FloatArray

    @classmethod
    def over(cls, points: FloatArray, length: float) -> SmoothField | None:
        """The field over places (N, 3); None if it were too short to be told by MOST_KNOTS knots."""
        knots = spread(points, KNOT_SPACING * length, MOST_KNOTS + 1)
        if len(knots) > MOST_KNOTS:
            return None
        values, vectors = np.linalg.eigh(_kernel(knots, knots, length))
        kept = values > LEAST_EIGENVALUE * values[-1]
        return cls(knots, length, vectors[:, kept] / np.sqrt(values[kept]))

    def components(self, points: FloatArray) -> FloatArray:
        """(N, J) each component at places (N, 3)."""
        return np.asarray(_kernel(points, self.knots, self.length) @ self.roots)

    def columns(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """(N, 3 J) heights of unit coefficients of all three components."""
        each = self.components(points)
        return np.concatenate([each * normals[:, k : k + 1] for k in range(3)], axis=1)

    def displaced(self, points: FloatArray, coefficients: FloatArray) -> FloatArray:
        """(N, 3) displacements of places, m."""
        return np.asarray(self.components(points) @ coefficients.reshape(3, -1).T)


def spread(points: FloatArray, spacing: float, most: int) -> FloatArray:
    """Some of the places (N, 3), each the farthest from those before it, until none is farther than the spacing (m)."""
    chosen, farthest = [0], 0
    square = np.full(len(points), np.inf)
    while True:
        off = points - points[farthest]
        np.minimum(square, np.einsum("ij,ij->i", off, off), out=square)
        farthest = int(square.argmax())
        if len(chosen) >= most or square[farthest] <= spacing**2:
            return np.asarray(points[chosen])
        chosen.append(farthest)


def _kernel(points: FloatArray, knots: FloatArray, length: float) -> FloatArray:
    square = (points**2).sum(axis=1)[:, None] + (knots**2).sum(axis=1) - 2.0 * points @ knots.T
    return np.asarray(np.exp(-0.5 * np.maximum(square, 0.0) / length**2))
