"""Shapes: what no straight line on a plate is, as a ball feels it: courses, letters, neighbours, and curved bodies.

A round wire of radius a about an axis keeps a ball's centre r + a away from the axis, a ball of radius b on the body
r + b from its own centre, and the smooth body r from itself; what a ball feels of all together is whichever keeps it
highest. So the heights of a tip that comes straight down are closed forms, apart from the house's contact. The axis is
sampled every 50 um, which leaves out (25 um)^2 / 2 (r + a) = 0.03 um.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from explore3d.bench.scenes.noise import SAMPLE_SPACING
from explore3d.bench.scenes.sections import EVERY, FIRST_BUILT_WITH, SECTION_TIP
from mapping import FloatArray, IntArray, Trace

WIRE_RADIUS, BALL_RADIUS = 0.325e-3, 0.65e-3
# White, of a sample, m: a tenth of the wire
SHAPE_NOISE = 0.06e-3
SHAPE_PITCH, SHAPE_HALF = 2e-3, 20e-3
AXIS_SPACING = 50e-6
# What shapes are moved by to either side, m: more than half a pitch, so that they lie anyhow under the rows
MOST_MOVED = 1.5e-3
# Step over which the slope of a body is taken, m: its bend over that is 1e-5 of a radian at most
SLOPE_STEP = 1e-7

# Heights at x and y (N,) of the surface that lies a distance (m) above a body, along its normals
Above = Callable[[FloatArray, FloatArray, float], FloatArray]


@dataclass(frozen=True, eq=False)
class Shape:
    """Wires or balls on a body.

    Args:
        kind: what each is.
        strokes: courses in plan, (K, 2) each, m; single points for balls.
        counts: fewest and most features that are right: where strokes meet or bend in corners, any way to cut them
            into lines is, from fewest strokes of a pen to all pieces between corners and junctions.
        closed: True of a course that returns: told as one line it has no ends.
        above: the body.
        turned: how far it is turned on the body, from and to, rad; wires by any number of quarter turns beyond.
        has_edge: True of a body with an edge, which is no detail on it and may be told.
    """

    kind: str
    strokes: tuple[FloatArray, ...]
    counts: tuple[int, int] = (1, 1)
    closed: bool = False
    above: Above = lambda x, y, d: np.full_like(x, d)
    turned: tuple[float, float] = (-0.25 * np.pi, 0.25 * np.pi)
    has_edge: bool = False


@dataclass(frozen=True, eq=False)
class FeltShape:
    """A shape where it lies, and what a ball feels of it.

    Args:
        shape: which.
        courses: (K, 3) on the body, m.
        height, widths: of each wire or ball; widths from half height to the foot, or the widest, m.
        trace: of the rows.
    """

    shape: Shape
    courses: tuple[FloatArray, ...]
    height: float
    widths: tuple[float, float]
    trace: Trace


def _saddle(radius: float) -> Above:
    return _along_normals(
        lambda x, y: 0.5 * (x * x - y * y) / radius,
        lambda x, y: (x / radius, -y / radius),
    )


def _cone(slope: float, aside: float) -> Above:
    """A cone whose tip lies aside of the middle, m."""
    return _along_normals(
        lambda x, y: slope * (aside - np.hypot(x + aside, y)),
        lambda x, y: (-slope * (x + aside) / np.hypot(x + aside, y), -slope * y / np.hypot(x + aside, y)),
    )


def _along_normals(z: Callable[..., FloatArray], slope: Callable[..., tuple[FloatArray, FloatArray]]) -> Above:
    """The parallel surface of a height field: the place whose normal leads to x, y is sought by fixed-point steps,
    which contract where the body's radii of curvature are larger than the distance."""

    def above(x: FloatArray, y: FloatArray, distance: float) -> FloatArray:
        u, v = x, y
        for _ in range(100):
            gx, gy = slope(u, v)
            steep = np.sqrt(1.0 + gx**2 + gy**2)
            u, v = 0.5 * (u + x + distance * gx / steep), 0.5 * (v + y + distance * gy / steep)
        gx, gy = slope(u, v)
        return np.asarray(z(u, v) + distance / np.sqrt(1.0 + gx**2 + gy**2))

    return above


def _bent(radius: float, angle: float) -> Above:
    """Two planes along y, each sloping by an angle, with an arc between them: a fillet, or of radius 0 or less (m) an
    edge: what is parallel to it is the same with another radius."""

    def above(x: FloatArray, y: FloatArray, distance: float) -> FloatArray:
        own, out = radius - distance, np.abs(x)
        reach = abs(own) * np.sin(angle)
        arc = own - np.sign(own) * np.sqrt(own**2 - np.minimum(out, reach) ** 2)
        side = 1.0 if radius > 0.0 else -1.0
        return np.asarray(distance + arc + side * np.tan(angle) * np.maximum(out - reach, 0.0))

    return above


