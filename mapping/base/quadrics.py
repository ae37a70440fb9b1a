"""Families of smooth bodies fitted to ball centres: plane, sphere, cylinder, quadric, smooth sheet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Surface, Trace
from mapping.base.base import FIT_MARGIN, FitValue
from mapping.base.cells import Cells
from mapping.base.profiles import SHORTEST_BEND
from mapping.geometry.mesh import distances, spline_design
from mapping.instrument import FEATURE_RESIDUAL_SDS, MAD_TO_SD, least_noise, robust_fit, robust_scale

# Upward part of the mean direction from a round body's middle of what was felt inside it, without contact normals
BELOW = -0.6
# Share of the scatter of second differences below which that of fourth ones shows that the sweeps bend
BENT_SCATTER_SHARE = 0.5
# Cells that are asked for the body's normal: the median of so many knows the scatter to 5 %
ASKED_FOR_NORMAL = 500
# Of them so many at once: of speed alone, 8 and 16 take a third of the time that one by one does, 64 two thirds
CELLS_AT_ONCE = 8
# The path goes on beside itself where its way there is so many times the distance: beyond half a circle (pi / 2)
OTHER_PASS = 2.0
# Cosine of the least angle to the path at which a line to a neighbour tells the normal
HALF_RIGHT = float(np.sqrt(0.5))
# Facets of a height field's mesh along both axes at least: over a quarter of a circle they lie (pi / 2 / 96)^2 / 8, or
# 3e-5, of its radius off it. And of each piece of a spline, as of eight of the former: where it is as bent as the ball,
# which it is at most, they lie within 0.01 radii of it (pieces of 2.5 radii: 2.5 / 12 squared over 8 is 0.005)
FEWEST_FACETS, FACETS_OF_PIECE = 96, 12
# Coefficients of a sheet: a bound on the time, which grows with their cube (300 take 0.8 CPU s). Pieces are longer
# where more would be needed, down to so many along an axis, of which both axes together fit the bound
MOST_COEFFICIENTS, FEWEST_PIECES = 300, 8
# Cells of a trace that bodies are fitted to, at most: a sheet takes four for each of its coefficients, and three times
# as many let details take a half of the path and more
MOST_BASE_CELLS = 4000
# Widths of a detail beyond which nothing of it is left: a bell's width is 2.3 standard deviations to either side, where
# the tangents of its flanks meet the base, and at 1.5 times that it is as high as 0.3 % of its crest
OF_DETAIL = 1.5

# Columns (N, P) of a field that is linear in its coefficients, at x and y (N,)
Design = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Ball centres thinned to cell medians, in the principal frame of the cloud.

    Args:
        points: (C, 3) in the frame, m; the third coordinate is outward.
        origin: (3,) and rows `axes` (3, 3): object frame = origin + points @ axes.
        scale: standard deviation of the points about a smooth surface, m.
        tip_radius: m.
        outward: (C, 3) measured contact normals in the frame, or None.
        sweep: (C,) of each point.
        inside: whether a round body was felt from inside, where that is known; else None.
        reach: farthest that a sample lies from the cell it was taken into, m.
    """

    points: FloatArray
    origin: FloatArray
    axes: FloatArray
    scale: float
    tip_radius: float
    outward: FloatArray | None
    sweep: IntArray
    inside: bool | None = None
    reach: float = 0.0

    @classmethod
    def of(cls, trace: Trace, most: int, inside: bool | None = None) -> Cloud:
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
        outward = None if normals is None else normals @ axes.T
        reach = float(np.linalg.norm(trace.centers - means[cells.cell], axis=1).max())
        scatter = max(_roughness(points, cells.sweep), least_noise(points, trace.tip_radius))
        return cls(points, origin, axes, scatter, trace.tip_radius, outward, cells.sweep, inside, reach)

    def world(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) of the frame in the object frame."""
        return np.asarray(self.origin + points @ self.axes)

    def hollow(self, away: FloatArray) -> bool:
        """True if the ball runs inside a round body: directions `away` (C, 3) from its middle point into the body.

        The contact normals tell; without them it is so if all was felt below the middle, as in a bowl.
        """
        if self.inside is not None:
            return self.inside
        if self.outward is not None:
            return float((self.outward * away).sum(axis=1).mean()) < 0.0
        return float((away.mean(axis=0) @ self.axes)[2]) < BELOW

    @property
    def margin(self) -> float:
        """By which a base goes on beyond the cells, m: that far beyond the samples of those at its border."""
        return FIT_MARGIN * self.tip_radius + self.reach

    @property
    def extent(self) -> FloatArray:
        """(2, 3) bounds of the points in the frame."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])


