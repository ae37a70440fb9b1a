"""Round bodies of no simple family: stars, whose radius is a smooth function of the direction from a middle, and tubes,
whose radius is one of angle and height about an axis.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mapping import FloatArray, IntArray, Surface
from mapping.base.quadrics import Cloud, Fitted, cylinder, outside, pieces_of, ring_faces
from mapping.geometry.mesh import spline_design
from mapping.instrument import robust_fit

Radius = Callable[[FloatArray], FloatArray]

# Waves round the body are at least so many tip radii long; shorter ones would follow the fine features
SHORTEST_WAVE = 2.5
# A round body is felt from all about: the mean of the directions from its middle is no longer than this
ALL_ABOUT = 0.5
# Standard deviation of the body's departures from a sphere or a tube of one wave, in its radius; those of k waves are
# k (k + 1) times smaller. It matters only where nothing was felt
DEPARTURE = 0.3
# Step of the numerical slopes, in rad
SLOPE_STEP_ANGLE = 1e-4
# Corners of a tube's mesh around the body, and its rings along it if nobody asks for a spacing
CORNERS_AROUND, RINGS = 512, 128


def star(cloud: Cloud, degree: int) -> Fitted | None:
    """A star-shaped body: the radius is a sum of spherical harmonics of the direction from its middle.

    None of a body felt from one side, of one too small for so high a degree, and of too few centres.
    """
    middle = cloud.extent.mean(axis=0)
    away = cloud.points - middle
    radius = np.linalg.norm(away, axis=1)
    if not radius.min() > 0 or _one_sided(away / radius[:, None]):
        return None
    if not _bears(degree, (degree + 1) ** 2, float(np.median(radius)), cloud):
        return None
    degrees = np.repeat(np.arange(degree + 1.0), 2 * np.arange(degree + 1) + 1)
    hollow = cloud.hollow(away / radius[:, None])
    coefficients, missed = _solved(_harmonics(away, degree), radius, degrees, cloud)

    def reach(directions: FloatArray) -> FloatArray:
        return np.asarray(_harmonics(directions, degree) @ coefficients)

    parameters = {"middle": cloud.world(middle[None])[0].tolist(), "harmonics": coefficients.tolist()}
    if hollow:
        parameters["hollow"] = True
    return Fitted(
        "star body", parameters, missed, len(coefficients), lambda cloud, spacing: _ball(middle, reach, hollow, cloud)
    )


def _one_sided(directions: FloatArray) -> bool:
    """True if the body was felt from one side only."""
    return bool(np.linalg.norm(directions.mean(axis=0)) > ALL_ABOUT)


def _bears(waves: int, freedom: int, radius: float, cloud: Cloud) -> bool:
    """True if so many waves round the body are long enough, and the centres many enough to tell them."""
    long = 2.0 * np.pi * radius >= SHORTEST_WAVE * cloud.tip_radius * waves
    return long and len(cloud.points) >= 8 * freedom


def _solved(design: FloatArray, radius: FloatArray, waves: FloatArray, cloud: Cloud) -> tuple[FloatArray, FloatArray]:
    """Coefficients (P,) and misses (C,) m of the radii; where nothing was felt, as few departures as possible."""
    sd = DEPARTURE * float(np.median(radius)) / np.maximum(waves * (waves + 1.0), 1.0)
    prior = np.diag(cloud.scale / sd)[waves > 0]
    fit = robust_fit(np.vstack([design, prior]), np.concatenate([radius, np.zeros(len(prior))]), cloud.scale)
    return fit.coefficients, fit.residual[: len(radius)]


def _harmonics(directions: FloatArray, degree: int) -> FloatArray:
    """(N, (degree + 1)^2) real spherical harmonics at directions (N, 3) of any length."""
    from scipy.special import sph_harm_y

    x, y, z = directions.T
    polar, around = np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
    columns = []
    for n in range(degree + 1):
        values = [sph_harm_y(n, m, polar, around) for m in range(n + 1)]
        columns += [value.imag for value in values[:0:-1]] + [value.real for value in values]
    return np.column_stack(columns)


def _ball(middle: FloatArray, reach: Radius, hollow: bool, cloud: Cloud) -> Surface:
    """The body's surface: an icosphere drawn to the centres' star and moved on to where the ball touches."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=6)
    unit = np.asarray(ball.vertices, dtype=np.float64)
    helper = np.eye(3)[np.abs(unit).argmin(axis=1)]
    first = np.cross(unit, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)

    def place(directions: FloatArray) -> FloatArray:
        length = np.linalg.norm(directions, axis=1)
        return np.asarray(reach(directions)[:, None] * directions / length[:, None])

    along, across = (
        place(unit + SLOPE_STEP_ANGLE * way) - place(unit - SLOPE_STEP_ANGLE * way)
        for way in (first, np.cross(unit, first))
    )
    return _touched(
        middle + place(unit), np.cross(along, across), outside(np.asarray(ball.faces), hollow), hollow, cloud
    )


