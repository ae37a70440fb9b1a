"""First contacts of many balls: those side by side share one search of the tree, as a packet (numba).

In ray tracing such queries are packets (Wald et al. 2001): all that one of them may meet is found once for all. Here it
is what a thicker ball may touch that takes the ways of all of them at once. These triangles are laid out as a small
body of their own, and each query is answered among them exactly as it would be among all.

Arrays are handed over one by one: numba counts who holds those of a tuple. A way (9,) is where a query comes near the
body (3), its direction (3), how far it is to there, the length near the body (negative: it misses it), and where it
certainly is in contact.
"""

from __future__ import annotations

from math import inf, nan, sqrt

import numpy as np
from numba import njit

from mapping.geometry.contact.contact_kernels import (
    MOST_DISTINCT_CONTACTS,
    count_contacts,
    feature_of,
    first_touch,
    meet,
    settle,
    stays_above,
    way_to_body,
)
from mapping.geometry.mesh import (
    QUERIES_PER_BLOCK,
    STACK,
    WIDTH,
    borrowing,
    closest,
    dot,
    inlined,
    lanes,
    moved,
    push_lanes,
    scaled,
    sub,
    vector,
)

# Queries of a packet; triangles that it may have for each of them, and in all. One that has at most half of all grows,
# queries of one of too many are answered by themselves. Samples 6 um apart under a ball of 10 mm are answered three
# times as fast in packets, a grid of a tenth of the triangles' sides a tenth faster
LEAST_QUERIES, MOST_QUERIES = 4, 32
TRIANGLES_PER_QUERY, MOST_TRIANGLES = 8, 4 * WIDTH
# Queries that are answered by themselves where a packet has too many, and twice as many at each further one: the
# search for what it would have had is lost
FIRST_PAUSE = 64
# Directions of a packet differ by this much at most
TURN = 0.1


