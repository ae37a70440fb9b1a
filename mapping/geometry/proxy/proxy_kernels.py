"""One step of the proxy: a ball that follows a place as far as the body lets it (numba). Theory section 12.

The elements of a body are triangles, capsules, rings of bells and arcs of rims. A ball outside of a convex element
stays outside as long as its centre keeps to the side of the tangent plane at the nearest point. So every round projects
the wish on the half-spaces of the elements nearby; no motion within them can pass an element, however long it is.

Lengths are in the frame of the body's TriangleTree. `body` is the tuple that ProxyBody.arrays gives:
rows, leaves, boxes, links (the tree), depths (F,) of triangles that deeper trenches cut open (inf: none does),
rounds (M, 15), groups (G, 6), legs (C, 11) of the axes that triangles are cut open along (last column: 1 a first leg,
2 a last one), trenches (H, 7; last column: depth).
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from mapping.geometry.mesh import (
    STACK,
    closest,
    cross,
    dot,
    lanes,
    moved,
    push_lanes,
    scaled,
    sub,
    vector,
)
from mapping.geometry.proxy.halfspace_kernels import length, nearest_allowed

CAPSULE, RING, RIM = 0.0, 1.0, 2.0
MOST_NEIGHBOURS = 256  # elements within reach that are looked at together; more of them shorten the reach
RING_NEWTON_STEPS = (
    4  # the chord's nearest place is off by a part in a thousand of the ring's width: squared four times
)
FEW_NEIGHBOURS = 32  # with fewer it looks twice as far the next time
MOST_PROJECTIONS = 24  # projections in one step; what is left of the way is gone in the next
# Projections after those, which only lead out of what the ball is in: a bell's skirt and a pit's rim bend towards a
# ball, which on its way along the tangent plane gets in by the square of the way over their radius; out again it is
# Newton's method
MOST_WAYS_OUT = 8
# Of the radius: a shorter move ends the step. The error is its square over twice the radius: 1e-14 radii
STILL = 1e-7
# Of the device's motion: the ball goes about as far, and looks again where it goes further. By simulation (a hand at
# 0.1 m/s over 20 features, 1 kHz) a step takes 16.8 us with 1.2, 19.0 with 1.5 and 23.5 with 2
REACH_OF_MOTION = 1.2
SHORTEST_REACH = 1e-3  # of the radius: how far the ball may move beyond the device's own motion
FIRST_REACH = 0.25  # of the radius: how far it looks at first at most; further where nothing is near
ALLOWED = 1e-13  # of the radius: a half-space that is violated by less is kept
# Cosine between the normal and the way out of an element, below which the place is too deep to be projected at once
LEAST_COSINE_OUT = 0.05


@njit(cache=True)
def workspace():  # type: ignore[no-untyped-def]
    """What a step writes to: found, normals, bounds, numbers, active, weights, stack, apart, late."""
    room = lanes(2)
    return (
        np.empty(MOST_NEIGHBOURS, np.int64),
        np.empty((MOST_NEIGHBOURS, 3)),
        np.empty(MOST_NEIGHBOURS),
        np.empty(MOST_NEIGHBOURS, np.int64),
        np.empty(4, np.int64),
        np.empty(4),
        np.empty(STACK, np.int32),
        room[0],
        room[1],
    )


@njit(cache=True, error_model="numpy")
def on_segment(a, b, o):  # type: ignore[no-untyped-def]
    """Point of the segment ab closest to o."""
    e, w = sub(b, a), sub(o, a)
    square, along = dot(e, e), dot(w, e)
    if not along > 0.0 or square == 0.0:
        return a
    return b if along >= square else moved(a, along / square, e)


@njit(cache=True, error_model="numpy")
def is_cut_away(body, point, normal, depth):  # type: ignore[no-untyped-def]
    """True if a point of the base lies over a trench that is deeper than a depth, of which its face has the normal."""
    legs, trenches = body[7], body[8]
    for h in range(len(trenches)):
        if trenches[h, 6] <= depth:
            continue
        away = sub(point, vector(trenches, h))
        if dot(away, away) > trenches[h, 3] * trenches[h, 3]:
            continue
        for j in range(int(trenches[h, 4]), int(trenches[h, 5])):
            a, b = (legs[j, 0], legs[j, 1], legs[j, 2]), (legs[j, 3], legs[j, 4], legs[j, 5])
            way, from_a = sub(b, a), sub(point, a)
            along, ends = dot(from_a, way), legs[j, 10]
            if (along < 0.0 and (ends == 1.0 or ends == 3.0)) or (along > dot(way, way) and ends >= 2.0):
                continue  # a groove ends square
            off = sub(point, on_segment(a, b, point))
            if dot(off, off) < legs[j, 9] * legs[j, 9] and dot(normal, (legs[j, 6], legs[j, 7], legs[j, 8])) > 0.3:
                return True
    return False


@njit(cache=True, error_model="numpy")
def off_bell(rounds, j, o):  # type: ignore[no-untyped-def]
    """(distance of o from a ring of a bell, unit direction from it to o); -1 if o lies inside.

    The ring lies between two circles; its meridian is the bell's own between them, whose nearest place Newton's method
    finds from the nearest place of the chord.
    """
    axis = (rounds[j, 3], rounds[j, 4], rounds[j, 5])
    w = sub(o, vector(rounds, j))
    z = dot(w, axis)
    out = moved(w, -z, axis)
    rho = sqrt(dot(out, out))
    u0, z0, du, dz = rounds[j, 6], rounds[j, 7], rounds[j, 8] - rounds[j, 6], rounds[j, 9] - rounds[j, 7]
    if (rho - u0) * -dz + (z - z0) * du < 0.0:
        return -1.0, axis
    u = u0 + min(max(((rho - u0) * du + (z - z0) * dz) / (du * du + dz * dz), 0.0), 1.0) * du
    height, scale, p = rounds[j, 12], rounds[j, 13], rounds[j, 14]
    g = 0.0
    for _ in range(RING_NEWTON_STEPS):
        base = 1.0 + (u / scale) ** 2 / p
        g = height * base**-p
        slope = -2.0 * g * u / (scale * scale * base)
        bend = -2.0 * g / (scale * scale * base) * (1.0 - 2.0 * (p + 1.0) / p * (u / scale) ** 2 / base)
        stiff = 1.0 + slope * slope + (g - z) * bend
        if stiff > 0.0:
            u = min(max(u - ((u - rho) + (g - z) * slope) / stiff, u0), u0 + du)
    g = height * (1.0 + (u / scale) ** 2 / p) ** -p
    x, y = rho - u, z - g
    d = sqrt(x * x + y * y)
    if d == 0.0:
        return 0.0, axis
    return d, (moved(scaled(x / (d * rho), out), y / d, axis) if rho > 0.0 else axis)


@njit(cache=True, error_model="numpy")
def on_arc(rounds, j, o):  # type: ignore[no-untyped-def]
    """Point of an arc of a rim closest to o; its middle if o is on the axis of its circle."""
    center, axis, radius = vector(rounds, j), (rounds[j, 3], rounds[j, 4], rounds[j, 5]), rounds[j, 6]
    middle, cosine = (rounds[j, 7], rounds[j, 8], rounds[j, 9]), rounds[j, 10]
    aside = cross(axis, middle)
    w = sub(o, center)
    x, y = dot(w, middle), dot(w, aside)
    rho = sqrt(x * x + y * y)
    if rho == 0.0:
        return moved(center, radius, middle)
    if x < cosine * rho:  # beyond an end
        x, y = cosine, sqrt((1.0 - cosine) * (1.0 + cosine)) * (1.0 if y > 0.0 else -1.0)
    else:
        x, y = x / rho, y / rho
    return moved(moved(center, radius * x, middle), radius * y, aside)


@njit(cache=True, error_model="numpy")
def support(body, radius, code, o):  # type: ignore[no-untyped-def]
    """(gap, n): how far the ball at o is from an element, and the unit normal there; gap -1e9 if it is not there.

    `code` is a triangle, or -1 - j for row j of `rounds`.
    """
    nowhere = (0.0, 0.0, 0.0)
    if code >= 0:
        rows = body[0]
        q = closest(rows, code, o)
        d = sqrt(dot(q, q))
        depth = body[4][code]
        if depth < np.inf:
            normal = (rows[code, 9], rows[code, 10], rows[code, 11])
            over = moved(moved(o, 1.0, q), depth, normal)  # of a floor's point, the base's over it
            if is_cut_away(body, over, normal, depth):
                return -1e9, nowhere
        return d - radius, scaled(-1.0 / d, q)
    rounds, j = body[5], -1 - code
    if rounds[j, 11] == RING:
        d, n = off_bell(rounds, j, o)
        return (d - radius, n) if d >= 0.0 else (-1e9, n)
    if rounds[j, 11] == RIM:
        away = sub(o, on_arc(rounds, j, o))
        d = sqrt(dot(away, away))
        return d - radius, scaled(1.0 / d, away)
    away = sub(o, on_segment(vector(rounds, j), (rounds[j, 3], rounds[j, 4], rounds[j, 5]), o))
    d = sqrt(dot(away, away))
    n = scaled(1.0 / d, away)
    if dot(n, (rounds[j, 7], rounds[j, 8], rounds[j, 9])) < rounds[j, 10]:
        return -1e9, nowhere  # the low cap's sphere there is inside of the base
    return d - radius - rounds[j, 6], n


@njit(cache=True, error_model="numpy")
def gather(body, radius, o, reach, work):  # type: ignore[no-untyped-def]
    """Number of elements that the ball at o may touch within a reach, written to `found`; -1 if they are too many."""
    rows, leaves, boxes, links, groups = body[0], body[1], body[2], body[3], body[6]
    found, stack, apart, late = work[0], work[6], work[7], work[8]
    far, count = radius + reach, 0
    stack[0] = len(links) - 1
    waiting = 1
    while waiting > 0:
        i = -1 - stack[waiting - 1]
        if i < 0:
            waiting = push_lanes(leaves, boxes, links, stack, waiting, o, o, (0.0, 0.0, 0.0), 0.0, far, apart, late)
            continue
        waiting -= 1
        q = closest(rows, i, o)
        if dot(q, q) <= far * far:
            if count == MOST_NEIGHBOURS:
                return -1
            found[count] = i
            count += 1
    for g in range(len(groups)):
        away = sub(o, vector(groups, g))
        room = groups[g, 3] + far
        if dot(away, away) > room * room:
            continue
        for j in range(int(groups[g, 4]), int(groups[g, 5])):
            gap, _ = support(body, radius, -1 - j, o)
            # what a low cap's limit hides here may come into view on the way
            if gap <= reach:
                if count == MOST_NEIGHBOURS:
                    return -1
                found[count] = -1 - j
                count += 1
    return count


@njit(cache=True, error_model="numpy")
def projected(body, radius, code, n, x):  # type: ignore[no-untyped-def]
    """(True, place) nearest to x on the dilated element alone, if x lies between it and its skeleton, on n's side."""
    if code >= 0:
        q = closest(body[0], code, x)
        out, whole = scaled(-1.0, q), radius
    else:
        rounds, j = body[5], -1 - code
        if rounds[j, 11] == RING:
            d, way = off_bell(rounds, j, x)
            out, whole = scaled(max(d, 0.0), way), radius
        elif rounds[j, 11] == RIM:
            out, whole = sub(x, on_arc(rounds, j, x)), radius
        else:
            out = sub(x, on_segment(vector(rounds, j), (rounds[j, 3], rounds[j, 4], rounds[j, 5]), x))
            whole = radius + rounds[j, 6]
    d = length(out)
    if not (LEAST_COSINE_OUT * whole < d < whole) or dot(out, n) < LEAST_COSINE_OUT * d:
        return False, x
    return True, moved(x, whole / d - 1.0, out)


