"""How far a ball must back off to be free of a body (numba)."""

from __future__ import annotations

from math import inf

import numpy as np
from numba import njit

from mapping.bvh_kernels import STACK
from mapping.contact_kernels import box_is_missed, closest, sweep
from mapping.triangle_kernels import left_of


@njit(cache=True, error_model="numpy", nogil=True)
def retreats(rows, order, boxes, links, radius, size, graze, outward, centers, backward, distance):  # type: ignore[no-untyped-def]
    """Write how far each ball backs off: out of the body if its centre is inside, then until it overlaps nothing.

    `outward` is +1 if the normals of the faces point out of the body, -1 if they point into it.
    """
    stack = np.empty(STACK, np.int32)
    for q in range(len(centers)):
        x, y, z = centers[q, 0], centers[q, 1], centers[q, 2]
        dx, dy, dz = backward[q, 0], backward[q, 1], backward[q, 2]
        away, inside = 0.0, True
        while inside:
            away += leave_overlap(
                rows, boxes, links, x + away * dx, y + away * dy, z + away * dz, dx, dy, dz, radius, graze, stack
            )
            t, facing = first_face(rows, boxes, links, x + away * dx, y + away * dy, z + away * dz, dx, dy, dz, stack)
            inside = facing * outward > 0.0
            if inside:
                away += t
        distance[q] = away


@njit(cache=True, error_model="numpy")
def first_face(rows, boxes, links, x, y, z, dx, dy, dz, stack):  # type: ignore[no-untyped-def]
    """First face that the ray from (x, y, z) along d crosses: (t, cosine of its normal and d); (inf, 0) if none."""
    best, facing = inf, 0.0
    stack[0] = 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if ray_enters(boxes[node], x, y, z, dx, dy, dz) > best:
            continue
        first, held = links[node, 0], links[node, 1]
        if held == 0:
            stack[waiting], stack[waiting + 1] = first, first + 1
            waiting += 2
        for i in range(first, first + held):
            t, cosine = crossing(rows[i], x, y, z, dx, dy, dz)
            if t < best or (t == best and abs(cosine) > abs(facing)):
                best, facing = t, cosine
    return best, facing


@njit(cache=True, error_model="numpy")
def ray_enters(box, x, y, z, dx, dy, dz):  # type: ignore[no-untyped-def]
    """When the ray enters a box, widened by rounding; inf if never."""
    enter, leave = 0.0, inf
    slack = 1e-14
    for p, d, low, high in ((x, dx, box[0], box[3]), (y, dy, box[1], box[4]), (z, dz, box[2], box[5])):
        low, high = low - slack - p, high + slack - p
        if d == 0.0:
            if low > 0.0 or high < 0.0:
                return inf
        else:
            enter, leave = max(enter, min(low / d, high / d)), min(leave, max(low / d, high / d))
    return enter if enter <= leave else inf


@njit(cache=True, error_model="numpy")
def crossing(row, x, y, z, dx, dy, dz):  # type: ignore[no-untyped-def]
    """(t >= 0, cosine) where the ray crosses a face, its border included; (inf, 0) if it does not."""
    nx, ny, nz = row[9], row[10], row[11]
    cosine = nx * dx + ny * dy + nz * dz
    if cosine == 0.0:
        return inf, 0.0
    ax, ay, az = row[0] - x, row[1] - y, row[2] - z
    bx, by, bz = row[3] - x, row[4] - y, row[5] - z
    cx, cy, cz = row[6] - x, row[7] - y, row[8] - z
    t = (ax * nx + ay * ny + az * nz) / cosine
    fx, fy, fz = t * dx, t * dy, t * dz
    if (
        t >= 0.0
        and left_of(ax, ay, az, bx, by, bz, fx, fy, fz, nx, ny, nz) >= 0.0
        and left_of(bx, by, bz, cx, cy, cz, fx, fy, fz, nx, ny, nz) >= 0.0
        and left_of(cx, cy, cz, ax, ay, az, fx, fy, fz, nx, ny, nz) >= 0.0
    ):
        return t, cosine
    return inf, 0.0


@njit(cache=True, error_model="numpy")
def leave_overlap(rows, boxes, links, x, y, z, dx, dy, dz, radius, graze, stack):  # type: ignore[no-untyped-def]
    """How far the ball at (x, y, z) moves along d until it overlaps nothing."""
    away, step = 0.0, inf
    while step > graze:
        step = overlap_ahead(
            rows, boxes, links, x + away * dx, y + away * dy, z + away * dz, dx, dy, dz, radius, graze, stack
        )
        away += step
    return away


@njit(cache=True, error_model="numpy")
def overlap_ahead(rows, boxes, links, x, y, z, dx, dy, dz, radius, graze, stack):  # type: ignore[no-untyped-def]
    """How far the ball at (x, y, z) moves along d to leave every triangle that it overlaps now."""
    step, depth = 0.0, radius - graze
    stack[0] = 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if box_is_missed(boxes[node], x, y, z, x, y, z, dx, dy, dz, radius):
            continue
        first, held = links[node, 0], links[node, 1]
        if held == 0:
            stack[waiting], stack[waiting + 1] = first, first + 1
            waiting += 2
        for i in range(first, first + held):
            px, py, pz = closest(rows[i], x, y, z)
            if px * px + py * py + pz * pz < depth * depth:
                _, leave = sweep(rows[i], x, y, z, dx, dy, dz, radius, graze)
                step = max(step, leave)
    return step
