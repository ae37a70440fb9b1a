"""One triangle and one ball: the closest point, and when a moving ball meets it (closed forms, float64).

Every triangle (a, b, c, unit normal n) is given relative to the ball's centre, so nothing here loses digits
to a far origin. Degenerate triangles (a segment, a point) have the normal zero and are right all the same.
"""

from __future__ import annotations

from math import inf, sqrt

from numba import njit

from mapping.vector_kernels import cross, dot, moved, scaled, sub

PARALLEL = 1e-15  # cosine below which a ray runs along a plane: rounding alone tilts it by this much
SLIVER = 1e-14  # height over longest side below which a triangle is a segment: narrower than rounding


@njit(cache=True, error_model="numpy")
def unit_normal(a, b, c):  # type: ignore[no-untyped-def]
    """Unit normal of a triangle, zero where it has no area."""
    u, v, w = sub(b, a), sub(c, a), sub(c, b)
    uu, vv, ww = dot(u, u), dot(v, v), dot(w, w)
    longest = max(uu, vv, ww)
    # the two shorter sides give the most accurate product
    n = cross(v, w) if uu == longest else cross(u, w) if vv == longest else cross(u, v)
    length = sqrt(dot(n, n))
    if not length > SLIVER * longest:
        return (0.0, 0.0, 0.0)
    return scaled(1.0 / length, n)


@njit(cache=True, error_model="numpy")
def left_of(a, b, f, n):  # type: ignore[no-untyped-def]
    """Positive if f lies on the inner side of the edge ab of a triangle with normal n."""
    return dot(n, cross(sub(b, a), sub(f, a)))


@njit(cache=True, error_model="numpy")
def holds(a, b, c, n, f):  # type: ignore[no-untyped-def]
    """True if the triangle, its border included, holds the point f of its plane."""
    return left_of(a, b, f, n) >= 0.0 and left_of(b, c, f, n) >= 0.0 and left_of(c, a, f, n) >= 0.0


@njit(cache=True, error_model="numpy")
def closest_on_segment(a, b):  # type: ignore[no-untyped-def]
    """Point of the segment ab closest to the origin."""
    e = sub(b, a)
    square, along = dot(e, e), -dot(a, e)
    if not along > 0.0 or square == 0.0:
        return a
    if along >= square:
        return b
    return moved(a, along / square, e)


@njit(cache=True, error_model="numpy")
def closest_on_triangle(a, b, c, n):  # type: ignore[no-untyped-def]
    """Point of the triangle closest to the origin.

    The origin's foot on the plane comes first and the edges are judged from there: unlike barycentric
    coordinates from dot products, that holds for triangles 1e-12 times smaller than their distance.
    """
    foot = scaled(dot(a, n), n)
    flat = dot(n, n) == 0.0
    best, square = foot, inf
    for p, q in ((a, b), (b, c), (c, a)):
        if flat or left_of(p, q, foot, n) < 0.0:
            point = closest_on_segment(p, q)
            if dot(point, point) < square:
                best, square = point, dot(point, point)
    return best


@njit(cache=True, error_model="numpy")
def sweep_vertex(a, d, radius, graze):  # type: ignore[no-untyped-def]
    """(enter, leave): when a ball moving from the origin along d overlaps the point a; (inf, -inf) if never."""
    middle = dot(a, d)
    lateral = moved(a, -middle, d)
    miss = sqrt(dot(lateral, lateral))
    if miss >= radius - graze:
        return inf, -inf
    half = sqrt((radius - miss) * (radius + miss))
    return middle - half, middle + half


@njit(cache=True, error_model="numpy")
def sweep_edge(a, b, d, radius, graze):  # type: ignore[no-untyped-def]
    """(enter, leave) through the mantle of the cylinder around the edge ab."""
    e = sub(b, a)
    length = sqrt(dot(e, e))
    if length == 0.0:
        return inf, -inf
    e = scaled(1.0 / length, e)
    d_along, a_along = dot(d, e), dot(a, e)
    across, start = moved(d, -d_along, e), moved(a, -a_along, e)
    speed = dot(across, across)
    if speed == 0.0:
        return inf, -inf
    middle = dot(start, across) / speed
    lateral = moved(start, -middle, across)
    miss = sqrt(dot(lateral, lateral))
    if miss >= radius - graze:
        return inf, -inf
    half = sqrt((radius - miss) * (radius + miss) / speed)
    enter, leave = middle - half, middle + half
    if not 0.0 <= enter * d_along - a_along <= length:
        enter = inf
    if not 0.0 <= leave * d_along - a_along <= length:
        leave = -inf
    return enter, leave


@njit(cache=True, error_model="numpy")
def sweep_face(a, b, c, n, d, radius):  # type: ignore[no-untyped-def]
    """(enter, leave) through the two triangles offset by the radius along the normal and against it."""
    enter, leave = inf, -inf
    cosine, height = dot(d, n), dot(a, n)
    if abs(cosine) <= PARALLEL:
        return enter, leave
    for side in (-radius, radius):
        t = (height + side) / cosine
        if holds(a, b, c, n, moved(scaled(t, d), -side, n)):
            enter, leave = min(enter, t), max(leave, t)
    return enter, leave


@njit(cache=True, error_model="numpy")
def sweep_triangle(a, b, c, n, d, radius, graze):  # type: ignore[no-untyped-def]
    """(enter, leave): when a ball moving from the origin along the unit vector d overlaps the triangle.

    The triangle dilated by the ball is convex and bounded by offset faces, cylinders and spheres, so the
    earliest entry and the latest exit through any of them are its own. (inf, -inf) if the ball passes by
    or would sink in by less than `graze`. Times may be negative.
    """
    enter, leave = sweep_face(a, b, c, n, d, radius)
    for p, q in ((a, b), (b, c), (c, a)):
        t, u = sweep_vertex(p, d, radius, graze)
        enter, leave = min(enter, t), max(leave, u)
        t, u = sweep_edge(p, q, d, radius, graze)
        enter, leave = min(enter, t), max(leave, u)
    return enter, leave