def _arc(middle: tuple[float, float], radius: float, begin: float, end: float) -> FloatArray:
    t = np.linspace(begin, end, 400)
    return np.asarray(np.array(middle) + radius * np.column_stack([np.cos(t), np.sin(t)]))


def _two_arcs(radius: float, angle: float) -> FloatArray:
    """An S: two arcs of so many radians that bend either way."""
    first = _arc((0.0, radius), radius, 1.5 * np.pi - angle, 1.5 * np.pi)
    return np.vstack([first, -first[-2::-1]])


def _spiral() -> FloatArray:
    """Of Archimedes, 6.3 mm from turn to turn."""
    t = np.linspace(0.8 * np.pi, 4.5 * np.pi, 800)
    return 1e-3 * np.column_stack([t * np.cos(t), t * np.sin(t)])


def _star() -> FloatArray:
    t, far = 0.5 * np.pi + np.arange(11) * np.pi / 5.0, np.where(np.arange(11) % 2 == 0, 14e-3, 6.5e-3)
    return np.asarray(far[:, None] * np.column_stack([np.cos(t), np.sin(t)]))


def _mm(*points: tuple[float, float]) -> FloatArray:
    return 1e-3 * np.array(points, dtype=np.float64)


_STRAIGHT = _mm((-12, 0), (12, 0))


def _side_by_side(apart: float) -> tuple[FloatArray, ...]:
    return tuple(_STRAIGHT + np.array([0.0, side * 0.5 * apart]) for side in (-1.0, 1.0))


FELT_SHAPES: dict[str, Shape] = {
    "S 3 mm": Shape("ridge", (_two_arcs(3e-3, 1.5 * np.pi - 0.3),)),
    "S 6 mm": Shape("ridge", (_two_arcs(6e-3, 1.5 * np.pi - 0.3),)),
    "S 10 mm": Shape("ridge", (_two_arcs(10e-3, 0.5 * np.pi),)),
    "S 30 mm": Shape("ridge", (_two_arcs(30e-3, 0.45),)),
    "spiral": Shape("ridge", (_spiral(),)),
    "star": Shape("ridge", (_star(),), (1, 10), closed=True),
    "A": Shape("ridge", (_mm((-5, -7), (0, 7), (5, -7)), _mm((-3.2, -2), (3.2, -2))), (2, 5)),
    "H": Shape("ridge", (_mm((-5, -7), (-5, 7)), _mm((5, -7), (5, 7)), _mm((-5, 0), (5, 0))), (3, 5)),
    "L": Shape("ridge", (_mm((-4, 8), (-4, -7), (6, -7)),), (1, 2)),
    "O": Shape("ridge", (_arc((0.0, 0.0), 7e-3, 0.0, 2.0 * np.pi),), closed=True),
    "T": Shape("ridge", (_mm((-7, 6), (7, 6)), _mm((0, 6), (0, -8))), (2, 3)),
    "Z": Shape("ridge", (_mm((-6, 7), (6, 7), (-6, -7), (6, -7)),), (1, 3)),
    **{f"{apart} mm apart": Shape("ridge", _side_by_side(1e-3 * apart), (2, 2)) for apart in (1, 2, 3, 5)},
    "on a saddle": Shape("ridge", (_STRAIGHT,), above=_saddle(120e-3)),
    "on a cone": Shape("ridge", (_STRAIGHT,), above=_cone(0.35, 60e-3)),
    # along the fillet or across it
    "in a fillet": Shape("ridge", (_STRAIGHT,), above=_bent(20e-3, np.pi / 6.0), turned=(-0.4, 0.4)),
    # as near as where the ball feels both
    "beside an edge": Shape("bump", (_mm((4.5, 0)),), above=_bent(0.0, np.pi / 9.0), turned=(0.0, 0.0), has_edge=True),
}


