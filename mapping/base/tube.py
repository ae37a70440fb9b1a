"""Tube: a round body of no simple family, its radius a smooth function of angle and height about an axis."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mapping import FloatArray, IntArray, Surface
from mapping.base.quadrics import Cloud, Fitted, cylinder, outside, pieces_of, ring_faces
from mapping.base.star import SLOPE_STEP_ANGLE, bears, fitted, one_sided, touched
from mapping.geometry.mesh import spline_design

# Corners of the mesh around the body, and its rings along it if nobody asks for a spacing
CORNERS_AROUND, RINGS = 512, 128


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
    if not radius.min() > 0 or one_sided(np.column_stack([x, y]) / radius[:, None]):
        return None
    hollow = bool(straight.parameters.get("hollow", False))
    low, high = float(height.min()), float(height.max())
    pieces = int(np.clip((high - low) / (shortest * cloud.tip_radius), 1, 12))
    knots = np.concatenate([[low] * 3, np.linspace(low, high, pieces + 1), [high] * 3])
    if not bears(max(waves, 1), (2 * waves + 1) * (pieces + 3), float(np.median(radius)), cloud):
        return None
    each = np.concatenate([[0], np.repeat(np.arange(1, waves + 1), 2)])
    design = _rings(angle, height, each, knots)
    coefficients, missed = fitted(design, radius, np.repeat(each, pieces + 3), cloud)

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
    return touched(place(angle, level), np.cross(around, along), faces, hollow, cloud)