@njit(cache=True, error_model="numpy")
def follow(body, radius, o, x, reach, work):  # type: ignore[no-untyped-def]
    """(centre, touching): where a ball free at o comes to rest on its way to x.

    Every round is the projection on the half-spaces of the elements nearby, so the distance from x only falls. With
    one element active the wish is its own projection, which makes the rounds Newton's: the error is cubed by each.
    Where they do not suffice, it stays where it came to, but outside.
    """
    found, normals, bounds, numbers, active, weight = work[0], work[1], work[2], work[3], work[4], work[5]
    rounds, held, touching = 0, 0, False
    while rounds < MOST_PROJECTIONS + MOST_WAYS_OUT:
        near = gather(body, radius, o, reach, work)
        if near < 0:
            rounds += 1
            reach *= 0.5
            continue
        room = reach
        while rounds < MOST_PROJECTIONS + MOST_WAYS_OUT and room > 0.0:
            rounds += 1
            if rounds > MOST_PROJECTIONS:
                x = o
            count = 0
            for i in range(near):
                gap, n = support(body, radius, found[i], o)
                if gap > -1e8 and gap < room:
                    normals[count, 0], normals[count, 1], normals[count, 2] = n
                    bounds[count], numbers[count] = -gap, found[i]
                    count += 1
            wish = sub(x, o)
            step, held = nearest_allowed(normals, bounds, count, wish, ALLOWED * radius, active, weight)
            if held == 1:
                sure, place = projected(body, radius, numbers[active[0]], vector(normals, active[0]), x)
                if sure:
                    other, also = nearest_allowed(
                        normals, bounds, count, sub(place, o), ALLOWED * radius, active, weight
                    )
                    left, now = sub(wish, other), wish
                    if dot(left, left) <= dot(now, now):
                        step, held = other, max(also, 1)
            touching = held > 0 or (touching and rounds > MOST_PROJECTIONS)
            way = length(step)
            if way <= STILL * radius:
                return moved(o, 1.0, step), touching
            if way >= room:
                o = moved(o, room / way, step)
                reach, room = (2.0 if near < FEW_NEIGHBOURS else 1.0) * reach, 0.0
            else:
                o = moved(o, 1.0, step)
                room -= way
    return o, touching


