"""Star: a round body of no simple family, its radius a smooth function of the direction from its middle."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mapping import FloatArray, IntArray, Surface
from mapping.base.quadrics import Cloud, Fitted, outside
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


def star(cloud: Cloud, degree: int) -> Fitted | None:
    """A star-shaped body: the radius is a sum of spherical harmonics of the direction from its middle.

    None of a body felt from one side, of one too small for so high a degree, and of too few centres.
    """
    middle = cloud.extent.mean(axis=0)
    away = cloud.points - middle
    radius = np.linalg.norm(away, axis=1)
    if not radius.min() > 0 or one_sided(away / radius[:, None]):
        return None
    if not bears(degree, (degree + 1) ** 2, float(np.median(radius)), cloud):
        return None
    degrees = np.repeat(np.arange(degree + 1.0), 2 * np.arange(degree + 1) + 1)
    hollow = cloud.hollow(away / radius[:, None])
    coefficients, missed = fitted(_harmonics(away, degree), radius, degrees, cloud)

    def reach(directions: FloatArray) -> FloatArray:
        return np.asarray(_harmonics(directions, degree) @ coefficients)

    parameters = {"middle": cloud.world(middle[None])[0].tolist(), "harmonics": coefficients.tolist()}
    if hollow:
        parameters["hollow"] = True
    return Fitted(
        "star body", parameters, missed, len(coefficients), lambda cloud, spacing: _ball(middle, reach, hollow, cloud)
    )


def one_sided(directions: FloatArray) -> bool:
    """True if the body was felt from one side only."""
    return bool(np.linalg.norm(directions.mean(axis=0)) > ALL_ABOUT)


def bears(waves: int, freedom: int, radius: float, cloud: Cloud) -> bool:
    """True if so many waves round the body are long enough, and the centres many enough to tell them."""
    long = 2.0 * np.pi * radius >= SHORTEST_WAVE * cloud.tip_radius * waves
    return long and len(cloud.points) >= 8 * freedom


def fitted(design: FloatArray, radius: FloatArray, waves: FloatArray, cloud: Cloud) -> tuple[FloatArray, FloatArray]:
    """Coefficients (P,) and misses (C,) m of the radii; where nothing was felt, as few departures as possible."""
    sd = DEPARTURE * float(np.median(radius)) / np.maximum(waves * (waves + 1.0), 1.0)
    prior = np.diag(cloud.floor / sd)[waves > 0]
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
    return touched(
        middle + place(unit), np.cross(along, across), outside(np.asarray(ball.faces), hollow), hollow, cloud
    )


def touched(centers: FloatArray, away: FloatArray, faces: IntArray, hollow: bool, cloud: Cloud) -> Surface:
    """The surface that balls at the centres (N, 3) touch, in the object frame; `away` (N, 3) from the body's middle."""
    way = (1.0 if hollow else -1.0) * away / np.linalg.norm(away, axis=1, keepdims=True)
    return Surface(cloud.world(centers + cloud.tip_radius * way), faces)
