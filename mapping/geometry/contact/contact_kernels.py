"""The first contact of a moving ball with many triangles (numba).

Lengths are in the body's own frame: centred, and scaled so that the larger of body and ball is about 1.
A Row i of `rows` (F, 12) holds a triangle's corners and its unit normal. A `ball` is (radius, reach, graze): it
touches what is within its reach, and passes what it would sink into by less than `graze`.
"""

from __future__ import annotations

from math import inf, nan, sqrt

from mapping.geometry.mesh import (
    borrowing,
    closest,
    closing_step,
    corners,
    cross,
    dot,
    enter_face,
    enter_triangle,
    inlined,
    moved,
    push_lanes,
    sub,
    vector,
)

CONTACT_TOLERANCE = 1e-9  # relative to the radius: what lies this close to the resting ball touches it
# relative to the radius, sqrt(8 CONTACT_TOLERANCE): dents narrower than this are shallower than CONTACT_TOLERANCE
DISTINCT_CONTACT_GAP = 9e-5
GLANCING = 1e-3  # cosine below which a step along the way says little about the gap
MOST_DISTINCT_CONTACTS = 16  # distinct contacts that are told apart


@inlined
def stays_above(rows, i, end, d, reach):  # type: ignore[no-untyped-def]
    """True if a ball on its way along d to `end` stays further than `reach` from a triangle's plane."""
    n = (rows[i, 9], rows[i, 10], rows[i, 11])
    height = n[0] * (rows[i, 0] - end[0]) + n[1] * (rows[i, 1] - end[1]) + n[2] * (rows[i, 2] - end[2])
    return abs(height) > reach and height * dot(d, n) >= 0.0


@inlined
def meet(rows, i, o, d, ball, start, far):  # type: ignore[no-untyped-def]
    """When a ball free at o meets the triangle: 0 <= t < far, inf if never, -1 if it overlaps it at o.

    `start`: see `enter_triangle`.
    """
    a, b, c, n = corners(rows, i, o)
    if abs(dot(d, n)) > GLANCING:
        enter = enter_face(a, b, c, n, d, ball[0])
        if 0.0 <= enter < inf:  # the whole triangle lies behind that plane: nothing of it is met before
            return enter
    return enter_triangle(a, b, c, n, d, ball, start, far)


@inlined
def first_touch(rows, leaves, boxes, links, ball, o, d, best, hit, near, stack, waiting, apart, late):  # type: ignore[no-untyped-def]
    """Search for the earliest contact before `best`, when the triangle `hit` is met (-1: no contact is known yet).

    The nodes stack[:waiting] are searched. Returns (t, triangle or -1, kept): near[:kept] are all triangles that may
    touch at t. t = -1: the ball overlaps the triangle at the start.
    """
    radius, reach, graze = ball
    kept = 0
    end = moved(o, best, d)
    while waiting > 0 and best >= 0.0:
        i = -1 - stack[waiting - 1]
        if i < 0:
            waiting = push_lanes(leaves, boxes, links, stack, waiting, o, end, d, best, reach, apart, late)
            continue
        waiting -= 1
        if stays_above(rows, i, end, d, reach):
            continue
        p = closest(rows, i, end)
        gap, closing = sqrt(dot(p, p)), dot(p, d)
        ahead = closing >= 0.0
        if ahead and gap > reach:
            continue
        if not (ahead and gap >= radius - graze):  # else it is only just touched, or less
            start = best + closing_step(gap, closing, radius) if closing > 0.0 else 0.0
            if start * closing <= graze * gap:  # else the gap at o is larger by more than that: it does not rest there
                start = 0.0
            t = meet(rows, i, o, d, ball, start, best)
            if t < best:
                best, hit = t, i
                end = moved(o, best, d)
        near[kept] = i
        kept += 1
    return best, hit, kept


@borrowing
def further(p, d, radius):  # type: ignore[no-untyped-def]
    """How much further along d a ball rests on the point p that it all but touches; inf if it slides along it."""
    gap = sqrt(dot(p, p))
    cosine = dot(p, d) / gap
    return (gap - radius) / cosine if cosine > GLANCING else inf


@inlined
def settle(rows, order, near, steps, touched, kept, hit, o, d, ball):  # type: ignore[no-untyped-def]
    """(triangle, step, kept): which of the near triangles stops the ball first, and how much further along d than o.

    Of those that differ by rounding it is the face of the lowest number: no order of search can change that.
    near[:kept] shrinks to the triangles within reach. steps, touched: room for a number and a point, relative to o, of
    each triangle that `near` has room for.
    """
    radius, reach, graze = ball
    own, least, stay = nan, inf, 0
    for i in range(kept):
        p = closest(rows, near[i], o)
        step = further(p, d, radius)
        if near[i] == hit:
            own = step
        if dot(p, p) <= reach * reach:
            near[stay], steps[stay] = near[i], step
            touched[stay, 0], touched[stay, 1], touched[stay, 2] = p
            stay += 1
            least = min(least, step)
    if own != own:
        own = further(closest(rows, hit, o), d, radius)
    least = min(least, 0.0 if own == inf else own)
    first = -1
    for i in range(stay):
        lower = first < 0 or order[near[i]] < order[first]
        if lower and steps[i] <= least + 0.25 * graze:
            first = near[i]
    return first if first >= 0 else hit, least, stay


@inlined
def count_contacts(near, touched, kept, more, d, own, first, ball, points):  # type: ignore[no-untyped-def]
    """Number of distinct places that a ball touches which rests `more` further along d than where it touches the points
    `touched` (K, 3) of the near triangles: `first`, that of the triangle `own`, among them.

    That is further by rounding only, and so are the places on the triangles.
    """
    apart = DISTINCT_CONTACT_GAP * ball[0]
    found = 1
    points[0, 0], points[0, 1], points[0, 2] = first
    for i in range(kept):
        if near[i] == own:
            continue
        p = moved(vector(touched, i), -more, d)
        new = found < MOST_DISTINCT_CONTACTS and dot(p, p) <= ball[1] * ball[1]
        for j in range(found):
            w = sub(p, vector(points, j))
            new = new and dot(w, w) > apart * apart
        if new:
            points[found, 0], points[found, 1], points[found, 2] = p
            found += 1
    return found


@inlined
def feature_of(rows, i, o, p, rounding):  # type: ignore[no-untyped-def]
    """1 face, 2 edge, 3 vertex: the smallest part of the triangle that holds the point p relative to o."""
    a, b, c, _ = corners(rows, i, o)
    square, feature = rounding * rounding, 1
    for u, v in ((a, b), (b, c), (c, a)):
        w, e = sub(p, u), sub(v, u)
        if dot(w, w) <= square:
            return 3
        across = cross(e, w)
        if dot(across, across) <= square * dot(e, e):
            feature = 2
    return feature


@borrowing
def way_to_body(o, d, around):  # type: ignore[no-untyped-def]
    """(start, length) of the part of a ray within a sphere around the body; length < 0 if it misses it."""
    middle = -dot(o, d)
    lateral = moved(o, middle, d)
    miss = sqrt(dot(lateral, lateral))
    around += 1e-12 * abs(middle)
    half = sqrt(max((around - miss) * (around + miss), 0.0))
    if miss > around or middle + half < 0.0:
        return 0.0, -1.0
    start = max(0.0, middle - half)
    return start, middle + half - start
