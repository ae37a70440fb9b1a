"""Stability of ball-on-mesh contact and nearest points: scale, place, orientation, order, and grazing."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from explore3d.bench import bump_mesh
from explore3d.stability.exact_decimal import condition, exact, relative_error
from explore3d.stability.table import EPS, Answer, Case
from mapping import FloatArray, Surface
from mapping.geometry.contact import BallContact
from mapping.geometry.mesh import NearestPoint
from mapping.geometry.templates import BumpOfRevolution

CONTACT_BALL_RADIUS = 0.3
SCALES = tuple(10.0**k for k in (-9, -6, -3, 3, 6))
DOWN = np.array([0.0, 0.0, -1.0])


def body() -> Surface:
    """The paper's bump over a square of side 2, off the origin by a little: no plane of symmetry helps."""
    mesh = bump_mesh(2000)
    return Surface(mesh.vertices + np.array([0.013, -0.007, 0.003]), mesh.faces)


def starts(count: int = 400) -> FloatArray:
    """(N, 3) centres above the body."""
    xy = np.random.default_rng(3).uniform(-0.8, 0.8, (count, 2))
    return np.column_stack([xy, np.full(count, 3.0)])


def turned(angle: float = 1.1) -> FloatArray:
    """A rotation about an axis that is no coordinate axis."""
    x, y, z = np.array([1.0, 2.0, -0.7]) / np.linalg.norm([1.0, 2.0, -0.7])
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def touched(mesh: Surface, radius: float, start: FloatArray, way: FloatArray) -> FloatArray:
    """(N, 3) centres of the ball at the first contact."""
    return np.asarray(BallContact(mesh, radius).first_contact(start, way).centers)


def _largest(centers: FloatArray, reference: FloatArray, size: float = 2.0) -> float:
    if not np.isfinite(centers).all():
        return float("inf")
    return float(np.abs(centers - reference).max()) / size


def scaled() -> Answer:
    """Any unit of length gives the same answer, scaled."""
    reference = touched(body(), CONTACT_BALL_RADIUS, starts(), DOWN)
    errors = {}
    for scale in SCALES:
        mesh = Surface(scale * body().vertices, body().faces)
        errors[scale] = _largest(touched(mesh, scale * CONTACT_BALL_RADIUS, scale * starts(), DOWN) / scale, reference)
    worst = max(errors, key=lambda scale: errors[scale])
    return Answer(f"400 contacts at {len(SCALES)} scales, worst at {worst:g} m", errors[worst], 2.0, reason="rounding")


def powers_of_two() -> Answer:
    """A power of two rescales without any rounding: not a bit may differ."""
    reference = touched(body(), CONTACT_BALL_RADIUS, starts(), DOWN)
    different = 0
    for power in (-40, -13, 17, 40):
        scale = 2.0**power
        mesh = Surface(scale * body().vertices, body().faces)
        different += int(
            (touched(mesh, scale * CONTACT_BALL_RADIUS, scale * starts(), DOWN) != scale * reference).sum()
        )
    return Answer(f"{different} of 4800 coordinates differ", reason="bit for bit", holds=different == 0)


def far_origin(distance: float) -> Callable[[], Answer]:
    """The coordinates' own rounding, eps times the distance, and no more."""

    def run() -> Answer:
        # vertices that the far grid can hold exactly: what is measured is the method, not the input's rounding
        shift = np.array([distance, -distance, distance])
        grid = 2.0 ** np.ceil(np.log2(distance * 4 * EPS))
        mesh = Surface(np.round(body().vertices / grid) * grid, body().faces)
        start = np.round(starts() / grid) * grid
        reference = touched(mesh, CONTACT_BALL_RADIUS, start, DOWN)
        moved = touched(Surface(mesh.vertices + shift, mesh.faces), CONTACT_BALL_RADIUS, start + shift, DOWN) - shift
        return Answer(
            "400 contacts", _largest(moved, reference), distance / 2, reason="coordinates are eps times the distance"
        )

    return run


def rotated() -> Answer:
    """No direction is special."""
    rotation = turned()
    reference = touched(body(), CONTACT_BALL_RADIUS, starts(), DOWN)
    mesh = Surface(body().vertices @ rotation.T, body().faces)
    back = touched(mesh, CONTACT_BALL_RADIUS, starts() @ rotation.T, rotation @ DOWN) @ rotation
    # rounding the turned mesh moves the contact by more on the steep flank of the bump
    return Answer("400 contacts", _largest(back, reference), 10.0, reason="the flank is steep: rounding of the turn")


