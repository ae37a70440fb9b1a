"""The first contact of a moving ball with many triangles: a tree, and what can be left out of it (numba).

Lengths are in the body's own frame: centred, and scaled so that the larger of body and ball is about 1.
"""

from __future__ import annotations

from math import inf, nan, sqrt

import numpy as np
from numba import njit

from mapping.bvh_kernels import STACK
from mapping.triangle_kernels import closest_on_triangle, sweep_triangle, unit_normal

PASSES, TOUCHES, OVERLAPS = 0, 1, 2
TOUCH = 1e-9  # relative to the radius: what lies this close to the resting ball touches it
APART = 9e-5  # relative to the radius, sqrt(8 TOUCH): dents narrower than this are shallower than TOUCH
NEAR = 64  # triangles kept as possible contacts before the list is sifted
MOST = 16  # distinct contacts that are told apart


@njit(cache=True, error_model="numpy")
def gather(vertices, faces):  # type: ignore[no-untyped-def]
    """(F, 3, 3) corners of the faces."""
    corners = np.empty((len(faces), 3, 3))
    for i in range(len(faces)):
        for j in range(3):
            for k in range(3):
                corners[i, j, k] = vertices[faces[i, j], k]
    return corners


@njit(cache=True, error_model="numpy")
def lay_out(corners, order):  # type: ignore[no-untyped-def]
    """(F, 12) corners and unit normals in the order of the leaves."""
    rows = np.empty((len(order), 12))
    for i in range(len(order)):
        a, b, c = corners[order[i], 0], corners[order[i], 1], corners[order[i], 2]
        for k in range(3):
            rows[i, k], rows[i, 3 + k], rows[i, 6 + k] = a[k], b[k], c[k]
        rows[i, 9], rows[i, 10], rows[i, 11] = unit_normal(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2])
    return rows