def _roughness(points: FloatArray, sweep: IntArray) -> float:
    """Scatter of neighbouring cells about a smooth curve through them, along the body's normal.

    Second differences tell it on flat bodies; on round ones they tell the bend of the sweeps, and fourth ones the
    scatter, which are taken across the curve: a normal of neighbours is off where sweeps lie far apart.
    """
    along = points[2:] - points[:-2]
    bend, length = np.diff(points, 2, axis=0), np.linalg.norm(along, axis=1)
    even = (np.linalg.norm(bend, axis=1) < 0.5 * length) & (length > 0)
    if even.sum() < 8:
        return 0.0
    ways = along / np.where(length > 0, length, 1.0)[:, None]
    asked = np.flatnonzero(even)[:: max(1, int(even.sum()) // ASKED_FOR_NORMAL)]
    normal = _normals(points, sweep, asked + 1, ways[asked])
    known = np.isfinite(normal[:, 0])
    off = (bend[asked] * normal)[known].sum(axis=1) if known.sum() >= 8 else bend[even, 2]
    flat = float(robust_scale(off) / np.sqrt(6.0))
    smooth = even[2:] & even[1:-1] & even[:-2]
    if smooth.sum() < 8:
        return flat
    rest, way = np.diff(points, 4, axis=0)[smooth], ways[1:-1][smooth]
    rest -= (rest * way).sum(axis=1)[:, None] * way
    bent = float(MAD_TO_SD * np.median(np.linalg.norm(rest, axis=1)) / np.sqrt(70.0))
    return bent if bent < BENT_SCATTER_SHARE * flat else flat


def _normals(points: FloatArray, sweep: IntArray, at: IntArray, ways: FloatArray) -> FloatArray:
    """Unit normals (K, 3), of either sign, at some cells (K,) with the ways (K, 3) of the path through them.

    They are square to the path and to the line to the nearest place of another pass; NaN where there is none. The
    least principal axis of all centres, which is a plate's normal, is the axis of rings round a short cylinder.
    """
    run = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    step = float(np.median(np.diff(run)))
    normals = np.full((len(at), 3), np.nan)
    # a few at once: one by one the asking takes longer than the answer, all at once memory does
    for some in np.split(np.arange(len(at)), np.arange(CELLS_AT_ONCE, len(at), CELLS_AT_ONCE)):
        cell, way, row = at[some], ways[some], np.arange(len(some))
        line = [points[:, axis] - points[cell, axis][:, None] for axis in range(3)]
        apart = np.sqrt(sum(part**2 for part in line))
        along = sum(part * way[:, axis, None] for axis, part in enumerate(line))
        other = (sweep != sweep[cell, None]) | (np.abs(run - run[cell, None]) > OTHER_PASS * apart)
        other &= (apart > 0.5 * step) & (np.abs(along) < HALF_RIGHT * apart)
        nearest = np.where(other, apart, np.inf).argmin(axis=1)
        known = other[row, nearest]
        normal = np.cross(way, np.column_stack([part[row, nearest] for part in line]))[known]
        normals[some[known]] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return normals


def independent_share(correlation: float) -> float:
    """The share of cells that count as independent if neighbours are so correlated; never less than a hundredth."""
    kept = float(np.clip(correlation, 0.0, 0.98))
    return (1.0 - kept) / (1.0 + kept)


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fitted family: its kind, its parameters (JSON values), the misses (C,) m, their freedom, and how to mesh it.

    A parameter of a simple family must pay as much as makes it true in the end (Schwarz's criterion); of families that
    nothing simple stands in for, the one that predicts best is wanted (Akaike's). What does not explain the cells,
    however near it comes to them, keeps no freer family from being tried.
    """

    kind: str
    parameters: dict[str, FitValue]
    residual: FloatArray
    freedom: int
    mesh: Callable[[Cloud, float | None], Surface]
    last_resort: bool = False
    explains: bool = True

    def cost(self, scale: float, share: float = 1.0) -> float:
        """Truncated chi-square at a scale (m) plus the price of the parameters; lower is better.

        Args:
            share: of the cells that count as independent.
        """
        misfit = float(np.minimum((self.residual / scale) ** 2, FEATURE_RESIDUAL_SDS**2).sum())
        return share * misfit + self.freedom * (2.0 if self.last_resort else float(np.log(len(self.residual))))

    def surface(self, cloud: Cloud, spacing: float | None = None) -> Surface:
        """The base's mesh in the object frame, covering the cloud; triangles no longer than `spacing` m."""
        return self.mesh(cloud, spacing)


def height_field(
    design: Design,
    kind: str,
    cloud: Cloud,
    bends: FloatArray | None = None,
    among: BoolArray | None = None,
    pieces: tuple[int, int] = (1, 1),
) -> Fitted:
    """A height field z = design(x, y) @ coefficients over the principal plane.

    Args:
        bends: (B, P) rows of which each times the coefficients is 0 +- 1: what holds where nothing was felt.
        among: (C,) cells that it is fitted to; None: all.
        pieces: of its spline along both axes.
    """
    x, y, z = cloud.points.T
    prior = np.zeros((0, design(x[:1], y[:1]).shape[1])) if bends is None else cloud.scale * bends
    columns, which = design(x, y), slice(None) if among is None else among
    fit = robust_fit(np.vstack([columns[which], prior]), np.append(z[which], np.zeros(len(prior))), cloud.scale)

    def height(u: FloatArray, v: FloatArray) -> FloatArray:
        return np.asarray(design(u, v) @ fit.coefficients)

    across = (1, 1) if kind == "plane" else tuple(max(FEWEST_FACETS, FACETS_OF_PIECE * n) for n in pieces)
    return Fitted(
        kind,
        {"coefficients": fit.coefficients.tolist()},
        fit.residual[: len(z)] if among is None else z - columns @ fit.coefficients,
        len(fit.coefficients),
        lambda cloud, spacing: _height_mesh(height, across, cloud, spacing),
    )


def _height_mesh(
    height: Callable[[FloatArray, FloatArray], FloatArray],
    facets: Sequence[int],
    cloud: Cloud,
    spacing: float | None,
) -> Surface:
    """A grid over the cloud's extent of so many facets along both axes, moved one tip radius inward along the sheet's
    normals."""
    low, high = cloud.extent
    margin = cloud.margin
    ends = [(float(low[i]) - margin, float(high[i]) + margin) for i in range(2)]
    u, v = (
        np.linspace(*end, 1 + max(least, pieces_of(end[1] - end[0], spacing)))
        for end, least in zip(ends, facets, strict=True)
    )
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
    return Surface(cloud.world(points), grid_faces(len(u), len(v)))


def pieces_of(length: float, spacing: float | None) -> int:
    """Into how many pieces a length (m) is cut so that none is longer than a spacing."""
    return 1 if spacing is None else int(np.clip(np.ceil(length / spacing), 1, 500))


def grid_faces(rows: int, columns: int) -> IntArray:
    """Triangles of a grid of vertices, row by row, outward if rows, columns and the outside are right-handed."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, up = corner + columns, corner + 1
    return np.concatenate([np.column_stack([corner, right, up]), np.column_stack([right, right + 1, up])])


def plane_design(x: FloatArray, y: FloatArray) -> FloatArray:
    """Columns (N, 3) of c0 + c1 x + c2 y."""
    return np.column_stack([np.ones_like(x), x, y])


def quadric_design(x: FloatArray, y: FloatArray) -> FloatArray:
    """Columns (N, 6) of a quadratic polynomial of x and y."""
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def plane(cloud: Cloud) -> Fitted:
    """A plane over the principal plane."""
    return height_field(plane_design, "plane", cloud)


def quadric(cloud: Cloud) -> Fitted | None:
    """A quadratic polynomial over the principal plane; None where two rows cannot tell a bend across them."""
    if not all(_tells(cloud, axis, 3) for axis in range(2)):
        return None
    return height_field(quadric_design, "quadric", cloud)


def _tells(cloud: Cloud, axis: int, count: int) -> bool:
    """True if so many coefficients along an axis of the cloud are told apart: as many places of it lie apart.

    A spline is determined only where each of its functions has a place of its own (Schoenberg and Whitney 1953):
    between two rows a cubic may do what it likes, and takes the rows' noise for a bend. Places are apart by half of
    what as many even ones would be, for rows waver.
    """
    places = np.sort(cloud.points[:, axis])
    apart, found, last = 0.5 * (places[-1] - places[0]) / (count - 1), 1, places[0]
    while apart > 0.0 and found < count and last + apart <= places[-1]:
        last = places[np.searchsorted(places, last + apart)]
        found += 1
    return found == count


def sheet(cloud: Cloud, shortest: float = SHORTEST_BEND) -> Fitted | None:
    """A bicubic spline sheet; its pieces are no shorter than so many tip radii, nor than the rows tell apart, and no
    more than MOST_COEFFICIENTS and the cells can tell."""
    low, high = cloud.extent
    # each coefficient takes four cells
    ideal, room = (high[:2] - low[:2]) / (shortest * cloud.tip_radius), min(MOST_COEFFICIENTS, len(cloud.points) // 4)
    # as long along both axes; 1.05: none is longer by more than that than it must be
    while np.prod(ideal.astype(int) + 3) > room and ideal.max() > FEWEST_PIECES + 1:
        ideal = ideal / 1.05
    pieces = [int(n) for n in ideal]
    pieces = [
        max((n for n in range(1, most + 1) if _tells(cloud, i, n + 3)), default=0) for i, most in enumerate(pieces)
    ]
    if min(pieces) < 1 or len(cloud.points) < 4 * (pieces[0] + 3) * (pieces[1] + 3):
        return None
    return _sheet_of(cloud, pieces)


def _sheet_of(cloud: Cloud, pieces: Sequence[int], among: BoolArray | None = None) -> Fitted:
    """A sheet of so many pieces along both axes, through all cells or some (C,)."""
    low, high = cloud.extent
    knots = [
        np.concatenate([[low[i]] * 3, np.linspace(low[i], high[i], pieces[i] + 1), [high[i]] * 3]) for i in range(2)
    ]

    def design(x: FloatArray, y: FloatArray) -> FloatArray:
        bx, by = (spline_design(np.clip(c, k[0], k[-1]), k, 3) for c, k in ((x, knots[0]), (y, knots[1])))
        return np.asarray((bx[:, :, None] * by[:, None, :]).reshape(len(x), -1))

    count = [pieces[i] + 3 for i in range(2)]
    # the sheet bends no more than the ball: second differences of the coefficients, in squared pieces over its radius
    along, across = (
        np.diff(np.eye(count[i]), 2, axis=0) * cloud.tip_radius * (pieces[i] / (high[i] - low[i])) ** 2
        for i in range(2)
    )
    bends = np.vstack([np.kron(along, np.eye(count[1])), np.kron(np.eye(count[0]), across)])
    fitted = height_field(design, "sheet", cloud, bends, among, (pieces[0], pieces[1]))
    return replace(fitted, parameters=fitted.parameters | {"pieces": [float(n) for n in pieces]})


def sheet_moved(trace: Trace, pieces: Sequence[int], axis: FloatArray, width: float) -> float:
    """How far a sheet that was fitted through a detail moves under it, m, if nothing of the detail is fitted.

    Above zero if it rises, 0 where what is left could not be fitted. Where its pieces are as short as the detail, the
    sheet takes a part of it, and without it only its neighbours and its stiffness say where it lies.

    Args:
        trace: that the sheet was fitted to.
        pieces: of it along both axes.
        axis: (N, 3) middle of the detail, m.
        width: of it, m.
    """
    cloud = Cloud.of(trace, MOST_BASE_CELLS)
    # in the plane over which the sheet is a height: the centres are a radius above the detail
    line = ((axis - cloud.origin) @ cloud.axes.T) * [1.0, 1.0, 0.0]
    away = distances(cloud.points * [1.0, 1.0, 0.0], line)
    beside = away > 0.5 * OF_DETAIL * width
    if beside.sum() < 4 * (pieces[0] + 3) * (pieces[1] + 3):
        return 0.0
    fits = [_sheet_of(cloud, pieces, among) for among in (None, beside)]
    middle = away <= max(0.25 * width, float(away.min()))
    return float(np.median((fits[0].residual - fits[1].residual)[middle]))


def sphere(cloud: Cloud) -> Fitted | None:
    """Centre and radius, from the algebraic fit refined by robust distances."""
    from scipy.optimize import least_squares

    p = cloud.points
    start = np.linalg.lstsq(np.column_stack([2 * p, np.ones(len(p))]), (p**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(max(start[3] + start[:3] @ start[:3], 0.0)))

    def residual(q: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(p - q[:3], axis=1) - q[3])

    q = least_squares(residual, [*start[:3], radius], loss="soft_l1", f_scale=max(cloud.scale, 1e-9 * radius)).x
    centre = q[:3]
    hollow = cloud.hollow((p - centre) / np.linalg.norm(p - centre, axis=1, keepdims=True))
    body = float(q[3]) + (cloud.tip_radius if hollow else -cloud.tip_radius)
    if not 0.0 < body < 20.0 * float(np.ptp(p, axis=0).max()):
        return None
    parameters = {"centre": cloud.world(centre[None])[0].tolist(), "radius": body} | (
        {"hollow": True} if hollow else {}
    )
    return Fitted(
        "sphere", parameters, residual(q), 4, lambda cloud, spacing: _sphere_mesh(centre, body, hollow, cloud)
    )


def _sphere_mesh(centre: FloatArray, radius: float, hollow: bool, cloud: Cloud) -> Surface:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=6, radius=radius)
    return Surface(cloud.world(np.asarray(ball.vertices) + centre), outside(np.asarray(ball.faces), hollow))


def outside(faces: IntArray, hollow: bool) -> IntArray:
    """Faces of a closed body, turned over if it is hollow."""
    return np.asarray(faces[:, ::-1] if hollow else faces, dtype=np.int64)


@lru_cache(maxsize=1)
def cylinder(cloud: Cloud) -> Fitted | None:
    """Axis and radius by robust distances, started along each principal axis of the cloud; every tube asks for it."""
    from scipy.optimize import least_squares

    p = cloud.points
    best = None
    # two rows, as on both sides of a rod, leave open how it bends from one to the other
    for axis in range(3) if _tells(cloud, 1, 3) else (1,):
        across = [i for i in range(3) if i != axis]
        flat = p[:, across]
        start = np.linalg.lstsq(np.column_stack([2 * flat, np.ones(len(p))]), (flat**2).sum(axis=1), rcond=None)[0]
        radius = float(np.sqrt(max(start[2] + start[:2] @ start[:2], 0.0)))

        def residual(q: FloatArray, axis: int = axis, across: list[int] = across) -> FloatArray:
            return np.asarray(np.linalg.norm(_across(p, q, axis, across), axis=1) - q[4])

        def slopes(q: FloatArray, axis: int = axis, across: list[int] = across) -> FloatArray:
            away = _across(p, q, axis, across)
            distance = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), np.finfo(float).tiny)
            side, foot = away[:, across] / distance, (p - away)[:, axis, None]
            return np.column_stack([-side, -foot * side, -np.ones(len(p))])

        scale = max(cloud.scale, 1e-9 * radius)
        begin = [start[0], start[1], 0.0, 0.0, radius]
        found = least_squares(residual, begin, jac=slopes, loss="soft_l1", f_scale=scale)
        misses = residual(found.x)
        cost = float(np.minimum((misses / cloud.scale) ** 2, FEATURE_RESIDUAL_SDS**2).sum())
        if best is None or cost < best[0]:
            best, missed = (cost, found.x, axis, across), misses
    assert best is not None
    _, q, axis, across = best
    away = _across(p, q, axis, across)
    hollow = cloud.hollow(away / np.linalg.norm(away, axis=1, keepdims=True))
    body = float(q[4]) + (cloud.tip_radius if hollow else -cloud.tip_radius)
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
    } | ({"hollow": True} if hollow else {})
    return Fitted(
        "cylinder",
        parameters,
        missed,
        5,
        lambda cloud, spacing: _cylinder_mesh(point, direction, body, hollow, cloud, spacing),
    )


def _across(p: FloatArray, q: FloatArray, axis: int, across: list[int]) -> FloatArray:
    """Vectors from the axis (point q0, q1; direction 1, q2, q3) to the points, perpendicular to it."""
    direction, point = np.zeros(3), np.zeros(3)
    direction[axis], direction[across[0]], direction[across[1]] = 1.0, q[2], q[3]
    direction /= np.linalg.norm(direction)
    point[across[0]], point[across[1]] = q[0], q[1]
    offset = p - point
    return np.asarray(offset - np.outer(offset @ direction, direction))


def _cylinder_mesh(
    point: FloatArray, direction: FloatArray, radius: float, hollow: bool, cloud: Cloud, spacing: float | None
) -> Surface:
    """A tube over the cloud's length; its facets stay within a millionth of the radius (20 with a spacing)."""
    height = (cloud.points - point) @ direction
    margin = cloud.margin
    helper = np.eye(3)[np.abs(direction).argmin()]
    u = np.cross(direction, helper)
    u /= np.linalg.norm(u)
    v = np.cross(direction, u)
    low, high = float(height.min()) - margin, float(height.max()) + margin
    around, along = 2048 if spacing is None else 512, pieces_of(high - low, spacing)
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    ring = radius * (np.outer(np.cos(angle), u) + np.outer(np.sin(angle), v))
    levels = point + np.linspace(low, high, along + 1)[:, None] * direction
    vertices = (levels[:, None, :] + ring[None, :, :]).reshape(-1, 3)
    return Surface(cloud.world(vertices), outside(ring_faces(around, along), hollow))


def ring_faces(around: int, along: int) -> IntArray:
    """Triangles of a tube whose vertices are rings of `around` corners, one after the other."""
    level, k = (grid.ravel() for grid in np.meshgrid(np.arange(along), np.arange(around), indexing="ij"))
    a, b = level * around + k, level * around + (k + 1) % around
    return np.concatenate([np.column_stack([a, b, b + around]), np.column_stack([a, b + around, a + around])])


Family = Callable[[Cloud], Fitted | None]
FAMILIES: tuple[Family, ...] = (plane, sphere, cylinder, quadric, sheet)
