"""One triangle and one ball: the closest point, and when a moving ball meets it (closed forms, float64).

Every triangle (a, b, c, unit normal n) is given relative to the ball's centre, so nothing here loses digits
to a far origin. Degenerate triangles (a segment, a point) have the normal zero and are right all the same.
"""

from __future__ import annotations

from math import inf, sqrt

from mapping.geometry.mesh.borrowing_kernels import borrowing
from mapping.geometry.mesh.vector_kernels import cross, dot, moved, scaled, sub

# What remains of a gap that closes to a tangent shrinks fourfold a step, from 1 to 1e-16 in 27 steps, and as many again
# at most for a graze beyond it: 54; any other is faster. Rounding may cost a few more
MOST_TANGENTS = 64
HALVES = 2.0**27 + 1.0  # splits a float64 of 53 bits into two of at most 26, whose products are exact
SLIVER = 1e-14  # height over longest side below which a triangle is a segment: narrower than rounding


@borrowing
def unit_normal(a, b, c):  # type: ignore[no-untyped-def]
    """Unit normal of a triangle, zero where it has no area."""
    u, v, w = sub(b, a), sub(c, a), sub(c, b)
    uu, vv, ww = dot(u, u), dot(v, v), dot(w, w)
    longest = max(uu, vv, ww)
    # the two shorter sides give the most accurate product
    n = accurate_cross(v, w) if uu == longest else accurate_cross(u, w) if vv == longest else accurate_cross(u, v)
    length = sqrt(dot(n, n))
    if not length > SLIVER * longest:
        return (0.0, 0.0, 0.0)
    return scaled(1.0 / length, n)


@borrowing
def accurate_cross(a, b):  # type: ignore[no-untyped-def]
    """Vector product of which every component is exact to epsilons of itself, however parallel a and b are.

    The plain product is exact to epsilons of |a| |b|. By those the plane of a flat triangle tilts along its longest
    side: over a length L and a height h its far end would be off by epsilons of L L/h, not of L.
    """
    return (
        difference_of_products(a[1], b[2], a[2], b[1]),
        difference_of_products(a[2], b[0], a[0], b[2]),
        difference_of_products(a[0], b[1], a[1], b[0]),
    )


@borrowing
def difference_of_products(a, b, c, d):  # type: ignore[no-untyped-def]
    """a b - c d with what rounding takes from both products (Kahan's, see Jeannerod, Louvet and Muller 2013)."""
    p, q = a * b, c * d
    return (p - q) + (product_error(a, b, p) - product_error(c, d, q))


@borrowing
def product_error(a, b, p):  # type: ignore[no-untyped-def]
    """a b - p without any error for p = a b as rounded: the factors are split into halves (Dekker 1971)."""
    high, tall = HALVES * a, HALVES * b
    high, tall = high - (high - a), tall - (tall - b)
    low, short = a - high, b - tall
    return ((high * tall - p) + high * short + low * tall) + low * short


@borrowing
def left_of(a, b, f, n):  # type: ignore[no-untyped-def]
    """Positive if f lies on the inner side of the edge ab of a triangle with normal n."""
    return dot(n, cross(sub(b, a), sub(f, a)))


@borrowing
def holds(a, b, c, n, f):  # type: ignore[no-untyped-def]
    """True if the triangle, its border included, holds the point f of its plane."""
    return left_of(a, b, f, n) >= 0.0 and left_of(b, c, f, n) >= 0.0 and left_of(c, a, f, n) >= 0.0


@borrowing
def closest_on_segment(a, b):  # type: ignore[no-untyped-def]
    """Point of the segment ab closest to the origin; inside the segment it is square to ab.

    One projection leaves of `a` along ab what rounding makes of it, a few epsilons of its length. Far from the corners,
    that turns a short p so that p d no longer tells whether a ball that moves along the edge comes closer. What a
    second projection leaves over is epsilons of p ("twice is enough": Parlett 1980, section 6.9, who quotes Kahan).
    """
    e = sub(b, a)
    square, along = dot(e, e), -dot(a, e)
    if not along > 0.0 or square == 0.0:
        return a
    if along >= square:
        return b
    p = moved(a, along / square, e)
    return moved(p, -dot(p, e) / square, e)


@borrowing
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


@borrowing
def enter_face(a, b, c, n, d, radius):  # type: ignore[no-untyped-def]
    """When a ball from the origin along d comes to touch the inside of the triangle, from either side; inf if never."""
    cosine = dot(d, n)
    side = -radius if cosine > 0.0 else radius
    t = (dot(a, n) + side) / cosine
    return t if holds(a, b, c, n, moved(scaled(t, d), -side, n)) else inf


@borrowing
def enter_triangle(a, b, c, n, d, ball, start, far):  # type: ignore[no-untyped-def]
    """When a ball at the origin comes to touch the triangle on its way along the unit vector d, 0 <= t < far.

    inf if it does not, or sinks in by less than a graze; -1 if it overlaps the triangle at the origin by more than its
    reach exceeds its radius. At `start` it is not yet so far: 0, or a `closing_step` from where it overlaps.
    ball: (radius, reach, graze).

    The gap, the distance of the triangle from the ball's centre, is a convex function of t. A tangent of a convex
    function lies below it: the step that would close the gap at the present rate never goes beyond the contact, and
    where the gap no longer closes there is none. So there is no crack to slip through, whatever the direction and
    the triangle: the answer is as exact as a gap (theory 4.7).
    """
    radius, reach, graze = ball
    t, touched = start, inf
    for _ in range(MOST_TANGENTS):
        p = closest_on_triangle(moved(a, -t, d), moved(b, -t, d), moved(c, -t, d), n)
        gap, closing = sqrt(dot(p, p)), dot(p, d)
        if t == 0.0 and gap < radius - (reach - radius):
            return -1.0
        if gap <= radius + 0.5 * graze:
            touched = min(touched, t)
        if not closing > 0.0:
            return touched if gap < radius - graze and t > 0.0 else inf
        if gap < radius - graze:
            return touched
        t += closing_step(gap, closing, radius if touched == inf else radius - 1.5 * graze)
        if t >= far:
            return inf
    return min(touched, t)


@borrowing
def closing_step(gap, closing, radius):  # type: ignore[no-untyped-def]
    """How far along d the gap to the closest point p is the radius at the present rate; closing = p d > 0."""
    return (gap - radius) * (gap / closing)
