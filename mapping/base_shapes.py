"""Families of smooth bodies fitted to ball centres: plane, sphere, cylinder, quadric, smooth sheet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapping.cells import Cells
from mapping.profile_fit import SHORTEST_BEND
from mapping.robust import OUTLIER, robust_fit, robust_scale
from mapping.surface import Surface
from mapping.trace import Trace

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Ball centres thinned to cell medians, in the principal frame of the cloud.

    Args:
        points: (C, 3) in the frame, m; the third coordinate is outward.
        origin: (3,) and rows `axes` (3, 3): object frame = origin + points @ axes.
        scale: standard deviation of the points about a smooth surface, m.
        tip_radius: m.
        outward: (C, 3) measured contact normals in the frame, or None.
    """

    points: FloatArray
    origin: FloatArray
    axes: FloatArray
    scale: float
    tip_radius: float
    outward: FloatArray | None

    @classmethod
    def of(cls, trace: Trace, most: int) -> Cloud:
        """The thinned cloud of a trace: means of consecutive samples, at most `most` of them."""
        cells = Cells.of(trace, most)
        means, normals = cells.centers, cells.normals
        origin = means.mean(axis=0)
        axes = np.linalg.svd(means - origin, full_matrices=False)[2]
        hint = np.array([0.0, 0.0, 1.0]) if normals is None else normals.mean(axis=0)
        if axes[2] @ hint < 0:
            axes = np.stack([axes[0], -axes[1], -axes[2]])
        if np.linalg.det(axes) < 0:
            axes = np.stack([axes[0], -axes[1], axes[2]])
        points = (means - origin) @ axes.T
        return cls(
            points, origin, axes, _roughness(points), trace.tip_radius, None if normals is None else normals @ axes.T
        )

    def world(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) of the frame in the object frame."""
        return np.asarray(self.origin + points @ self.axes)

    @property
    def extent(self) -> FloatArray:
        """(2, 3) bounds of the points in the frame."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])


def _roughness(points: FloatArray) -> float:
    """Scatter of neighbouring cells about a straight line through them, across the line."""
    bend = np.diff(points, 2, axis=0)
    along = points[2:] - points[:-2]
    length = np.linalg.norm(along, axis=1)
    even = (np.linalg.norm(bend, axis=1) < 0.5 * length) & (length > 0)
    if even.sum() < 8:
        return 0.0
    return float(robust_scale(bend[even, 2]) / np.sqrt(6.0))


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fitted family: its kind, its parameters (JSON values), its cost, and how to mesh it."""

    kind: str
    parameters: dict[str, Any]
    cost: float
    mesh: Callable[[Cloud], Surface]

    def surface(self, cloud: Cloud) -> Surface:
        """The base's mesh in the object frame, covering the cloud."""
        return self.mesh(cloud)


def _sheet(design: Callable[[FloatArray, FloatArray], FloatArray], kind: str, cloud: Cloud) -> Fitted:
    """A height field z = design(x, y) @ coefficients over the principal plane."""
    x, y, z = cloud.points.T
    fit = robust_fit(design(x, y), z, cloud.scale)

    def height(u: FloatArray, v: FloatArray) -> FloatArray:
        return np.asarray(design(u, v) @ fit.coefficients)

    cells = 1 if kind == "plane" else 96
    return Fitted(
        kind, {"coefficients": fit.coefficients.tolist()}, fit.cost, lambda cloud: _height_mesh(height, cells, cloud)
    )


