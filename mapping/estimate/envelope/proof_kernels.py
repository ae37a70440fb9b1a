"""How far a contact can be from a point of the estimated surface, proven from ball centres alone (compiled)."""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping.geometry.mesh import MOST_WAITING, borrowing, nearest_boxed, vector

# Constraints to a ball: the more, the sharper the bound and the slower (pairs of them are met). A raster gives six to
# eight, and some more where it is oblique to the body; leaving some out is allowed, for it only widens the bound. Of an
# oblique raster of a plate with holes 16 prove 39.0 % of the points within the distance of the sweeps, 32 39.1 %.
MOST_CONSTRAINTS = 32
# Rounding of a direction, by which corners of a patch may miss its other borders
DIRECTION_ROUNDING = 1e-12
# Share of a squared radius by which a contact must be within another ball for that ball to cut it off: more than
# rounding leaves of corners on its border, which would be cut again and again, and less than any bound tells
DENIAL = 1e-9


@borrowing
def farthest_contact(place, axes, bounds, count, contact):  # type: ignore[no-untyped-def]
    """Largest distance from `place` (3,) of the unit vectors m with axes m <= bounds; infinite if there are none.

    The set is a sphere without caps. The distance is largest where m points away from the place, at the far side of
    a border, or at a corner where two borders cross.

    Args:
        place: (3,) in tip radii, from the ball's centre.
        axes, bounds: (K, 3) unit vectors and (K,) cosines, of which `count` are meant.
        contact: (3,) to write the farthest of them to.
    """
    x, y, z = place[0], place[1], place[2]
    square = x * x + y * y + z * z
    length = np.sqrt(square)
    best = np.inf  # the smallest product of m and place
    if length > 0.0 and _allowed(-x / length, -y / length, -z / length, axes, bounds, count, -1, -1):
        contact[0], contact[1], contact[2] = -x / length, -y / length, -z / length
        return length + 1.0
    for j in range(count):
        u, v, w, t = axes[j, 0], axes[j, 1], axes[j, 2], bounds[j]
        along = x * u + y * v + z * w
        ax, ay, az = x - along * u, y - along * v, z - along * w
        aside = np.sqrt(ax * ax + ay * ay + az * az)
        if aside == 0.0:  # all of the border is as far: any of it serves
            ax, ay, az = (-v, u, 0.0) if abs(w) < 0.5 else (0.0, -w, v)
            aside = np.sqrt(ax * ax + ay * ay + az * az)
        side = np.sqrt(max(1.0 - t * t, 0.0))
        product = t * along - side * (x * ax + y * ay + z * az) / aside
        if product < best:
            share = side / aside
            m = (t * u - share * ax, t * v - share * ay, t * w - share * az)
            if _allowed(m[0], m[1], m[2], axes, bounds, count, j, j):
                best = product
                contact[0], contact[1], contact[2] = m
    for j in range(count):
        for k in range(j):
            cosine = axes[j, 0] * axes[k, 0] + axes[j, 1] * axes[k, 1] + axes[j, 2] * axes[k, 2]
            sine = (1.0 - cosine) * (1.0 + cosine)
            if sine <= 1e-15:
                continue  # borders about one axis do not cross
            a, b = (bounds[j] - cosine * bounds[k]) / sine, (bounds[k] - cosine * bounds[j]) / sine
            left = 1.0 - a * bounds[j] - b * bounds[k]
            if left < -DIRECTION_ROUNDING:
                continue
            height = np.sqrt(max(left, 0.0) / sine)
            fx, fy, fz = (
                a * axes[j, 0] + b * axes[k, 0],
                a * axes[j, 1] + b * axes[k, 1],
                a * axes[j, 2] + b * axes[k, 2],
            )
            cx = height * (axes[j, 1] * axes[k, 2] - axes[j, 2] * axes[k, 1])
            cy = height * (axes[j, 2] * axes[k, 0] - axes[j, 0] * axes[k, 2])
            cz = height * (axes[j, 0] * axes[k, 1] - axes[j, 1] * axes[k, 0])
            middle, reach = x * fx + y * fy + z * fz, x * cx + y * cy + z * cz
            for sign in (-1.0, 1.0):
                product = middle + sign * reach
                if product < best:
                    m = (fx + sign * cx, fy + sign * cy, fz + sign * cz)
                    if _allowed(m[0], m[1], m[2], axes, bounds, count, j, k):
                        best = product
                        contact[0], contact[1], contact[2] = m
    return np.inf if best == np.inf else np.sqrt(max(square + 1.0 - 2.0 * best, 0.0))


@njit(cache=True, error_model="numpy", nogil=True, inline="always")
def _allowed(x, y, z, axes, bounds, count, own, other):  # type: ignore[no-untyped-def]
    """True if a direction is within all bounds but those of its own borders."""
    for j in range(count):
        if j in (own, other):
            continue
        if x * axes[j, 0] + y * axes[j, 1] + z * axes[j, 2] > bounds[j] + DIRECTION_ROUNDING:
            return False
    return True


