"""How far a ball must back off to be free of a body (numba)."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numba import njit

from mapping.geometry.contact.contact_kernels import way_to_body
from mapping.geometry.mesh import (
    STACK,
    borrowing,
    closest,
    closest_on_triangle,
    closing_step,
    corners,
    dot,
    enter_triangle,
    lanes,
    moved,
    push_lanes,
    scaled,
    sub,
    vector,
)


@njit(cache=True, error_model="numpy", nogil=True)
def retreats(rows, leaves, boxes, links, ball, size, outward, centers, backward, distance):  # type: ignore[no-untyped-def]
    """Write how far each ball backs off until it overlaps nothing and its centre is outside.

    `outward` is +1 if the normals of the faces point out of the body, -1 if they point into it.
    """
    stack = np.empty(STACK, np.int32)
    found = lanes(2)
    apart, late = found[0], found[1]
    for q in range(len(centers)):
        o, d = vector(centers, q), vector(backward, q)
        start, length = way_to_body(o, d, 1.001 * (size + ball[1]))
        away, inside = 0.0, length >= 0.0
        while inside:
            away += leave_overlap(rows, leaves, boxes, links, ball, moved(o, away, d), d, stack, apart, late)
            rest = start + length - away
            t, facing = first_face(rows, leaves, boxes, links, moved(o, away, d), d, rest, ball[2], stack, apart, late)
            inside = facing * outward > 0.0
            if inside:
                away += t
        distance[q] = away


@borrowing
def leave_overlap(rows, leaves, boxes, links, ball, o, d, stack, apart, late):  # type: ignore[no-untyped-def]
    """How far the ball at o moves along d until it overlaps nothing."""
    away, step = 0.0, inf
    while step > ball[2]:
        step = overlap_ahead(rows, leaves, boxes, links, ball, moved(o, away, d), d, stack, apart, late)
        away += step
    return away


@borrowing
def overlap_ahead(rows, leaves, boxes, links, ball, o, d, stack, apart, late):  # type: ignore[no-untyped-def]
    """How far the ball at o moves along d to leave every triangle that it overlaps now.

    A triangle is convex: one that the ball has left when it is free of another does not hold it further. So those far
    ahead come first, which a ball that comes back meets first.
    """
    radius, _, graze = ball
    step, end, back = 0.0, o, scaled(-1.0, d)
    stack[0] = len(links) - 1
    waiting = 1
    while waiting > 0:
        i = -1 - stack[waiting - 1]
        if i < 0:
            waiting = push_lanes(leaves, boxes, links, stack, waiting, end, end, back, 0.0, radius, apart, late)
            continue
        waiting -= 1
        p = closest(rows, i, end)
        if dot(p, p) >= radius * radius:
            continue
        a, b, c, n = corners(rows, i, o)
        p = closest_on_triangle(a, b, c, n)
        gap = sqrt(dot(p, p))
        if gap < radius - graze:
            beyond = max(dot(a, d), dot(b, d), dot(c, d)) + radius  # free there: it comes back until it touches
            a, b, c = moved(a, -beyond, d), moved(b, -beyond, d), moved(c, -beyond, d)
            closing = dot(p, back)
            start = max(beyond + closing_step(gap, closing, radius), 0.0) if closing > 0.0 else 0.0
            step = max(step, beyond - enter_triangle(a, b, c, n, back, ball, start, inf))
            end = moved(o, step, d)
    return step


@borrowing
def first_face(rows, leaves, boxes, links, o, d, length, slack, stack, apart, late):  # type: ignore[no-untyped-def]
    """First face that the ray from o along d crosses: (t, cosine of its normal and d); (inf, 0) if none."""
    best, facing = length, 0.0
    stack[0] = len(links) - 1
    waiting = 1 if length > 0.0 else 0
    while waiting > 0:
        i = -1 - stack[waiting - 1]
        if i < 0:
            waiting = push_lanes(leaves, boxes, links, stack, waiting, o, moved(o, best, d), d, best, 0.0, apart, late)
            continue
        waiting -= 1
        t, cosine = crossing(rows, i, o, d, slack)
        if t < best or (t == best and abs(cosine) > abs(facing)):
            best, facing = t, cosine
    return best, facing


@borrowing
def crossing(rows, i, o, d, slack):  # type: ignore[no-untyped-def]
    """(t >= 0, cosine) where the ray crosses a face or passes its border within the slack; (inf, 0) if neither."""
    a, b, c, n = corners(rows, i, o)
    cosine = dot(n, d)
    if cosine == 0.0:
        return inf, 0.0
    t = dot(a, n) / cosine
    if t < 0.0 or t == inf:
        return inf, 0.0
    f = scaled(t, d)
    p = closest_on_triangle(sub(a, f), sub(b, f), sub(c, f), n)
    return (t, cosine) if dot(p, p) <= slack * slack else (inf, 0.0)
