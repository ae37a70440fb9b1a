"""Slices: plane sections of a body, in crossed families so spaced that every ridge of a given span is crossed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray, Surface

# A body whose normals leave its mean plane by less than this share of their variance is flat: two families do
FLAT_VARIANCE_SHARE = 1e-3


@dataclass(frozen=True, eq=False)
class Slices:
    """Families of parallel planes through a body.

    The two farthest points of a ridge lie a distance L apart, its span. Along at least one of k perpendicular
    axes they differ by L / sqrt(k) or more, and its ends are seen up to y beyond: planes L / sqrt(k) + 2 y
    apart along every axis cross it for certain, however it lies and bends. (A needle dropped on crossed lines:
    Laplace's extension of Buffon's problem, asked for certainty.) Reference: theory equation 11.1.

    Args:
        axes: (k, 3) unit normals of the planes; two in the plane of a flat body, otherwise three.
        pitch: distance between neighbouring planes, m.
    """

    axes: FloatArray
    pitch: float

    def levels(self, axis: FloatArray, vertices: FloatArray) -> FloatArray:
        """Offsets of the planes along one axis, m: none further than half a pitch from the body's extent."""
        along = vertices @ axis
        low, high = float(along.min()), float(along.max())
        count = max(1, int(np.ceil((high - low) / self.pitch - 1e-9)))
        return np.asarray(low + (np.arange(count) + 0.5) * (high - low) / count)


def slices_for(axes: FloatArray, span: float, reach: float) -> Slices:
    """The slices across some axes (k, 3) that cross every ridge of a span (m).

    Args:
        axes: of `slice_axes`.
        span: distance between the farthest points of the shortest ridge, m.
        reach: distance beyond the ridge's end at which a sweep still sees it, m.
    """
    return Slices(axes, span / float(np.sqrt(len(axes))) + 2.0 * reach)


def slice_axes(surface: Surface, faces: IntArray) -> FloatArray:
    """(k, 3) perpendicular axes of some faces (M,) of a body: two in the plane of flat ones, otherwise three."""
    areas, normals = surface.face_areas[faces], surface.face_normals[faces]
    mean = areas @ normals
    spread = np.einsum("f,fi,fj->ij", areas / areas.sum(), normals, normals)
    value, vector = np.linalg.eigh(spread)
    flat = bool(value[:2].sum() < FLAT_VARIANCE_SHARE) and np.linalg.norm(mean) > 0
    if not flat:
        return np.asarray(vector.T)
    corners = surface.vertices[np.unique(surface.faces[faces])] @ vector[:, :2]
    return np.asarray(_upright(corners) @ vector[:, :2].T)


def _upright(points: FloatArray) -> FloatArray:
    """(2, 2) rows: the direction in which planar points (N, 2) extend least, to a degree, and the one across."""
    angles = np.radians(np.arange(180.0))
    directions = np.stack([np.cos(angles), np.sin(angles)])
    c, s = directions[:, int(np.ptp(points @ directions, axis=0).round(12).argmin())]
    return np.array([[c, s], [-s, c]])
