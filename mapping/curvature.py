"""Principal curvatures of meshes and point clouds, with a standard deviation for every point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapping.errors import MappingError
from mapping.surface import Surface

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class CurvatureError(MappingError):
    """Points whose curvature cannot be asked for."""


@dataclass(frozen=True, eq=False)
class Curvature:
    """Principal curvatures, positive where the body bulges outward.

    Args:
        k1, k2: (V,) curvatures, 1/m, k1 >= k2; NaN where there is no trustworthy value.
        d1, d2: (V, 3) unit principal directions; NaN where k1 and k2 differ by less than their noise (umbilics
            have no direction) or have no value.
        sd: (V,) standard deviation of the curvatures, 1/m; NaN where the method does not know.
        valid: (V,) True where the values can be trusted.
    """

    k1: FloatArray
    k2: FloatArray
    d1: FloatArray
    d2: FloatArray
    sd: FloatArray
    valid: BoolArray

    @property
    def largest(self) -> FloatArray:
        """(V,) the curvature of larger absolute value, 1/m."""
        return np.where(np.abs(self.k1) >= np.abs(self.k2), self.k1, self.k2)


def principal_curvatures(
    body: Surface | ArrayLike, method: str = "jet", *, normals: ArrayLike | None = None, **settings: Any
) -> Curvature:
    """Principal curvatures and directions at the vertices of a mesh or the points of a cloud.

    Args:
        body: a mesh with outward faces, or points (N, 3), m.
        method: "jet": local polynomials that choose their own degree and neighbourhood from the noise; "libigl":
            its quadratic fits over rings of neighbours, guarded (meshes only).
        normals: (N, 3) outward normals of a cloud, or None: directions away from the cloud's centre.
        settings: of the method: `noise` (m, estimated if absent) for "jet"; `radius` (5) and `rings` (True)
            for "libigl".

    Raises:
        CurvatureError: an unknown method, points that are not (N, 3) or not finite, a cloud for libigl.
    """
    if method not in METHODS:
        raise CurvatureError(f"unknown method {method!r}; possible: {', '.join(sorted(METHODS))}")
    if not isinstance(body, Surface):
        points = np.asarray(body, dtype=np.float64)
        if points.ndim != 2 or points.shape[1:] != (3,) or not np.isfinite(points).all():
            raise CurvatureError(f"curvature needs finite points of shape (N, 3); found shape {points.shape}")
        if method == "libigl":
            raise CurvatureError("libigl computes curvature on meshes; for a cloud use method='jet'")
        body = points
    given = None if normals is None else np.asarray(normals, dtype=np.float64)
    if given is not None and given.shape != (len(body.vertices if isinstance(body, Surface) else body), 3):
        raise CurvatureError(f"normals must have one row per point; found shape {given.shape}")
    return METHODS[method](body, given, **settings)


def from_operators(operators: FloatArray, bases: FloatArray, sd: FloatArray, valid: BoolArray) -> Curvature:
    """Curvatures from symmetric shape operators (V, 3) = (a, b, c) in tangent bases (V, 2, 3)."""
    a, b, c = operators.T
    mean, half = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
    angle = 0.5 * np.arctan2(2 * b, a - c)
    d1 = np.cos(angle)[:, None] * bases[:, 0] + np.sin(angle)[:, None] * bases[:, 1]
    d2 = -np.sin(angle)[:, None] * bases[:, 0] + np.cos(angle)[:, None] * bases[:, 1]
    umbilic = ~(half > np.nan_to_num(sd, nan=0.0) + 0.5e-9 * np.abs(mean)) | ~valid
    d1[umbilic], d2[umbilic] = np.nan, np.nan
    k1, k2 = np.where(valid, mean + half, np.nan), np.where(valid, mean - half, np.nan)
    return Curvature(k1, k2, d1, d2, np.where(valid, sd, np.nan), valid)


def _jet(body: Any, normals: FloatArray | None, **settings: Any) -> Curvature:
    from mapping.curvature_jet import jet_curvature

    return jet_curvature(body, normals, **settings)


def _libigl(body: Any, normals: FloatArray | None, **settings: Any) -> Curvature:
    from mapping.curvature_libigl import libigl_curvature

    return libigl_curvature(body, **settings)


METHODS: dict[str, Callable[..., Curvature]] = {"jet": _jet, "libigl": _libigl}