def felt_shape(name: str, seed: int) -> FeltShape:
    """A shape as rows 2 mm apart feel it: of even seeds in two directions, of odd ones in one.

    Args:
        name: of FELT_SHAPES.
        seed: of place, rows and noise; from FIRST_BUILT_WITH on the wires have sizes of their own.
    """
    shape, rng = FELT_SHAPES[name], np.random.default_rng((seed, 1 + list(FELT_SHAPES).index(name)))
    size = 1.0 if seed < FIRST_BUILT_WITH else float(rng.uniform(0.8, 1.25))
    angle, moved = _placed(shape, rng)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    plans = [resampled(stroke @ turn.T + moved, AXIS_SPACING) for stroke in shape.strokes]
    feet, sweep = _rows(rng, two_ways=seed % 2 == 0)
    radius = size * (WIRE_RADIUS if shape.kind == "ridge" else BALL_RADIUS)
    lifted = radius if shape.kind == "ridge" else 0.0  # a wire lies on the body, a ball's centre in it
    axes = [np.column_stack([plan, shape.above(plan[:, 0], plan[:, 1], lifted)]) for plan in plans]
    height = np.maximum(
        shape.above(feet[:, 0], feet[:, 1], SECTION_TIP), _over(feet, np.vstack(axes), SECTION_TIP + radius)
    )
    height += SHAPE_NOISE * rng.standard_normal(len(feet))
    trace = Trace(2e-4 * np.arange(float(len(feet))), np.column_stack([feet, height]), sweep, SECTION_TIP)
    courses = tuple(axis - lifted * _normals(shape.above, axis, lifted) for axis in axes)
    if shape.kind == "ridge":
        return FeltShape(shape, courses, 2.0 * radius, (2.0 * radius, 2.0 * radius), trace)
    return FeltShape(shape, courses, radius, (float(np.sqrt(3.0)) * radius, 2.0 * radius), trace)


def _placed(shape: Shape, rng: np.random.Generator) -> tuple[float, FloatArray]:
    """How far a shape is turned, rad, and moved (2,), m."""
    angle = float(rng.uniform(*shape.turned))
    if shape.kind == "ridge":
        angle += float(rng.integers(4)) * 0.5 * np.pi
    return angle, rng.uniform(-MOST_MOVED, MOST_MOVED, 2) * (1.0 if shape.kind == "ridge" else [0.5, 1.0])


def _rows(rng: np.random.Generator, *, two_ways: bool) -> tuple[FloatArray, IntArray]:
    """Places (N, 2) of the rows' samples, m, and the number (N,) of each one's row."""
    run = np.arange(-SHAPE_HALF, SHAPE_HALF, EVERY * SAMPLE_SPACING)
    rows = []
    for along in (0, 1) if two_ways else (0,):
        for aside in np.arange(-SHAPE_HALF, SHAPE_HALF, SHAPE_PITCH) + rng.uniform(0.0, SHAPE_PITCH):
            row = np.column_stack([run, np.full(len(run), aside)])
            rows.append(row if along == 0 else row[:, ::-1])
    return np.vstack(rows), np.repeat(np.arange(len(rows), dtype=np.int64), len(run))


def resampled(stroke: FloatArray, spacing: float) -> FloatArray:
    """Points along a polyline (K, D), at most a spacing apart; a point as it is."""
    legs = np.linalg.norm(np.diff(stroke, axis=0), axis=1)
    s = np.concatenate([[0.0], np.cumsum(legs)])
    if not s[-1] > 0.0:
        return stroke[:1]
    places = np.linspace(0.0, s[-1], int(np.ceil(s[-1] / spacing)) + 1)
    return np.column_stack([np.interp(places, s, each) for each in stroke.T])


def _normals(above: Above, points: FloatArray, distance: float) -> FloatArray:
    """(K, 3) unit normals at points (K, 3) so far above a body: parallel surfaces share them."""
    x, y, _ = points.T
    half = 0.5 * SLOPE_STEP
    slopes = [
        (above(x + half * i, y + half * j, distance) - above(x - half * i, y - half * j, distance)) / SLOPE_STEP
        for i, j in ((1.0, 0.0), (0.0, 1.0))
    ]
    outward = np.column_stack([-slopes[0], -slopes[1], np.ones(len(x))])
    return np.asarray(outward / np.linalg.norm(outward, axis=1, keepdims=True))


def _over(feet: FloatArray, axis: FloatArray, reach: float) -> FloatArray:
    """(N,) heights of centres over feet (N, 2) that touch a ball of a radius (m) about any of some points (K, 3)."""
    highest = np.full(len(feet), -np.inf)
    for part in np.array_split(np.arange(len(feet)), max(len(feet) // 4000, 1)):
        square = ((feet[part, None] - axis[None, :, :2]) ** 2).sum(axis=2)
        touched = np.where(square < reach**2, axis[:, 2] + np.sqrt(np.maximum(reach**2 - square, 0.0)), -np.inf)
        highest[part] = touched.max(axis=1)
    return highest
