"""Principal curvatures of meshes and point clouds by name of the method, with a standard deviation for every point."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mapping import CurvatureError, FloatArray, Surface
from mapping.geometry.curvature.auto import auto_curvature
from mapping.geometry.curvature.curvature import Curvature
from mapping.geometry.curvature.jet import jets_and_noise
from mapping.geometry.curvature.libigl_fits import libigl_curvature


def principal_curvatures(
    body: Surface | ArrayLike, method: str = "auto", *, normals: ArrayLike | None = None, **settings: Any
) -> Curvature:
    """Principal curvatures and directions at the vertices of a mesh or the points of a cloud.

    Args:
        body: a mesh with outward faces, or points (N, 3), m.
        method: "auto": of the two below whichever expects the smaller error, vertex by vertex; "jet": local
            polynomials that choose their own degree and neighbourhood from the noise; "libigl": its quadratic fits
            over rings of neighbours, guarded (meshes only).
        normals: (N, 3) outward normals of a cloud, or None: directions away from the cloud's centre.
        settings: of the method: `noise` (m, estimated if absent) for "auto" and "jet"; `radius` (5) and `rings` (True)
            for "libigl".

    Raises:
        CurvatureError: an unknown method, points that are not (N, 3) or not finite, a cloud for libigl.
    """
    if method not in CURVATURE_METHODS:
        raise CurvatureError(f"unknown method {method!r}; possible: {', '.join(sorted(CURVATURE_METHODS))}")
    if not isinstance(body, Surface):
        points = np.asarray(body, dtype=np.float64)
        if points.ndim != 2 or points.shape[1:] != (3,) or not np.isfinite(points).all():
            raise CurvatureError(f"curvature needs finite points of shape (N, 3); found shape {points.shape}")
        if method == "libigl":
            raise CurvatureError("libigl computes curvature on meshes; for a cloud use method='auto' or 'jet'")
        body = points
    given = None if normals is None else np.asarray(normals, dtype=np.float64)
    if given is not None and given.shape != (len(body.vertices if isinstance(body, Surface) else body), 3):
        raise CurvatureError(f"normals must have one row per point; found shape {given.shape}")
    return CURVATURE_METHODS[method](body, given, **settings)


def _auto(body: Any, normals: FloatArray | None, **settings: Any) -> Curvature:
    return auto_curvature(body, normals, **settings)


def _jet(body: Any, normals: FloatArray | None, **settings: Any) -> Curvature:
    return jets_and_noise(body, normals, **settings)[0]


def _libigl(body: Any, normals: FloatArray | None, **settings: Any) -> Curvature:
    return libigl_curvature(body, **settings)


CURVATURE_METHODS: dict[str, Callable[..., Curvature]] = {"auto": _auto, "jet": _jet, "libigl": _libigl}
