"""One triangle and one ball: the closest point, and when a moving ball meets it (closed forms, float64).

Every triangle (a, b, c, unit normal n) is given relative to the ball's centre, so nothing here loses digits
to a far origin. Degenerate triangles (a segment, a point) have the normal zero and are right all the same.
"""

from __future__ import annotations

from math import inf, sqrt

from numba import njit

from mapping.geometry.mesh.vector_kernels import cross, dot, moved, scaled, sub

PARALLEL_COSINE = 1e-15  # cosine below which a ray runs along a plane: rounding alone tilts it by this much
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
def enter_vertex(a, d, radius, graze):  # type: ignore[no-untyped-def]
    """When a ball moving from the origin along the unit vector d comes to touch the point a; inf if never."""
    middle = dot(a, d)
    lateral = moved(a, -middle, d)
    miss = sqrt(dot(lateral, lateral))
    if miss >= radius - graze:
        return inf
    return middle - sqrt((radius - miss) * (radius + miss))


@njit(cache=True, error_model="numpy")
def enter_edge(a, b, d, radius, graze):  # type: ignore[no-untyped-def]
    """When the ball comes to touch the edge ab between its ends; inf if never."""
    e = sub(b, a)
    length = sqrt(dot(e, e))
    if length == 0.0:
        return inf
    e = scaled(1.0 / length, e)
    d_along, a_along = dot(d, e), dot(a, e)
    across, start = moved(d, -d_along, e), moved(a, -a_along, e)
    speed = dot(across, across)
    if speed == 0.0:
        return inf
    middle = dot(start, across) / speed
    lateral = moved(start, -middle, across)
    miss = sqrt(dot(lateral, lateral))
    if miss >= radius - graze:
        return inf
    t = middle - sqrt((radius - miss) * (radius + miss) / speed)
    return t if 0.0 <= t * d_along - a_along <= length else inf


@njit(cache=True, error_model="numpy")
def enter_face(a, b, c, n, d, radius):  # type: ignore[no-untyped-def]
    """When the ball comes to touch the inside of the triangle, from whichever side it comes; inf if never."""
    cosine = dot(d, n)
    if abs(cosine) <= PARALLEL_COSINE:
        return inf
    side = -radius if cosine > 0.0 else radius
    t = (dot(a, n) + side) / cosine
    return t if holds(a, b, c, n, moved(scaled(t, d), -side, n)) else inf


@njit(cache=True, error_model="numpy")
def enter_triangle(a, b, c, n, d, radius, graze):  # type: ignore[no-untyped-def]
    """When a ball moving from the origin along the unit vector d comes to touch the triangle; inf if never.

    The triangle dilated by the ball is convex and bounded by two offset faces, cylinders and spheres; the
    earliest entry through any of them is its own. Nothing is entered before the offset faces' planes. A
    ball that would sink in by less than `graze` passes. Times may be negative: when it entered.
    """
    t = enter_face(a, b, c, n, d, radius)
    if t < inf:
        return t
    t = min(enter_vertex(a, d, radius, graze), enter_vertex(b, d, radius, graze), enter_vertex(c, d, radius, graze))
    return min(
        t, enter_edge(a, b, d, radius, graze), enter_edge(b, c, d, radius, graze), enter_edge(c, a, d, radius, graze)
    )


@njit(cache=True, error_model="numpy")
def leave_triangle(a, b, c, n, d, radius, graze):  # type: ignore[no-untyped-def]
    """When the ball leaves the triangle again; -inf if it never touches it."""
    return -enter_triangle(a, b, c, n, scaled(-1.0, d), radius, graze)