def _height_mesh(height: Callable[[FloatArray, FloatArray], FloatArray], cells: int, cloud: Cloud) -> Surface:
    """A grid over the cloud's extent, moved one tip radius inward along the sheet's normals."""
    low, high = cloud.extent
    margin = 2.0 * cloud.tip_radius
    u, v = (np.linspace(low[i] - margin, high[i] + margin, cells + 1) for i in range(2))
    # Beyond the data a polynomial says nothing: the sheet goes on straight from its border.
    uu, vv = (g.ravel() for g in np.meshgrid(u, v, indexing="ij"))
    step = 1e-4 * max(float(high[0] - low[0]), float(high[1] - low[1]))
    cu, cv = np.clip(uu, low[0] + step, high[0] - step), np.clip(vv, low[1] + step, high[1] - step)
    du = (height(cu + step, cv) - height(cu - step, cv)) / (2 * step)
    dv = (height(cu, cv + step) - height(cu, cv - step)) / (2 * step)
    w = height(cu, cv) + du * (uu - cu) + dv * (vv - cv)
    normal = np.column_stack([-du, -dv, np.ones_like(du)])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    points = np.column_stack([uu, vv, w]) - cloud.tip_radius * normal
    return Surface(cloud.world(points), _grid_faces(cells + 1, cells + 1))


def _grid_faces(rows: int, columns: int) -> NDArray[np.int64]:
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, up = corner + columns, corner + 1
    return np.concatenate([np.column_stack([corner, right, up]), np.column_stack([right, right + 1, up])])


def plane(cloud: Cloud) -> Fitted:
    """z = c0 + c1 x + c2 y."""
    return _sheet(lambda x, y: np.column_stack([np.ones_like(x), x, y]), "plane", cloud)


def quadric(cloud: Cloud) -> Fitted:
    """z = a quadratic polynomial of x and y."""
    return _sheet(lambda x, y: np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y]), "quadric", cloud)


def sheet(cloud: Cloud) -> Fitted | None:
    """A bicubic spline sheet; its pieces are no shorter than SHORTEST_BEND tip radii."""
    from scipy.interpolate import BSpline

    low, high = cloud.extent
    pieces = [int(min(8, (high[i] - low[i]) / (SHORTEST_BEND * cloud.tip_radius))) for i in range(2)]
    if min(pieces) < 1 or len(cloud.points) < 4 * (pieces[0] + 3) * (pieces[1] + 3):
        return None
    knots = [
        np.concatenate([[low[i]] * 3, np.linspace(low[i], high[i], pieces[i] + 1), [high[i]] * 3]) for i in range(2)
    ]

    def design(x: FloatArray, y: FloatArray) -> FloatArray:
        bx, by = (
            BSpline.design_matrix(np.clip(c, k[0], k[-1]), k, 3).toarray() for c, k in ((x, knots[0]), (y, knots[1]))
        )
        return np.asarray((bx[:, :, None] * by[:, None, :]).reshape(len(x), -1))

    return _sheet(design, "sheet", cloud)


def sphere(cloud: Cloud) -> Fitted | None:
    """Centre and radius, from the algebraic fit refined by robust distances."""
    from scipy.optimize import least_squares

    p = cloud.points
    start = np.linalg.lstsq(np.column_stack([2 * p, np.ones(len(p))]), (p**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(max(start[3] + start[:3] @ start[:3], 0.0)))

    def residual(q: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(p - q[:3], axis=1) - q[3])

    q = least_squares(residual, [*start[:3], radius], loss="soft_l1", f_scale=max(cloud.scale, 1e-9 * radius)).x
    if not q[3] > cloud.tip_radius:
        return None
    centre, body = q[:3], float(q[3]) - cloud.tip_radius
    if body > 20.0 * float(np.ptp(p, axis=0).max()):
        return None
    parameters = {"centre": cloud.world(centre[None])[0].tolist(), "radius": body}
    return Fitted("sphere", parameters, _cost(residual(q), cloud, 4), lambda cloud: _sphere_mesh(centre, body, cloud))


def _sphere_mesh(centre: FloatArray, radius: float, cloud: Cloud) -> Surface:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=6, radius=radius)
    return Surface(cloud.world(np.asarray(ball.vertices) + centre), np.asarray(ball.faces, dtype=np.int64))