def reordered() -> Answer:
    """The order of faces and vertices is no geometry."""
    rng, mesh = np.random.default_rng(4), body()
    order = rng.permutation(len(mesh.vertices))
    place = np.argsort(order)
    faces = place[mesh.faces][rng.permutation(len(mesh.faces))]
    other = touched(Surface(mesh.vertices[order], np.roll(faces, 1, axis=1)), CONTACT_BALL_RADIUS, starts(), DOWN)
    return Answer(
        "400 contacts", _largest(other, touched(mesh, CONTACT_BALL_RADIUS, starts(), DOWN)), 1.0, reason="rounding"
    )


def doubled() -> Answer:
    """Every face twice, once turned inside out, and no vertex shared."""
    mesh = body()
    corners = mesh.vertices[np.concatenate([mesh.faces, mesh.faces[:, ::-1]])].reshape(-1, 3)
    soup = Surface(corners, np.arange(len(corners)).reshape(-1, 3))
    other = touched(soup, CONTACT_BALL_RADIUS, starts(), DOWN)
    return Answer(
        "400 contacts", _largest(other, touched(mesh, CONTACT_BALL_RADIUS, starts(), DOWN)), 1.0, reason="rounding"
    )


def _needle() -> Surface:
    """A point at the origin; the body falls away behind it, so that a ball before it can touch the point alone."""
    return Surface([[0.0, 0.0, 0.0], [-5.0, 1.0, -5.0], [-5.0, -1.0, -5.0]], [[0, 1, 2]])


def _rest(offset: Decimal, radius: Decimal) -> Decimal:
    return ((radius - offset) * (radius + offset)).sqrt()


def grazing() -> Answer:
    """A ball beside a needle's point by its radius less a 10th to a 1e-13th: it rests on it, ever lower."""
    ball, count, worst, share = BallContact(_needle(), 1.0), 0, Answer(""), -1.0
    for power in range(1, 14):
        offset = 1.0 - 10.0**-power
        height = float(ball.first_contact([[offset, 0.0, 3.0]], DOWN).centers[0, 2])
        true, allowed = exact(_rest, (offset, 1.0)), condition(_rest, (offset, 1.0))
        error = relative_error(height, true)
        count += 1
        if error / allowed > share:
            share = error / allowed
            worst = Answer(f"within 1e-{power} r of passing: height {height:.3g} r", error, allowed)
    reason = "the height vanishes like the root of what is left"
    return Answer(f"{count} distances, worst {worst.found}", worst.error, worst.condition, reason=reason)


def passing() -> Answer:
    """Beyond its radius the ball must pass, however near."""
    ball = BallContact(_needle(), 1.0)
    offsets = 1.0 + 10.0 ** -np.arange(1.0, 15.0)
    start = np.column_stack([offsets, np.zeros(14), np.full(14, 3.0)])
    count = ball.first_contact(start, DOWN).count
    return Answer(f"{int((count > 0).sum())} of 14 stopped", reason="outside the cylinder", holds=not count.any())


def tangent_wall() -> Answer:
    """Moving along a wall at a height of one radius, less a 1e-3rd to 1e-12th: in contact from the start, or free."""
    floor = Surface([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], [[0, 1, 2], [0, 2, 3]])
    ball = BallContact(floor, 1.0)
    gaps = np.array([1e-3, 1e-6, 1e-9, 1e-12])
    slopes = np.array([1e-2, 1e-4, 1e-6])
    worst = 0.0
    for gap in gaps:
        for slope in slopes:
            way = np.array([1.0, 0.0, -slope])
            start = np.array([[-5.0, 0.0, 1.0 + gap]])
            if gap / slope > 10.0:
                continue
            found = float(ball.first_contact(start, way).distance[0])
            true = ((1.0 + gap) - 1.0) / slope * sqrt(1.0 + slope * slope)
            # the gap itself is known to eps only
            worst = max(worst, abs(found - true) / true / ((1.0 + gap) / gap))
    reason = "counted in units of the condition number r / gap"
    return Answer(f"worst {worst / EPS:.1f} roundings of the gap", worst, 1.0, reason=reason)


def needle_of_extremes() -> Answer:
    """The ball on the paper's bump with a = 1e9: a needle 30 um wide at half its height, under balls of 1e-3 to 1e3."""
    mesh = BumpOfRevolution(1e9).mesh(1e-2, 400, 24)
    heights = [
        float(touched(mesh, r, np.array([[0.0, 0.0, 5.0 + 2 * r]]), DOWN)[0, 2]) - r for r in (1e-6, 1e-3, 1.0, 1e3)
    ]
    error = max(abs(height - 1.0) / max(1.0, r) for height, r in zip(heights, (1e-6, 1e-3, 1.0, 1e3), strict=True))
    return Answer("rests on the point at height 1 under balls of 1e-6 to 1e3", error, 1.0, reason="rounding")


