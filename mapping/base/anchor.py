"""Anchoring: where a feature hangs on the mesh of its base."""

from __future__ import annotations

import numpy as np

from mapping import Anchor, FloatArray, Surface
from mapping.geometry.mesh import NearestPoint, middle


def anchor(axis: FloatArray, surface: Surface) -> Anchor:
    """The anchor of a feature whose axis (K, 3) m runs on the surface.

    The reference point is the middle of the axis by arclength, moved to the nearest point of the mesh.
    The frame is right-handed: tangent along the axis and in the tangent plane, binormal, outward normal.
    A point feature, which has no direction, takes the coordinate axis that is least along the normal.
    """
    point, along = middle(np.asarray(axis, dtype=np.float64))
    foot = NearestPoint(surface).query(point[None, :])
    normal = foot.normals[0]
    return Anchor(
        face=int(foot.face[0]),
        barycentric=foot.barycentric[0],
        position=foot.points[0],
        frame=tangent_frame(normal, along),
    )


def tangent_frame(normal: FloatArray, along: FloatArray) -> FloatArray:
    """(3, 3) rows tangent, binormal, normal, from a unit normal and a wished tangent (3,)."""
    tangent = along - (along @ normal) * normal
    # A wish along the normal, or none, leaves the direction open.
    if np.linalg.norm(tangent) < 1e-9:
        wish = np.eye(3)[int(np.abs(normal).argmin())]
        tangent = wish - (wish @ normal) * normal
    tangent = tangent / np.linalg.norm(tangent)
    return np.stack([tangent, np.cross(normal, tangent), normal])