@njit(cache=True, error_model="numpy", nogil=True)
def proven_reach(  # type: ignore[no-untyped-def]
    points, owners, spot, starts, ring, centers, laid, boxes, sweep, outward, across, radius, slack, known, enough,
    below, above,
):  # fmt: skip
    """How far below each point its body may be, and how far above it may stand: written to `below` and `above`, m.

    Each ball of a sample touches the body somewhere on its own sphere, outside of all others, on the side that
    does not face `outward`. What is nearest of its owners' farthest contacts is the bound.

    Args:
        points: (M, 3).
        owners: (M, P) indices of vertices whose balls are asked, -1 for none.
        spot: (V,) sample of each vertex, -1 where it has none that is known to touch.
        starts, ring: neighbours of vertex v are ring[starts[v] : starts[v + 1]].
        centers, sweep: (N, 3) and (N,) of the samples.
        outward: (V, 3) of length one, of the vertices' samples.
        laid, boxes: the centres once more, and the boxes about them (see `nearest_boxed`).
        across: (V, 3) unit vectors across a lone sweep, in whose plane the contact is taken to be; else (0, 3).
        slack: by which two balls may overlap a contact of either, m.
        known: (N, 3) contacts, or (0, 3) if only positions are known.
        enough: what is below this is made no sharper, m.
    """
    axes, bounds = np.empty((MOST_CONSTRAINTS, 3)), np.empty(MOST_CONSTRAINTS)
    place, contact, waiting = np.empty(3), np.empty(3), np.empty(MOST_WAITING, np.int64)
    for m in range(len(points)):
        below[m], above[m] = np.inf, np.inf
        for p in range(owners.shape[1]):
            v = owners[m, p]
            if v < 0 or spot[v] < 0 or below[m] <= enough:
                continue
            s, apart, off = spot[v], 0.0, 0.0
            for i in range(3):
                place[i] = (points[m, i] - centers[s, i]) / radius
                apart += place[i] ** 2
                if len(known):
                    off += (points[m, i] - known[s, i]) ** 2
            above[m] = min(above[m], max(radius * (np.sqrt(apart) - 1.0), 0.0))
            if len(known):
                below[m] = min(below[m], np.sqrt(off))
                continue
            count = _constraints(v, s, spot, starts, ring, centers, sweep, outward, across, radius, slack, axes, bounds)
            reach = radius * farthest_contact(place, axes, bounds, count, contact)
            before = 0
            while enough < reach < np.inf and before < count < MOST_CONSTRAINTS:
                deepest = _holding(centers, s, contact, laid, boxes, radius, slack, waiting)
                if deepest < 0:
                    break  # no ball denies that contact: the bound is reached
                before = count
                count = _constraint(s, deepest, centers, laid, radius, slack, axes, bounds, count)
                reach = radius * farthest_contact(place, axes, bounds, count, contact)
            below[m] = min(below[m], reach)


@borrowing
def _holding(centers, s, contact, laid, boxes, radius, slack, waiting):  # type: ignore[no-untyped-def]
    """Which of the laid centres' balls denies ball s a contact in this direction most clearly; -1 if none does."""
    square = radius * radius * (1.0 - DENIAL) - 4.0 * radius * slack
    if square <= 0.0:
        return -1
    x, y, z = vector(centers, s)
    center = (x + radius * contact[0], y + radius * contact[1], z + radius * contact[2])
    return nearest_boxed(laid, boxes, 1, center, square, waiting)[1]


@njit(cache=True, error_model="numpy", nogil=True)
def _constraints(  # type: ignore[no-untyped-def]
    v, s, spot, starts, ring, centers, sweep, outward, across, radius, slack, axes, bounds
):
    """Write what bounds the direction from the ball of sample s to its contact; how many bounds there are."""
    axes[0], bounds[0] = outward[v], 0.0
    count = 1
    if len(across):
        axes[1], bounds[1] = across[v], 0.0
        axes[2], bounds[2] = -across[v], 0.0
        count = 3
    before, after = s, s
    near = 2.0 * np.sqrt(radius * slack)  # nearer balls tell less, for they may overlap
    for way in (-1, 1):
        k = s
        while 0 <= k + way < len(centers) and sweep[k + way] == sweep[s]:
            k += way
            distance = 0.0
            for i in range(3):
                distance += (centers[k, i] - centers[s, i]) ** 2
            if distance >= near * near:
                break
        if k != s:  # the last of the sweep, if none lies far enough
            count = _constraint(s, k, centers, centers, radius, slack, axes, bounds, count)
            before, after = (k, after) if way < 0 else (before, k)
    for e in range(starts[v], starts[v + 1]):
        if count == MOST_CONSTRAINTS:
            break
        k = spot[ring[e]]
        if k >= 0 and k != s and k != before and k != after:
            count = _constraint(s, k, centers, centers, radius, slack, axes, bounds, count)
    return count


@njit(cache=True, error_model="numpy", nogil=True, inline="always")
def _constraint(s, k, centers, others, radius, slack, axes, bounds, count):  # type: ignore[no-untyped-def]
    """Write that the contact of ball s is not inside ball k, if that says anything."""
    square = 0.0
    for i in range(3):
        square += (others[k, i] - centers[s, i]) ** 2
    distance = np.sqrt(square)
    if distance == 0.0:
        return count
    bound = (distance + 4.0 * radius * slack / distance) / (2.0 * radius)
    if bound >= 1.0:
        return count
    for i in range(3):
        axes[count, i] = (others[k, i] - centers[s, i]) / distance
    bounds[count] = bound
    return count + 1


@njit(cache=True)
def rings(faces, count):  # type: ignore[no-untyped-def]
    """Neighbours of each of `count` vertices: (count + 1,) starts and their list, by the sides of the faces."""
    starts = np.zeros(count + 1, np.int64)
    for f in range(len(faces)):
        for i in range(3):
            starts[faces[f, i] + 1] += 1
    for v in range(count):
        starts[v + 1] += starts[v]
    ring, filled = np.empty(3 * len(faces), np.int64), starts[:-1].copy()
    for f in range(len(faces)):
        for i in range(3):
            v = faces[f, i]
            ring[filled[v]] = faces[f, (i + 1) % 3]
            filled[v] += 1
    return starts, ring
