"""Closed-form traces of fine features: height of the ball's centre over the base's own trace.

Dilation distributes over unions, so the trace of base and feature together is the larger of their traces: every
height of a protruding shape here is floored at 0, and heights of several shapes combine by `numpy.maximum`.

Reference: theory section 4; paper sections 2.2 and 3.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike

from mapping import BoolArray, FloatArray, ShapeError


def contact_half_width(height: ArrayLike, radius: ArrayLike, tip_radius: float) -> FloatArray:
    """Lateral distance of the kinks from the crest: where a cap's trace meets the base's trace, m.

    x_c = sqrt(H (2 R - H)), R = radius + tip_radius; sqrt(2 r D) for a wire of diameter D lying on a plane.
    """
    crest = np.asarray(height, dtype=np.float64)
    total = np.asarray(radius, dtype=np.float64) + tip_radius
    return np.asarray(np.sqrt(np.clip(crest * (2.0 * total - crest), 0.0, None)))


def kink_angle(height: ArrayLike, radius: ArrayLike, tip_radius: float) -> FloatArray:
    """Angle by which the trace turns at a cap's kink, rad: 2 atan(sqrt(a/r)) for a wire on a plane (H = 2a).

    sin^2(phi/2) = H/(2 R), in the form that keeps its digits when H is small against R.
    """
    total = np.asarray(radius, dtype=np.float64) + tip_radius
    crest = np.asarray(height, dtype=np.float64)
    return np.asarray(2.0 * np.arctan2(np.sqrt(crest), np.sqrt(np.clip(2.0 * total - crest, 0.0, None))))


def cap_height(x: ArrayLike, height: ArrayLike, radius: ArrayLike, tip_radius: float) -> FloatArray:
    """Trace over a plane's trace at lateral distance x of a round crest (cylinder or sphere cap), floored at 0, m.

    H - x^2 / (R + sqrt((R - x)(R + x))) with R = radius + tip_radius.

    Args:
        x: lateral distance from the crest, m; any shape, broadcast with the rest.
        height: height H of the crest above the plane, m.
        radius: radius of the cap, m, not negative (0: a needle or a knife edge).
        tip_radius: radius r of the fingertip, m, positive.
    """
    _require_tip(tip_radius)
    total = np.asarray(radius, dtype=np.float64) + tip_radius
    distance = np.minimum(np.abs(np.asarray(x, dtype=np.float64)), total)
    drop = distance**2 / (total + np.sqrt((total - distance) * (total + distance)))
    return np.asarray(np.maximum(np.asarray(height, dtype=np.float64) - drop, 0.0))


def step_height(x: ArrayLike, height: ArrayLike, tip_radius: float, run: ArrayLike = 0.0) -> FloatArray:
    """Trace of an upward step of height h >= 0 with its middle at x = 0, low side at x < 0, m.

    0 up to the kink at -sqrt(2 r h - h^2), then an arc of radius r about the edge, then h. Up a wall of h > r the ball
    goes straight, at x = -r, until its middle is as high as the edge.
    A slanted step climbs evenly over a run w from -w/2 to w/2. Where the ball rests on its flank, of length
    f = sqrt(w^2 + h^2), at t from its foot, its middle lies r h / f before that and r (1 - w / f) less than r above it;
    flanks steeper than the ball's own at the kink are never touched.
    """
    _require_tip(tip_radius)
    place, high = np.asarray(x, dtype=np.float64), np.asarray(height, dtype=np.float64)
    inside = np.clip(0.5 * np.asarray(run, dtype=np.float64) - place, 0.0, None)
    arc = np.where(inside < tip_radius, cap_height(inside, height, 0.0, tip_radius), 0.0)
    if not np.any(run):
        return arc
    width = np.maximum(run, np.finfo(float).tiny)
    flank = np.hypot(width, high)
    at = place + 0.5 * width + tip_radius * high / flank
    line = at * high / width - tip_radius * high**2 / (flank * (flank + width))
    return np.asarray(np.maximum(arc, np.where((at >= 0.0) & (at <= width), line, 0.0)))


def untouched_run(height: ArrayLike, tip_radius: float) -> FloatArray:
    """Longest run of a slanted step whose flank the ball never touches, m: it leaves the trace of an upright one.

    The ball that rests on the ground and on the upper edge lies on a flank of the slope sqrt(2 r h - h^2) / (r - h).
    """
    high = np.asarray(height, dtype=np.float64)
    kink = contact_half_width(high, 0.0, tip_radius)
    return np.asarray(high * np.clip(tip_radius - high, 0.0, None) / np.maximum(kink, np.finfo(float).tiny))


def groove_height(
    x: ArrayLike, width: ArrayLike, tip_radius: float, depth: ArrayLike = np.inf, base_curvature: ArrayLike = 0.0
) -> FloatArray:
    """Trace (negative) across a rectangular groove centred at x = 0, m: the ball rests on the nearer rim.

    Args:
        x: lateral distance from the groove's middle, m.
        width: width b between the rims, m; at b >= 2 r the ball reaches the bottom in the middle.
        tip_radius: radius r of the fingertip, m.
        depth: depth of the bottom, m, which the ball cannot pass.
        base_curvature: curvature of the base across the groove, 1/m, positive where it bulges outward.
    """
    rim = np.asarray(width, dtype=np.float64) / 2.0 - np.abs(np.asarray(x, dtype=np.float64))
    return rim_height(rim, tip_radius, depth, base_curvature)


def rim_height(
    distance: ArrayLike, tip_radius: float, depth: ArrayLike = np.inf, base_curvature: ArrayLike = 0.0
) -> FloatArray:
    """Trace (negative or 0) of a ball over a hollow at a distance inside its rim, m.

    The ball touches the nearest point of the rim: t = sqrt(r^2 - d^2) - r - k d^2 / 2, not below -depth.
    Serves grooves, pits of any outline, and their ends: only the distance to the rim counts.
    """
    _require_tip(tip_radius)
    inside = np.clip(np.asarray(distance, dtype=np.float64), 0.0, None)
    reach = np.minimum(inside, tip_radius)
    dip = reach**2 / (tip_radius + np.sqrt((tip_radius - reach) * (tip_radius + reach)))
    # Deeper than r - sqrt(r^2 - d^2) the rim is out of reach: only the bottom carries the ball.
    dip = np.where(inside > tip_radius, np.inf, dip + 0.5 * np.asarray(base_curvature) * reach**2)
    return np.asarray(-np.minimum(dip, np.asarray(depth, dtype=np.float64)))


def sphere_height(
    feet: ArrayLike, normals: ArrayLike, center: ArrayLike, radius: float, tip_radius: float
) -> FloatArray:
    """(N,) heights >= 0 at which the ball on each base normal touches a sphere; 0 where it misses, m.

    Args:
        feet: (N, 3) points q of the base, m.
        normals: (N, 3) outward unit normals n of the base there; the ball's centre is q + (r + t) n.
        center: (3,) centre of the sphere, m.
        radius: radius of the sphere, m.
        tip_radius: radius r of the fingertip, m.
    """
    _require_tip(tip_radius)
    feet, normals = _points(feet, "feet"), _points(normals, "normals")
    offset = feet - np.asarray(center, dtype=np.float64) + tip_radius * normals
    return np.maximum(_last_exit(offset, normals, radius + tip_radius), 0.0)


def chain_height(feet: ArrayLike, normals: ArrayLike, axis: ArrayLike, radius: float, tip_radius: float) -> FloatArray:
    """(N,) heights >= 0 at which the ball on each base normal leaves a chain of capsules; 0 where it misses, m.

    The exact outer envelope of the ridge of round section: each segment of the axis dilates to a capsule of radius
    a + r, and the ray q + (r + t) n leaves a capsule through its cylinder or through the sphere at either end. A
    capsule that the ball does not touch where it rests on the base does not lift it, though it may stand in its way
    further out, as a ridge on the other wall of an inner corner does.

    Args:
        feet: (N, 3) points q of the base, m.
        normals: (N, 3) outward unit normals n of the base there.
        axis: (K, 3) vertices of the capsules' axis, m; first equals last for a closed ridge; K = 1 is a sphere.
        radius: radius a of the capsules, m.
        tip_radius: radius r of the fingertip, m.
    """
    _require_tip(tip_radius)
    feet, normals, axis = _points(feet, "feet"), _points(normals, "normals"), _points(axis, "axis")
    total = radius + tip_radius
    height = np.zeros(len(feet))
    for vertex in axis:
        offset = feet - vertex + tip_radius * normals
        ahead = _lies_ahead(offset, normals, total)
        height = np.maximum(height, np.where(ahead, 0.0, _last_exit(offset, normals, total)))
    for start, end in itertools.pairwise(axis):
        offset, leg = feet - start + tip_radius * normals, end - start
        share = np.clip(offset @ leg / max(float(leg @ leg), np.finfo(float).tiny), 0.0, 1.0)
        ahead = _lies_ahead(offset - np.outer(share, leg), normals, total)
        height = np.maximum(height, np.where(ahead, 0.0, _cylinder_exit(offset, normals, leg, total)))
    return height


def _lies_ahead(offset: FloatArray, direction: FloatArray, radius: float) -> BoolArray:
    """(N,) True where something about a place is not reached yet, and comes nearer."""
    apart = np.einsum("ij,ij->i", offset, offset) > radius * radius
    return np.asarray(apart & (np.einsum("ij,ij->i", offset, direction) < 0.0))


def _last_exit(offset: FloatArray, direction: FloatArray, radius: float) -> FloatArray:
    """Largest t with |offset + t direction| = radius; -inf where there is none. Directions need not be unit."""
    square = np.einsum("ij,ij->i", direction, direction)
    along = np.einsum("ij,ij->i", offset, direction)
    distance = np.sqrt(np.einsum("ij,ij->i", offset, offset))
    gap = (distance - radius) * (distance + radius)
    discriminant = along**2 - square * gap
    root = np.sqrt(np.clip(discriminant, 0.0, None))
    # For along > 0 the textbook form (root - along) cancels: a fine feature under a large ball.
    stable = along > 0.0
    exit_at = np.divide(-gap, along + root, out=np.full(len(gap), -np.inf), where=stable)
    np.divide(root - along, square, out=exit_at, where=~stable & (square > 0.0))
    return np.asarray(np.where(discriminant >= 0.0, exit_at, -np.inf))


def _cylinder_exit(offset: FloatArray, direction: FloatArray, segment: FloatArray, radius: float) -> FloatArray:
    """Largest t at which the ray leaves the lateral face of a finite cylinder about segment; -inf where none."""
    length = float(np.linalg.norm(segment))
    if length == 0.0:
        return np.full(len(offset), -np.inf)
    unit = segment / length
    offset_along, direction_along = offset @ unit, direction @ unit
    exit_at = _last_exit(offset - np.outer(offset_along, unit), direction - np.outer(direction_along, unit), radius)
    finite = np.isfinite(exit_at)
    place = offset_along + np.where(finite, exit_at, 0.0) * direction_along
    return np.where(finite & (place >= 0.0) & (place <= length), exit_at, -np.inf)


def _points(array: ArrayLike, name: str) -> FloatArray:
    points = np.atleast_2d(np.asarray(array, dtype=np.float64))
    if points.ndim != 2 or points.shape[1] != 3:
        raise ShapeError(f"{name} must have shape (N, 3); found {points.shape}")
    return points


def _require_tip(tip_radius: float) -> None:
    if not tip_radius > 0.0:
        raise ShapeError(f"the fingertip needs a positive radius in metres; found {tip_radius!r}")