def cylinder(cloud: Cloud) -> Fitted | None:
    """Axis and radius by robust distances, started along each principal axis of the cloud."""
    from scipy.optimize import least_squares

    p = cloud.points
    best = None
    for axis in range(3):
        across = [i for i in range(3) if i != axis]
        flat = p[:, across]
        start = np.linalg.lstsq(np.column_stack([2 * flat, np.ones(len(p))]), (flat**2).sum(axis=1), rcond=None)[0]
        radius = float(np.sqrt(max(start[2] + start[:2] @ start[:2], 0.0)))

        def residual(q: FloatArray, axis: int = axis, across: list[int] = across) -> FloatArray:
            return np.asarray(np.linalg.norm(_across(p, q, axis, across), axis=1) - q[4])

        scale = max(cloud.scale, 1e-9 * radius)
        found = least_squares(residual, [start[0], start[1], 0.0, 0.0, radius], loss="soft_l1", f_scale=scale)
        cost = _cost(residual(found.x), cloud, 5)
        if best is None or cost < best[0]:
            best = (cost, found.x, axis, across)
    assert best is not None
    cost, q, axis, across = best
    body = float(q[4]) - cloud.tip_radius
    if not 0.0 < body < 20.0 * float(np.ptp(p, axis=0).max()):
        return None
    direction, point = np.zeros(3), np.zeros(3)
    direction[axis], direction[across[0]], direction[across[1]] = 1.0, q[2], q[3]
    direction /= np.linalg.norm(direction)
    point[across[0]], point[across[1]] = q[0], q[1]
    parameters = {
        "point": cloud.world(point[None])[0].tolist(),
        "axis": (direction @ cloud.axes).tolist(),
        "radius": body,
    }
    return Fitted("cylinder", parameters, cost, lambda cloud: _cylinder_mesh(point, direction, body, cloud))


def _across(p: FloatArray, q: FloatArray, axis: int, across: list[int]) -> FloatArray:
    """Vectors from the axis (point q0, q1; direction 1, q2, q3) to the points, perpendicular to it."""
    direction, point = np.zeros(3), np.zeros(3)
    direction[axis], direction[across[0]], direction[across[1]] = 1.0, q[2], q[3]
    direction /= np.linalg.norm(direction)
    point[across[0]], point[across[1]] = q[0], q[1]
    offset = p - point
    return np.asarray(offset - np.outer(offset @ direction, direction))


def _cylinder_mesh(point: FloatArray, direction: FloatArray, radius: float, cloud: Cloud) -> Surface:
    """A tube over the cloud's length; its facets stay within a millionth of the radius."""
    height = (cloud.points - point) @ direction
    margin = 2.0 * cloud.tip_radius
    helper = np.eye(3)[np.abs(direction).argmin()]
    u = np.cross(direction, helper)
    u /= np.linalg.norm(u)
    v = np.cross(direction, u)
    angle = np.linspace(0.0, 2.0 * np.pi, 2049)
    ring = radius * (np.outer(np.cos(angle), u) + np.outer(np.sin(angle), v))
    ends = [point + direction * h for h in (float(height.min()) - margin, float(height.max()) + margin)]
    vertices = np.concatenate([ring + ends[0], ring + ends[1]])
    k = np.arange(2048)
    faces = np.concatenate([np.column_stack([k, k + 1, k + 2050]), np.column_stack([k, k + 2050, k + 2049])])
    return Surface(cloud.world(vertices), faces)


def _cost(residual: FloatArray, cloud: Cloud, parameters: int) -> float:
    floor = max(cloud.scale, 1e-12 * float(np.abs(cloud.points).max()), np.finfo(float).tiny)
    return float(np.minimum((residual / floor) ** 2, OUTLIER**2).sum() + parameters * np.log(len(residual)))


FAMILIES: tuple[Callable[[Cloud], Fitted | None], ...] = (plane, sphere, cylinder, quadric, sheet)