def _touched(centers: FloatArray, away: FloatArray, faces: IntArray, hollow: bool, cloud: Cloud) -> Surface:
    """The surface that balls at the centres (N, 3) touch, in the object frame; `away` (N, 3) from the body's middle."""
    way = (1.0 if hollow else -1.0) * away / np.linalg.norm(away, axis=1, keepdims=True)
    return Surface(cloud.world(centers + cloud.tip_radius * way), faces)


def tube(cloud: Cloud, waves: int, shortest: float) -> Fitted | None:
    """A tube about the axis of the best cylinder: its radius is a Fourier sum of the angle and a spline of the height.

    The pieces of the spline are no shorter than so many tip radii. None of a body felt from one side, of one too small
    for so many waves, and of too few centres.
    """
    straight = cylinder(cloud)
    if straight is None:
        return None
    point = (np.array(straight.parameters["point"]) - cloud.origin) @ cloud.axes.T
    axis = np.array(straight.parameters["axis"]) @ cloud.axes.T
    u = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    u /= np.linalg.norm(u)
    frame = np.stack([u, np.cross(axis, u), axis])
    x, y, height = ((cloud.points - point) @ frame.T).T
    angle, radius = np.arctan2(y, x), np.hypot(x, y)
    if not radius.min() > 0 or _one_sided(np.column_stack([x, y]) / radius[:, None]):
        return None
    hollow = bool(straight.parameters.get("hollow", False))
    low, high = float(height.min()), float(height.max())
    pieces = int(np.clip((high - low) / (shortest * cloud.tip_radius), 1, 12))
    knots = np.concatenate([[low] * 3, np.linspace(low, high, pieces + 1), [high] * 3])
    if not _bears(max(waves, 1), (2 * waves + 1) * (pieces + 3), float(np.median(radius)), cloud):
        return None
    each = np.concatenate([[0], np.repeat(np.arange(1, waves + 1), 2)])
    design = _rings(angle, height, each, knots)
    coefficients, missed = _solved(design, radius, np.repeat(each, pieces + 3), cloud)

    def reach(angle: FloatArray, height: FloatArray) -> FloatArray:
        inside, step = np.clip(height, low, high), SLOPE_STEP_ANGLE * (high - low)
        near = np.clip(height, low + step, high - step)
        radius, nearer = (_rings(angle, level, each, knots) @ coefficients for level in (inside, near))
        slope = np.divide(radius - nearer, inside - near, out=np.zeros_like(radius), where=inside != near)
        return np.asarray(radius + slope * (height - inside))

    parameters = straight.parameters | {"waves": coefficients.tolist(), "knots": knots.tolist()}
    return Fitted(
        "tube",
        parameters,
        missed,
        len(coefficients),
        lambda cloud, spacing: _pipe(point, frame, reach, (low, high), hollow, cloud, spacing),
    )


def _rings(angle: FloatArray, height: FloatArray, each: IntArray, knots: FloatArray) -> FloatArray:
    """(N, P) products of Fourier waves of the angle (in turn cosine and sine) and splines of the height."""
    turn = each * angle[:, None]
    waves = np.where(np.arange(len(each)) % 2 == 0, np.cos(turn), np.sin(turn))
    along = spline_design(np.clip(height, knots[0], knots[-1]), knots, 3)
    return np.asarray((waves[:, :, None] * along[:, None, :]).reshape(len(angle), -1))


def _pipe(
    point: FloatArray,
    frame: FloatArray,
    reach: Callable[[FloatArray, FloatArray], FloatArray],
    ends: tuple[float, float],
    hollow: bool,
    cloud: Cloud,
    spacing: float | None,
) -> Surface:
    """The tube that the ball touches; beyond the centres it goes straight on."""
    margin = cloud.margin
    low, high = ends[0] - margin, ends[1] + margin
    rings = max(RINGS, pieces_of(high - low, spacing))
    level = np.repeat(np.linspace(low, high, rings + 1), CORNERS_AROUND)
    angle = np.tile(np.linspace(0.0, 2.0 * np.pi, CORNERS_AROUND, endpoint=False), rings + 1)

    def place(angle: FloatArray, level: FloatArray) -> FloatArray:
        radius = reach(angle, level)
        return np.asarray(point + np.column_stack([radius * np.cos(angle), radius * np.sin(angle), level]) @ frame)

    rise = SLOPE_STEP_ANGLE * (ends[1] - ends[0])
    around = place(angle + SLOPE_STEP_ANGLE, level) - place(angle - SLOPE_STEP_ANGLE, level)
    along = place(angle, level + rise) - place(angle, level - rise)
    faces = outside(ring_faces(CORNERS_AROUND, rings), hollow)
    return _touched(place(angle, level), np.cross(around, along), faces, hollow, cloud)