def nearest_far() -> Answer:
    """Nearest points of the same mesh 1e6 sizes away from the coordinates' origin."""
    shift = np.array([1e6, 1e6, -1e6])
    grid = 2.0 ** np.ceil(np.log2(1e6 * 4 * EPS))
    mesh = Surface(np.round(body().vertices / grid) * grid, body().faces)
    points = np.round(starts() / grid) * grid
    near = NearestPoint(mesh).query(points).distance
    far = NearestPoint(Surface(mesh.vertices + shift, mesh.faces)).query(points + shift).distance
    reason = "coordinates are eps times the distance"
    return Answer("400 distances", float(np.abs(near - far).max() / near.max()), 1e6, reason=reason)


def brute_force() -> Answer:
    """Against every triangle, edge and vertex by closed forms in longer floats, without a tree."""
    mesh, start = bump_mesh(200), starts(60)
    found = touched(mesh, CONTACT_BALL_RADIUS, start, DOWN)
    best = np.array([_drop(mesh, np.asarray(xy, dtype=np.longdouble)) for xy in start[:, :2]])
    error = float(np.abs(found[:, 2] - best).max() / 2.0)
    return Answer("60 contacts", error, 2.0, reason="rounding")


def _drop(mesh: Surface, xy: NDArray[np.longdouble]) -> float:
    """Height at which the ball that comes down over xy rests: the highest of vertices, edges and faces."""
    corners = mesh.vertices[mesh.faces].astype(np.longdouble)
    radius = np.longdouble(CONTACT_BALL_RADIUS)
    heights = []
    for tip in mesh.vertices.astype(np.longdouble):
        aside = np.hypot(*(tip[:2] - xy))
        if aside < radius:
            heights.append(tip[2] + np.sqrt(radius**2 - aside**2))
    for a, b in np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]):
        edge = b - a
        unit = edge / np.sqrt(edge @ edge)
        level = np.sqrt(1 - unit[2] ** 2)
        aside = abs(unit[0] * (xy[1] - a[1]) - unit[1] * (xy[0] - a[0])) / level
        if aside < radius:
            # the circle of the cylinder's section, seen in the vertical plane through the edge
            run = (unit[0] * (xy[0] - a[0]) + unit[1] * (xy[1] - a[1])) / level
            height = a[2] + run * unit[2] / level + np.sqrt(radius**2 - aside**2) / level
            s = (np.array([*xy, height]) - a) @ unit
            if 0 <= s <= np.sqrt(edge @ edge):
                heights.append(height)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = normals / np.sqrt((normals**2).sum(axis=1))[:, None]
    for (a, b, c), n in zip(corners, normals, strict=True):
        height = a[2] + (radius - n[0] * (xy[0] - a[0]) - n[1] * (xy[1] - a[1])) / n[2]
        foot = np.array([*xy, height]) - radius * n
        inside = [np.cross(q - p, foot - p) @ n >= 0 for p, q in ((a, b), (b, c), (c, a))]
        if all(inside):
            heights.append(height)
    return float(max(heights))


CONTACT_CASES = [
    Case("contact", "scale", "the same contacts from 1e-9 to 1e6 m", scaled),
    Case("contact", "powers of two", "not a bit lost by scales 2^-40 to 2^40", powers_of_two),
    Case("contact", "origin 1e3 sizes away", "the same contacts", far_origin(1e3)),
    Case("contact", "origin 1e6 sizes away", "the same contacts", far_origin(1e6)),
    Case("contact", "rotation", "the same contacts, turned", rotated),
    Case("contact", "permutation", "the same contacts from shuffled faces and vertices", reordered),
    Case("contact", "duplication", "the same contacts from a soup with every face twice", doubled),
    Case("contact", "no tree", "the same contacts as every triangle in longer floats", brute_force),
    Case("contact", "grazing", "height on a needle's point as the ball is about to pass it", grazing),
    Case("contact", "just passing", "no contact beyond the radius by 1e-1 to 1e-14", passing),
    Case("contact", "near-tangent", "where a ball that sinks at slopes to 1e-6 lands", tangent_wall),
    Case("contact", "needle", "the bump with a = 1e9", needle_of_extremes),
    Case("contact", "nearest point 1e6 away", "the same distances", nearest_far),
]
