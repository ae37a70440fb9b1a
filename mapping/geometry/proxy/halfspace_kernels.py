"""The point nearest to a wish among half-spaces (numba): the projection in each round of the proxy.

min |x - t|^2 / 2 subject to n_i . x >= b_i, by the dual active-set method of Goldfarb and Idnani, Mathematical
Programming 27 (1983), for the unit matrix and three unknowns: at most three half-spaces are active.
"""

from __future__ import annotations

from math import inf, sqrt

from numba import njit

from mapping.geometry.mesh import cross, dot, moved, scaled, vector

# A normal whose part across the active ones is shorter than this is one of their combinations (unit normals)
DEPENDENT = 1e-7
# Changes of the active set: three unknowns need a handful
MOST_CHANGES = 60


@njit(cache=True, error_model="numpy")
def coefficients(normals, active, count, n):  # type: ignore[no-untyped-def]
    """(c, z): n = sum c_j n_j + z over the active normals, z across all of them."""
    zero = 0.0
    if count == 0:
        return (zero, zero, zero), n
    a = vector(normals, active[0])
    if count == 1:
        c = dot(a, n)
        return (c, zero, zero), moved(n, -c, a)
    b = vector(normals, active[1])
    ab = dot(a, b)
    det = 1.0 - ab * ab
    if count == 2:
        an, bn = dot(a, n), dot(b, n)
        p, q = (an - ab * bn) / det, (bn - ab * an) / det
        normal = cross(a, b)
        return (p, q, zero), scaled(dot(normal, n) / det, normal)
    c = vector(normals, active[2])
    bc, ca = cross(b, c), cross(c, a)
    volume = dot(a, bc)
    return (dot(bc, n) / volume, dot(ca, n) / volume, dot(cross(a, b), n) / volume), (zero, zero, zero)


@njit(cache=True, error_model="numpy")
def nearest_allowed(normals, bounds, count, t, tolerance, active, weight):  # type: ignore[no-untyped-def]
    """(x, number of active half-spaces): their numbers are in `active`, the multipliers in `weight`, (4,) each.

    0 is allowed (all bounds are at most 0, to rounding), so there is a solution.
    """
    x, held = t, 0
    for _ in range(MOST_CHANGES):
        worst, depth = -1, -tolerance
        for i in range(count):
            above = normals[i, 0] * x[0] + normals[i, 1] * x[1] + normals[i, 2] * x[2] - bounds[i]
            if above < depth:
                worst, depth = i, above
        if worst < 0:
            break
        n, pushed = vector(normals, worst), 0.0
        while True:
            c, z = coefficients(normals, active, held, n)
            across = dot(z, z)
            full = (-depth) / across if across > DEPENDENT * DEPENDENT else inf
            least, blocking = inf, -1
            for j in range(held):
                if c[j] > 1e-12 and weight[j] / c[j] < least:
                    least, blocking = weight[j] / c[j], j
            step = min(full, least)
            if step == inf:  # no point is allowed but for rounding
                return (0.0, 0.0, 0.0), 0
            if full < inf:
                x = moved(x, step, z)
                depth += step * across
            for j in range(held):
                weight[j] -= step * c[j]
            pushed += step
            if step == full:
                active[held], weight[held] = worst, pushed
                held += 1
                break
            for j in range(blocking, held - 1):
                active[j], weight[j] = active[j + 1], weight[j + 1]
            held -= 1
    share = 1.0  # what rounding left: 0 is allowed, so the way to it is
    for i in range(count):
        along = normals[i, 0] * x[0] + normals[i, 1] * x[1] + normals[i, 2] * x[2]
        if along < bounds[i] - tolerance and along < 0.0:
            share = min(share, max(min(bounds[i], 0.0) / along, 0.0))
    return (scaled(share, x), held) if share < 1.0 else (x, held)


@njit(cache=True, error_model="numpy")
def length(a):  # type: ignore[no-untyped-def]
    """Length of a vector."""
    return sqrt(dot(a, a))