@njit(cache=True, error_model="numpy", nogil=True)
def proxy_step(body, radius, friction, o, last, x, work):  # type: ignore[no-untyped-def]
    """(centre, touching) of the ball after the device moved from `last` to x.

    With friction the ball stays where it is while the pull is within the cone about the normal, and comes to rest on
    the cone's border when it is not (the god-object with friction of Harwin and Melder, 2002).

    Args:
        body, work: see above; the kernel keeps nothing else.
        radius: of the ball; friction: coefficient; o, last, x: (3,) tuples, all in the frame of the body.
    """
    moved_by = sub(x, last)
    reach = min(REACH_OF_MOTION * length(moved_by) + SHORTEST_REACH * radius, FIRST_REACH * radius)
    end, touching = follow(body, radius, o, x, reach, work)
    if friction == 0.0 or not touching:
        return end, touching
    pull, slip = sub(end, x), sub(end, o)
    along = length(slip)
    hold = friction * length(pull)
    if along <= hold:
        return o, True
    return follow(body, radius, o, moved(x, -hold / along, slip), reach, work)


@njit(cache=True, error_model="numpy", nogil=True)
def follow_path(body, radius, friction, start, path, centers, touching):  # type: ignore[no-untyped-def]
    """The ball's centres (N, 3) while the device moves along a path (N, 3), from a free centre (3,) on."""
    work = workspace()
    o, last = (start[0], start[1], start[2]), (start[0], start[1], start[2])
    for i in range(len(path)):
        x = vector(path, i)
        o, touch = proxy_step(body, radius, friction, o, last, x, work)
        centers[i, 0], centers[i, 1], centers[i, 2] = o
        touching[i] = touch
        last = x


@njit(cache=True, error_model="numpy")
def least_gap(body, radius, o, reach, work):  # type: ignore[no-untyped-def]
    """The smallest gap of the ball at o to any element; `reach` if none is within it, negative if it overlaps one."""
    near = gather(body, radius, o, reach, work)
    if near < 0:
        near = MOST_NEIGHBOURS
    least = reach
    for i in range(near):
        gap, _ = support(body, radius, work[0][i], o)
        if gap > -1e8:
            least = min(least, gap)
    return least


@njit(cache=True, error_model="numpy", nogil=True)
def least_gaps(body, radius, centers, reach, out):  # type: ignore[no-untyped-def]
    """`least_gap` of many balls."""
    work = workspace()
    for i in range(len(centers)):
        out[i] = least_gap(body, radius, vector(centers, i), reach, work)