@njit(cache=True, error_model="numpy", nogil=True)
def first_contacts(  # type: ignore[no-untyped-def]
    rows, order, leaves, boxes, links, ball, size, frame, turn, first, last, origins, directions,
    centers, points, normals, feature, count, distance, overlap,
):  # fmt: skip
    """Write the arrays of `Contacts` for the queries turn[first:last], or first to last if `turn` is empty.

    Args:
        rows, order, leaves, boxes, links, ball: in the body's own frame.
        size: radius of a sphere around the body.
        frame: (x, y, z, unit) of that frame, m.
        origins: (N, 3) m; directions: (N, 3) or (1, 3) unit vectors.
    """
    stack, found = np.empty(STACK, np.int32), lanes(2)
    apart, late = found[0], found[1]
    near = np.empty(max(len(rows), MOST_TRIANGLES), np.int32)
    steps, touched, places = np.empty(len(near)), np.empty((len(near), 3)), np.empty((MOST_DISTINCT_CONTACTS, 3))
    own_rows, own_order = np.empty((MOST_TRIANGLES, rows.shape[1])), np.empty(MOST_TRIANGLES, np.int32)
    own_leaves = lanes(MOST_TRIANGLES // WIDTH * leaves.shape[1]).reshape((-1, leaves.shape[1], WIDTH))
    own_leaves[:] = 0.0
    own_links, own = np.empty((MOST_TRIANGLES // WIDTH, 2), np.int32), np.empty(MOST_TRIANGLES, np.int32)
    ways = np.empty((MOST_QUERIES, 9))
    guess, width, pause = -1, LEAST_QUERIES, FIRST_PAUSE
    at = first
    while at < last:
        if at % QUERIES_PER_BLOCK == 0:
            guess, width, pause = -1, LEAST_QUERIES, FIRST_PAUSE
        left = min(QUERIES_PER_BLOCK - at % QUERIES_PER_BLOCK, last - at)
        queries, held = min(width if guess >= 0 else 1, left), 0
        if queries > 1:
            for k in range(queries):
                q = turn[at + k] if len(turn) > 0 else at + k
                set_out(origins, directions, q, frame, 1.001 * (size + ball[1]), ways, k)
            held = gather(
                rows, order, leaves, boxes, links, ball, guess, ways, queries, stack, apart, late,
                own_rows, own_order, own_leaves, own_links, own,
            )  # fmt: skip
            if held == 0:
                width, queries, pause = max(width // 2, LEAST_QUERIES), min(pause, left), 2 * pause
        if held == 0:
            guess = by_themselves(
                rows, order, leaves, boxes, links, ball, size, frame, turn, at, queries, origins, directions, guess,
                ways, stack, apart, late, near, steps, touched, places,
                centers, points, normals, feature, count, distance, overlap,
            )  # fmt: skip
        else:
            own_guess, pause = 0, FIRST_PAUSE
            for k in range(queries):
                waiting = (held + WIDTH - 1) // WIDTH
                for i in range(waiting):
                    stack[i] = i
                q = turn[at + k] if len(turn) > 0 else at + k
                own_guess = answer(
                    own_rows, own_order, own_leaves, boxes, own_links, ball, frame, ways, k, ways[k, 8], 0, own_guess,
                    waiting, stack, apart, late, near, steps, touched, places,
                    q, centers, points, normals, feature, count, distance, overlap,
                )  # fmt: skip
            guess = own[own_guess]
            if held <= MOST_TRIANGLES // 2:
                width = min(2 * width, MOST_QUERIES)
        at += queries


@borrowing
def by_themselves(  # type: ignore[no-untyped-def]
    rows, order, leaves, boxes, links, ball, size, frame, turn, at, queries, origins, directions, guess,
    ways, stack, apart, late, near, steps, touched, places,
    centers, points, normals, feature, count, distance, overlap,
):  # fmt: skip
    """Answer so many queries in turn among all triangles; returns the triangle to try next."""
    for k in range(at, at + queries):
        q = turn[k] if len(turn) > 0 else k
        set_out(origins, directions, q, frame, 1.001 * (size + ball[1]), ways, 0)
        stack[0] = len(links) - 1
        guess = answer(
            rows, order, leaves, boxes, links, ball, frame, ways, 0, ways[0, 7], -1, guess,
            1, stack, apart, late, near, steps, touched, places,
            q, centers, points, normals, feature, count, distance, overlap,
        )  # fmt: skip
    return guess


@inlined
def set_out(origins, directions, q, frame, around, ways, k):  # type: ignore[no-untyped-def]
    """Write a query's way but its bound. `around`: radius of a sphere around the body and the ball on it."""
    per_unit = 1.0 / frame[3]
    o = (
        (origins[q, 0] - frame[0]) * per_unit,
        (origins[q, 1] - frame[1]) * per_unit,
        (origins[q, 2] - frame[2]) * per_unit,
    )
    d = vector(directions, q if len(directions) > 1 else 0)
    start, length = way_to_body(o, d, around)
    ways[k, 0], ways[k, 1], ways[k, 2] = moved(o, start, d)  # a far origin costs no digits from here on
    ways[k, 3], ways[k, 4], ways[k, 5] = d
    ways[k, 6], ways[k, 7] = start, length


@borrowing
def gather(  # type: ignore[no-untyped-def]
    rows, order, leaves, boxes, links, ball, guess, ways, queries, stack, apart, late,
    own_rows, own_order, own_leaves, own_links, own,
):  # fmt: skip
    """Lay out what any of so many queries may touch before it meets the triangle `guess`, that one first, as a body.

    A ball that goes the longest of the ways along their middle, thicker by how far the others are aside of it, covers
    whatever the balls of all queries do.

    Returns:
        the number of triangles, whose numbers are written to `own`; 0: one query does not meet `guess`, directions
        differ, or there are too many triangles.
    """
    first, low, high = -1, (inf, inf, inf), (-inf, -inf, -inf)
    for k in range(queries):
        if ways[k, 7] < 0.0:
            continue
        o, d = vector(ways, k), (ways[k, 3], ways[k, 4], ways[k, 5])
        t = meet(rows, guess, o, d, ball, 0.0, ways[k, 7])
        if not t < ways[k, 7]:
            return 0
        ways[k, 8] = t
        end = moved(o, max(t, 0.0), d)
        low = (min(low[0], end[0]), min(low[1], end[1]), min(low[2], end[2]))
        high = (max(high[0], end[0]), max(high[1], end[1]), max(high[2], end[2]))
        first = k if first < 0 else first
    if first < 0:
        return 0
    middle = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    d = (ways[first, 3], ways[first, 4], ways[first, 5])
    begin, end, wide = inf, -inf, 0.0
    for k in range(queries):
        if ways[k, 7] < 0.0:
            continue
        o, its, t = sub(vector(ways, k), middle), (ways[k, 3], ways[k, 4], ways[k, 5]), max(ways[k, 8], 0.0)
        e, turned = moved(o, t, its), sub(its, d)
        begin, end = min(begin, dot(o, d)), max(end, dot(e, d))
        aside, turn = moved(e, -dot(e, d), d), sqrt(dot(turned, turned))
        if turn > TURN:
            return 0
        wide = max(wide, sqrt(dot(aside, aside)) + t * turn)
    reach, start, stop = ball[1] + wide, moved(middle, begin, d), moved(middle, end, d)
    lay_out(rows, order, leaves, guess, 0, own_rows, own_order, own_leaves, own)
    held = 1
    stack[0] = len(links) - 1
    waiting = 1
    while waiting > 0:
        i = -1 - stack[waiting - 1]
        if i < 0:
            waiting = push_lanes(leaves, boxes, links, stack, waiting, start, stop, d, end - begin, reach, apart, late)
            continue
        waiting -= 1
        if i == guess or stays_above(rows, i, stop, d, reach):
            continue
        if held == min(MOST_TRIANGLES, TRIANGLES_PER_QUERY * queries):
            return 0
        lay_out(rows, order, leaves, i, held, own_rows, own_order, own_leaves, own)
        held += 1
    for leaf in range((held + WIDTH - 1) // WIDTH):
        own_links[leaf, 0], own_links[leaf, 1] = -1 - WIDTH * leaf, min(WIDTH, held - WIDTH * leaf)
    return held


@inlined
def lay_out(rows, order, leaves, i, held, own_rows, own_order, own_leaves, own):  # type: ignore[no-untyped-def]
    """Copy triangle i as number `held` of the small body."""
    own[held], own_order[held] = i, order[i]
    for k in range(rows.shape[1]):
        own_rows[held, k] = rows[i, k]
    for k in range(leaves.shape[1]):
        own_leaves[held // WIDTH, k, held % WIDTH] = leaves[i // WIDTH, k, i % WIDTH]


@inlined
def answer(  # type: ignore[no-untyped-def]
    rows, order, leaves, boxes, links, ball, frame, ways, k, best, hit, guess,
    waiting, stack, apart, late, near, steps, touched, places,
    q, centers, points, normals, feature, count, distance, overlap,
):  # fmt: skip
    """Write where the ball of a query rests; returns the triangle that it met, or `guess` if none.

    Args:
        best, hit: up to where contacts are looked for, and the triangle that is met there, -1 if none is.
        guess: the triangle to try first, -1 if none.
        waiting: so many nodes on the stack are searched.
        q: its place in what is found.
    """
    for j in range(3):
        centers[q, j] = points[q, j] = normals[q, j] = nan
    feature[q], count[q], distance[q], overlap[q] = 0, 0, inf, False
    if ways[k, 7] < 0.0:
        return guess
    o, d = vector(ways, k), (ways[k, 3], ways[k, 4], ways[k, 5])
    if guess >= 0 and guess != hit:
        t = meet(rows, guess, o, d, ball, 0.0, best)
        if t < best:
            best, hit = t, guess
    t, hit, kept = first_touch(rows, leaves, boxes, links, ball, o, d, best, hit, near, stack, waiting, apart, late)
    if t < 0.0:
        overlap[q], distance[q] = True, 0.0
    elif hit >= 0:
        o, guess, unit = moved(o, t, d), hit, frame[3]
        i, more, kept = settle(rows, order, near, steps, touched, kept, hit, o, d, ball)
        o = moved(o, more, d)
        p = closest(rows, i, o)
        n, at = scaled(-1.0 / sqrt(dot(p, p)), p), moved(o, 1.0, p)
        for j in range(3):
            centers[q, j], points[q, j] = o[j] * unit + frame[j], at[j] * unit + frame[j]
            normals[q, j] = n[j]
        feature[q] = feature_of(rows, i, o, p, ball[2])
        count[q] = count_contacts(near, touched, kept, more, d, i, p, ball, places)
        distance[q] = max(ways[k, 6] + t + more, 0.0) * unit
    return guess
