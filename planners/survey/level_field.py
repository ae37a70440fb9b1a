"""LevelField: a level-set field on a part without creases; sweeps run along its evenly spaced level sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray, Surface

# A linear field serves where its slope along the surface stays above this (1 is perfect)
ENOUGH_SLOPE = 0.8


@dataclass(frozen=True, eq=False)
class LevelField:
    """Values (V,) in metres at the mesh's vertices, valid on the triangles `faces` (M, 3) of a chart.

    `slope` is the least gradient there: levels that differ by c lie at most c / slope apart on the surface.
    """

    faces: IntArray
    values: FloatArray
    kind: str
    slope: float

    def levels(self, pitch: float) -> FloatArray:
        """Levels that leave no point of the chart further than pitch / 2 from a level set, m."""
        used = self.values[self.faces]
        low, high = float(used.min()), float(used.max())
        count = max(1, int(np.ceil((high - low) / (pitch * self.slope) - 1e-9)))
        return np.asarray(low + (np.arange(count) + 0.5) * (high - low) / count)


def level_field(surface: Surface, vertices: FloatArray, chart: IntArray) -> LevelField:
    """The field for a chart: a coordinate where the chart is flat or a cylinder, else geodesic distance.

    Args:
        surface: the body.
        vertices: (V, 3) its vertices.
        chart: faces of one connected chart.
    """
    axis, slope = _best_axis(surface, chart)
    faces = surface.faces[chart]
    if slope >= ENOUGH_SLOPE:
        return LevelField(faces, vertices @ axis, "linear", slope)
    values = _geodesic(vertices, faces)
    if values is not None:
        return LevelField(faces, values, "geodesic", min(1.0, _slope(vertices, faces, values)))
    return LevelField(faces, vertices @ axis, "linear", max(slope, 0.25))


def _best_axis(surface: Surface, chart: IntArray) -> tuple[FloatArray, float]:
    """Unit direction along which the coordinate is steepest everywhere, and its least slope.

    The slope of x.a on a face of normal n is sqrt(1 - (a.n)^2). Of equally good directions (a flat chart)
    the one of least extent is taken, so that the sweeps run along the long side.
    """
    areas, normals = surface.face_areas[chart], surface.face_normals[chart]
    spread = np.einsum("f,fi,fj->ij", areas / areas.sum(), normals, normals)
    value, vector = np.linalg.eigh(spread)
    axis = vector[:, 0]
    if value[1] < 0.1:
        corners = surface.vertices[np.unique(surface.faces[chart])] @ vector[:, :2]
        axis = vector[:, :2] @ _narrowest(corners)
    axis = axis * np.sign(axis[np.abs(axis).argmax()])
    slope = np.sqrt(np.clip(1.0 - (normals @ axis) ** 2, 0.0, 1.0))
    order = np.argsort(slope)
    # a hundredth of the area may lie flatter: it is counted as not covered if the sweeps leave gaps there
    share = np.cumsum(areas[order]) / areas.sum()
    return axis, float(slope[order][min(int(np.searchsorted(share, 0.01)), len(order) - 1)])


def _narrowest(points: FloatArray) -> FloatArray:
    """(2,) unit direction in which the planar points (N, 2) extend least, to a degree."""
    angles = np.radians(np.arange(180.0))
    directions = np.stack([np.cos(angles), np.sin(angles)])
    centred = points - points.mean(axis=0)
    scatter = np.linalg.eigh(centred.T @ centred)[1]
    directions = np.column_stack([directions, scatter])
    along = centred @ directions
    return np.asarray(directions[:, int(np.ptp(along, axis=0).round(12).argmin())])


def _geodesic(vertices: FloatArray, faces: IntArray) -> FloatArray | None:
    """(V,) heat geodesic distance from the vertex at one end of the chart; None if it fails.

    Reference: Crane, Weischedel and Wardetzky, Geodesics in heat, ACM Transactions on Graphics 32, 2013.
    """
    import igl

    used, local = np.unique(faces, return_inverse=True)
    points = vertices[used] - vertices[used].mean(axis=0)
    longest = np.linalg.svd(points, full_matrices=False)[2][0]
    source = int((points @ (longest * np.sign(longest[np.abs(longest).argmax()]))).argmin())
    data = igl.HeatGeodesicsData()
    size = max(float(np.ptp(points, axis=0).max()), np.finfo(float).tiny)
    triangles = np.ascontiguousarray(local.reshape(-1, 3).astype(np.int64))
    try:
        igl.heat_geodesics_precompute(np.ascontiguousarray(points / size), triangles, data)
        distance = igl.heat_geodesics_solve(data, np.array([source], dtype=np.int64)) * size
    except RuntimeError:
        return None
    if not np.isfinite(distance).all() or np.ptp(distance) == 0:
        return None
    values = np.zeros(len(vertices))
    values[used] = distance
    return values


def _slope(vertices: FloatArray, faces: IntArray, values: FloatArray) -> float:
    """Fifth percentile of the field's gradient over the faces."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    double = np.linalg.norm(normal, axis=1)
    good = double > 0
    va, vb, vc = (values[faces[:, k], None] for k in range(3))
    gradient = va * (c - b) + vb * (a - c) + vc * (b - a)
    return float(np.quantile(np.linalg.norm(gradient[good], axis=1) / double[good], 0.05))
