"""LevelField: a level-set field on a part without creases; sweeps run along its evenly spaced level sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray, Surface

# A linear field serves where its slope along the surface stays above this (1 is perfect)
ENOUGH_SLOPE = 0.8
# What a face is bent counts no more than this: where the ball runs over a sharp edge its centre turns on the
# spot. Of the bracket, the vase and the folds half and twice as much give the same sweeps
MOST_BENT = 5.0


@dataclass(frozen=True, eq=False)
class LevelField:
    """Values (V,) in metres at the mesh's vertices, valid on the triangles `faces` (M, 3) of a chart.

    `slope` is the least gradient there: levels that differ by c lie at most c / slope apart on the surface. `bend` is
    how many times further apart than on the surface the ball's centres are, across the level sets: on an outward bend
    of radius R by 1 + r / R, and so many times more is lost between two sweeps than on a plane.
    """

    faces: IntArray
    values: FloatArray
    kind: str
    slope: float
    bend: float = 1.0

    def levels(self, pitch: float) -> FloatArray:
        """Levels between which no more is lost than a pitch apart on a plane: none is further than pitch / 2, m."""
        used = self.values[self.faces]
        low, high = float(used.min()), float(used.max())
        count = max(1, int(np.ceil((high - low) * np.sqrt(self.bend) / (pitch * self.slope) - 1e-9)))
        return np.asarray(low + (np.arange(count) + 0.5) * (high - low) / count)


def level_field(surface: Surface, vertices: FloatArray, chart: IntArray, tip_radius: float = 0.0) -> LevelField:
    """The field for a chart: a coordinate where the chart is flat or a cylinder, else geodesic distance.

    Args:
        surface: the body.
        vertices: (V, 3) its vertices.
        chart: faces of one connected chart.
        tip_radius: r, m.
    """
    axis, slope = _best_axis(surface, chart)
    faces, values, kind = surface.faces[chart], vertices @ axis, "linear"
    if slope < ENOUGH_SLOPE:
        distance = _geodesic(vertices, faces)
        slope = max(slope, 0.25)
        if distance is not None:
            values, kind, slope = distance, "geodesic", min(1.0, _slope(vertices, faces, distance))
    return LevelField(faces, values, kind, slope, _bend(surface, vertices, chart, values, tip_radius))


def _bend(surface: Surface, vertices: FloatArray, chart: IntArray, values: FloatArray, tip_radius: float) -> float:
    """How many times the ball's centres are further apart across the level sets than what it touches: the mean by area.

    Never under 1: an inward bend beside an outward one does not make up for it.
    """
    faces, areas = surface.faces[chart], surface.face_areas[chart]
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, faces[:, k], surface.face_normals[chart] * areas[:, None])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    touched, centres = (_gradients(at, faces, values) for at in (vertices, vertices + tip_radius * normals))
    known = (touched > 0) & (centres > 0)
    bent = np.minimum(touched[known] / centres[known], MOST_BENT)
    return max(1.0, float(np.average(bent, weights=areas[known]))) if known.any() else 1.0


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
    gradients = _gradients(vertices, faces, values)
    return float(np.quantile(gradients[np.isfinite(gradients)], 0.05))


def _gradients(vertices: FloatArray, faces: IntArray, values: FloatArray) -> FloatArray:
    """(M,) the field's gradient on each face; NaN where it is degenerate."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    double = np.linalg.norm(normal, axis=1)
    good = double > 0
    out = np.full(len(faces), np.nan)
    va, vb, vc = (values[faces[:, k], None] for k in range(3))
    gradient = va * (c - b) + vb * (a - c) + vc * (b - a)
    out[good] = np.linalg.norm(gradient[good], axis=1) / double[good]
    return out