@njit(cache=True, error_model="numpy")
def closest(row, x, y, z):  # type: ignore[no-untyped-def]
    """Closest point of a triangle, relative to (x, y, z)."""
    return closest_on_triangle(
        row[0] - x, row[1] - y, row[2] - z, row[3] - x, row[4] - y, row[5] - z, row[6] - x, row[7] - y, row[8] - z,
        row[9], row[10], row[11],
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def sweep(row, x, y, z, dx, dy, dz, radius, graze):  # type: ignore[no-untyped-def]
    """(enter, leave) of a triangle, for a ball starting at (x, y, z)."""
    return sweep_triangle(
        row[0] - x, row[1] - y, row[2] - z, row[3] - x, row[4] - y, row[5] - z, row[6] - x, row[7] - y, row[8] - z,
        row[9], row[10], row[11], dx, dy, dz, radius, graze,
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def meet(row, x, y, z, dx, dy, dz, radius, graze):  # type: ignore[no-untyped-def]
    """When a ball free at (x, y, z) meets the triangle: t >= 0, inf if never, -1 if it overlaps at the start."""
    enter, leave = sweep(row, x, y, z, dx, dy, dz, radius, graze)
    if enter >= 0.0 or leave < 0.0:
        return inf if leave < 0.0 else enter
    px, py, pz = closest(row, x, y, z)
    if px * px + py * py + pz * pz < (radius * (1.0 - TOUCH) - graze) ** 2:
        return -1.0
    return 0.0 if px * dx + py * dy + pz * dz > 0.0 else inf  # resting on it: pressed in, or moving away


@njit(cache=True, error_model="numpy")
def box_is_missed(box, x, y, z, ex, ey, ez, dx, dy, dz, reach):  # type: ignore[no-untyped-def]
    """True if a ball of radius `reach` on its way from (x, y, z) along d to (ex, ey, ez) surely misses a box.

    Three separating planes are tried: across the closest point of the box at the end of the way, at its
    start, and one along the way.
    """
    nx = ex - min(max(ex, box[0]), box[3])
    ny = ey - min(max(ey, box[1]), box[4])
    nz = ez - min(max(ez, box[2]), box[5])
    square = reach * reach
    if nx * dx + ny * dy + nz * dz <= 0.0:
        return nx * nx + ny * ny + nz * nz > square
    nx = x - min(max(x, box[0]), box[3])
    ny = y - min(max(y, box[1]), box[4])
    nz = z - min(max(z, box[2]), box[5])
    if nx * dx + ny * dy + nz * dz >= 0.0:
        return nx * nx + ny * ny + nz * nz > square
    lx, ly, lz = x - 0.5 * (box[0] + box[3]), y - 0.5 * (box[1] + box[4]), z - 0.5 * (box[2] + box[5])
    along = lx * dx + ly * dy + lz * dz
    lx, ly, lz = lx - along * dx, ly - along * dy, lz - along * dz
    size = abs(lx) * (box[3] - box[0]) + abs(ly) * (box[4] - box[1]) + abs(lz) * (box[5] - box[2])
    lateral = lx * lx + ly * ly + lz * lz
    gap = lateral - 0.5 * size
    return gap > 0.0 and gap * gap > square * lateral


@njit(cache=True, error_model="numpy")
def triangle_is_missed(row, ex, ey, ez, dx, dy, dz, reach):  # type: ignore[no-untyped-def]
    """True if the ball on its way to (ex, ey, ez) surely misses a triangle."""
    nx, ny, nz = row[9], row[10], row[11]
    height = (ex - row[0]) * nx + (ey - row[1]) * ny + (ez - row[2]) * nz
    if abs(height) > reach and height * (dx * nx + dy * ny + dz * nz) <= 0.0:
        return True
    px, py, pz = closest(row, ex, ey, ez)
    return px * px + py * py + pz * pz > reach * reach and px * dx + py * dy + pz * dz >= 0.0


@njit(cache=True, error_model="numpy")
def centre_distance(box, x, y, z):  # type: ignore[no-untyped-def]
    """Squared distance of a box's middle, times 4."""
    return (box[0] + box[3] - 2.0 * x) ** 2 + (box[1] + box[4] - 2.0 * y) ** 2 + (box[2] + box[5] - 2.0 * z) ** 2


@njit(cache=True, error_model="numpy")
def first_touch(rows, order, boxes, links, x, y, z, dx, dy, dz, far, guess, radius, graze, stack, near):  # type: ignore[no-untyped-def]
    """Search the tree for the earliest contact before `far`.

    Returns (t, row of the triangle or -1, number of rows in `near` that may touch at t, or -1 if they
    were too many to keep). t = -1: the ball overlaps the body at the start. Ties go to the face of the
    lowest number, so that the answer does not depend on the order of the search.
    """
    reach = radius * (1.0 + TOUCH) + graze
    best, hit, kept, overflow = far, -1, 0, False
    if guess >= 0:
        t = meet(rows[guess], x, y, z, dx, dy, dz, radius, graze)
        if t < 0.0:
            return t, guess, 0
        if t < best:
            best, hit = t, guess
    ex, ey, ez = x + best * dx, y + best * dy, z + best * dz
    stack[0] = 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if box_is_missed(boxes[node], x, y, z, ex, ey, ez, dx, dy, dz, reach):
            continue
        first, held = links[node, 0], links[node, 1]
        if held == 0:
            nearer = 0 if centre_distance(boxes[first], x, y, z) < centre_distance(boxes[first + 1], x, y, z) else 1
            stack[waiting], stack[waiting + 1] = first + 1 - nearer, first + nearer
            waiting += 2
            continue
        for i in range(first, first + held):
            if triangle_is_missed(rows[i], ex, ey, ez, dx, dy, dz, reach):
                continue
            t = meet(rows[i], x, y, z, dx, dy, dz, radius, graze)
            if t < 0.0:
                return t, i, 0
            if t < best or (t == best and hit >= 0 and order[i] < order[hit]):
                best, hit = t, i
                ex, ey, ez = x + best * dx, y + best * dy, z + best * dz
            if kept == len(near):
                kept = sift(rows, near, kept, ex, ey, ez, reach)
            if kept < len(near):
                near[kept] = i
                kept += 1
            else:
                overflow = True
    return best, hit, -1 if overflow else kept


@njit(cache=True, error_model="numpy")
def sift(rows, near, kept, x, y, z, reach):  # type: ignore[no-untyped-def]
    """Keep only the triangles within reach of (x, y, z); return their number."""
    stay = 0
    for i in range(kept):
        px, py, pz = closest(rows[near[i]], x, y, z)
        if px * px + py * py + pz * pz <= reach * reach:
            near[stay] = near[i]
            stay += 1
    return stay


@njit(cache=True, error_model="numpy")
def tell_apart(row, x, y, z, reach, apart, found, points):  # type: ignore[no-untyped-def]
    """Add the triangle's contact to the distinct ones if it is one and new; return their number."""
    px, py, pz = closest(row, x, y, z)
    if found == MOST or px * px + py * py + pz * pz > reach * reach:
        return found
    for i in range(found):
        if (px - points[i, 0]) ** 2 + (py - points[i, 1]) ** 2 + (pz - points[i, 2]) ** 2 <= apart * apart:
            return found
    points[found, 0], points[found, 1], points[found, 2] = px, py, pz
    return found + 1


@njit(cache=True, error_model="numpy")
def count_in_tree(rows, boxes, links, x, y, z, reach, apart, found, points, stack):  # type: ignore[no-untyped-def]
    """Tell apart the contacts of a ball at rest, searching the whole tree."""
    stack[0] = 0
    waiting = 1
    while waiting > 0 and found < MOST:
        waiting -= 1
        box = boxes[stack[waiting]]
        nx, ny, nz = x - min(max(x, box[0]), box[3]), y - min(max(y, box[1]), box[4]), z - min(max(z, box[2]), box[5])
        if nx * nx + ny * ny + nz * nz > reach * reach:
            continue
        first, held = links[stack[waiting], 0], links[stack[waiting], 1]
        if held == 0:
            stack[waiting], stack[waiting + 1] = first, first + 1
            waiting += 2
        for i in range(first, first + held):
            found = tell_apart(rows[i], x, y, z, reach, apart, found, points)
    return found


@njit(cache=True, error_model="numpy")
def feature_of(row, px, py, pz, near):  # type: ignore[no-untyped-def]
    """1 face, 2 edge, 3 vertex: the smallest part of the triangle that holds the point, to rounding."""
    square, sides = near * near, 0
    for i in range(3):
        a, b = row[3 * i : 3 * i + 3], row[3 * ((i + 1) % 3) : 3 * ((i + 1) % 3) + 3]
        if (a[0] - px) ** 2 + (a[1] - py) ** 2 + (a[2] - pz) ** 2 <= square:
            return 3
        ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        wx, wy, wz = px - a[0], py - a[1], pz - a[2]
        cx, cy, cz = ey * wz - ez * wy, ez * wx - ex * wz, ex * wy - ey * wx
        if cx * cx + cy * cy + cz * cz <= square * (ex * ex + ey * ey + ez * ez):
            sides += 1
    return 2 if sides > 0 else 1


@njit(cache=True, error_model="numpy", nogil=True)
def first_contacts(  # type: ignore[no-untyped-def]
    rows, order, boxes, links, radius, size, graze, origins, directions, centers, points, normals, feature, count,
    distance, state
):  # fmt: skip
    """Fill the outputs for every query; `size` is the radius of a sphere around the body and the origin."""
    stack, near, apart = np.empty(STACK, np.int32), np.empty(NEAR, np.int32), np.empty((MOST, 3))
    reach = radius * (1.0 + TOUCH) + graze
    guess = -1
    for q in range(len(origins)):
        x, y, z = origins[q, 0], origins[q, 1], origins[q, 2]
        d = directions[q if len(directions) > 1 else 0]
        dx, dy, dz = d[0], d[1], d[2]
        centers[q], points[q], normals[q], distance[q] = nan, nan, nan, inf
        feature[q], count[q], state[q] = 0, 0, PASSES
        # far origins: first travel to the sphere around the body
        middle = -(x * dx + y * dy + z * dz)
        lateral = sqrt((x + middle * dx) ** 2 + (y + middle * dy) ** 2 + (z + middle * dz) ** 2)
        around = 1.001 * (size + reach) + 1e-12 * abs(middle)
        half = sqrt(max((around - lateral) * (around + lateral), 0.0))
        if lateral > around or middle + half < 0.0:
            continue
        start = max(0.0, middle - half)
        x, y, z = x + start * dx, y + start * dy, z + start * dz
        t, hit, kept = first_touch(
            rows, order, boxes, links, x, y, z, dx, dy, dz, middle + half - start, guess, radius, graze, stack, near
        )
        if t < 0.0:
            state[q], distance[q] = OVERLAPS, 0.0
            continue
        if hit < 0:
            continue
        guess, state[q] = hit, TOUCHES
        x, y, z = x + t * dx, y + t * dy, z + t * dz
        again, _ = sweep(rows[hit], x, y, z, dx, dy, dz, radius, 0.0)  # polish: from here, the root is small
        if abs(again) <= 1e-6 * radius:
            t += again
            x, y, z = x + again * dx, y + again * dy, z + again * dz
        px, py, pz = closest(rows[hit], x, y, z)
        length = sqrt(px * px + py * py + pz * pz)
        centers[q, 0], centers[q, 1], centers[q, 2] = x, y, z
        points[q, 0], points[q, 1], points[q, 2] = x + px, y + py, z + pz
        normals[q, 0], normals[q, 1], normals[q, 2] = -px / length, -py / length, -pz / length
        feature[q] = feature_of(rows[hit], x + px, y + py, z + pz, graze)
        distance[q] = max(start + t, 0.0)
        found = tell_apart(rows[hit], x, y, z, inf, 0.0, 0, apart)
        if kept < 0:
            found = count_in_tree(rows, boxes, links, x, y, z, reach, APART * radius, found, apart, stack)
        for i in range(max(kept, 0)):
            found = tell_apart(rows[near[i]], x, y, z, reach, APART * radius, found, apart)
        count[q] = found
