"""A tree of bounding boxes over triangles, sixteen to a node (numba).

Triangles are ordered so that any sixteen neighbours, any sixteen groups of sixteen, and so on, lie close
together. The tree then needs no links but counting, and the boxes of a node's sixteen lanes are
tested by one vectorised loop. Boxes are float32: they only ever leave out what is surely missed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

WIDTH = 16
STACK = 512  # 32 bit numbers of triangles make at most 8 levels, each leaving at most 15 lanes waiting
ROUNDING = 6e-6  # what float32 boxes and paths may be off by, in lengths of the scaled body
NOWHERE = 1e18  # a box that no path comes near

F4 = np.float32


@njit(cache=True, error_model="numpy")
def leaf_order(vertices, faces):  # type: ignore[no-untyped-def]
    """(F,) int32: the faces in the order of the leaves, by halving at whole groups along the longest extent."""
    count = len(faces)
    keys, order = np.empty((count, 3), np.float32), np.empty(count, np.int32)
    for i in range(count):
        order[i] = i
        for k in range(3):
            keys[i, k] = vertices[faces[i, 0], k] + vertices[faces[i, 1], k] + vertices[faces[i, 2], k]
    todo = np.empty((128, 2), np.int64)
    todo[0, 0], todo[0, 1] = 0, count
    waiting = 1
    while waiting > 0:
        waiting -= 1
        first, end = todo[waiting, 0], todo[waiting, 1]
        if end - first <= WIDTH:
            continue
        group = WIDTH
        while group * WIDTH < end - first:
            group *= WIDTH
        cut = first + group * (((end - first + group - 1) // group + 1) // 2)
        part(keys, order, first, end, cut, longest_axis(keys, first, end))
        for low, high in ((first, cut), (cut, end)):
            todo[waiting, 0], todo[waiting, 1] = low, high
            waiting += 1
    return order


@njit(cache=True, error_model="numpy")
def longest_axis(keys, first, end):  # type: ignore[no-untyped-def]
    """Axis along which the keys spread most."""
    best, longest = 0, F4(-1.0)
    for axis in range(3):
        low = high = keys[first, axis]
        for i in range(first, end):
            low, high = min(low, keys[i, axis]), max(high, keys[i, axis])
        if high - low > longest:
            best, longest = axis, high - low
    return best


@njit(cache=True, error_model="numpy")
def part(keys, order, first, end, cut, axis):  # type: ignore[no-untyped-def]
    """Permute keys and order so that none before `cut` exceeds one after it (Hoare's quickselect)."""
    low, high, chance = first, end - 1, 12345
    while low < high:
        chance = (chance * 1103515245 + 12345) % 2147483648  # a pivot that no mesh can foresee
        pivot = keys[low + chance % (high - low + 1), axis]
        i, j = low, high
        while i <= j:
            while keys[i, axis] < pivot:
                i += 1
            while keys[j, axis] > pivot:
                j -= 1
            if i <= j:
                for k in range(3):
                    keys[i, k], keys[j, k] = keys[j, k], keys[i, k]
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if cut <= j:
            high = j
        elif cut >= i:
            low = i
        else:
            return


@njit(cache=True, error_model="numpy")
def build_boxes(rows):  # type: ignore[no-untyped-def]
    """The tree over triangles (F, >= 9) in leaf order; its last node is the root.

    Returns:
        boxes: (M, 6, WIDTH) float32, smallest and largest coordinates of each lane.
        children: (M,) int32: the node in lane 0 (others follow); of a leaf -1 - the triangle in lane 0.
        lanes: (M,) int32, number of lanes in use.
    """
    leaves = (len(rows) + WIDTH - 1) // WIDTH
    total, level = leaves, leaves
    while level > 1:
        level = (level + WIDTH - 1) // WIDTH
        total += level
    boxes = np.full((total, 6, WIDTH), F4(NOWHERE))
    children, lanes = np.empty(total, np.int32), np.empty(total, np.int32)
    for i in range(len(rows)):
        for k in range(3):
            a, b, c = rows[i, k], rows[i, 3 + k], rows[i, 6 + k]
            boxes[i // WIDTH, k, i % WIDTH], boxes[i // WIDTH, 3 + k, i % WIDTH] = min(a, b, c), max(a, b, c)
    for i in range(leaves):
        children[i], lanes[i] = -1 - WIDTH * i, min(WIDTH, len(rows) - WIDTH * i)
    below, first, count = 0, leaves, leaves
    while count > 1:
        for i in range(count):
            enclose(boxes[below + i], lanes[below + i], boxes[first + i // WIDTH], i % WIDTH)
        parents = (count + WIDTH - 1) // WIDTH
        for i in range(parents):
            children[first + i], lanes[first + i] = below + WIDTH * i, min(WIDTH, count - WIDTH * i)
        below, first, count = first, first + parents, parents
    return boxes, children, lanes


@njit(cache=True, error_model="numpy")
def enclose(box, lanes, parent, lane):  # type: ignore[no-untyped-def]
    """Write the box around all lanes of a node into a lane of its parent."""
    for k in range(3):
        low, high = box[k, 0], box[3 + k, 0]
        for i in range(1, lanes):
            low, high = min(low, box[k, i]), max(high, box[3 + k, i])
        parent[k, lane], parent[3 + k, lane] = low, high


@njit(cache=True, error_model="numpy")
def lane_tests(box, start, end, d, length, reach, missed, late):  # type: ignore[no-untyped-def]
    """Test a node's lanes against a ball on its way from `start` along the unit vector d to `end`.

    missed: (WIDTH,) out, positive where the ball surely stays further than `reach` from the lane's box.
        Three separating planes are tried: across the box's point closest to the end of the way, across
        that closest to its start, and along the way.
    late: (WIDTH,) out, larger where the ball would meet the middle of the box later (to the second order).
    """
    sx, sy, sz, ex, ey, ez = F4(start[0]), F4(start[1]), F4(start[2]), F4(end[0]), F4(end[1]), F4(end[2])
    dx, dy, dz, way = F4(d[0]), F4(d[1]), F4(d[2]), F4(length)
    reach4, zero, half = F4(reach + ROUNDING), F4(0.0), F4(0.5)
    square = reach4 * reach4
    for i in range(box.shape[1]):  # a count unknown to the compiler: constant ones are unrolled, not vectorised
        ax, ay, az, bx, by, bz = box[0, i], box[1, i], box[2, i], box[3, i], box[4, i], box[5, i]
        nx = max(ax - ex, zero) - max(ex - bx, zero)
        ny = max(ay - ey, zero) - max(ey - by, zero)
        nz = max(az - ez, zero) - max(ez - bz, zero)
        at_end = nx * nx + ny * ny + nz * nz if nx * dx + ny * dy + nz * dz >= zero else zero
        nx = max(ax - sx, zero) - max(sx - bx, zero)
        ny = max(ay - sy, zero) - max(sy - by, zero)
        nz = max(az - sz, zero) - max(sz - bz, zero)
        at_start = nx * nx + ny * ny + nz * nz if nx * dx + ny * dy + nz * dz <= zero else zero
        lx, ly, lz = half * (ax + bx) - ex, half * (ay + by) - ey, half * (az + bz) - ez
        along = lx * dx + ly * dy + lz * dz
        lx, ly, lz = lx - along * dx, ly - along * dy, lz - along * dz
        lateral = lx * lx + ly * ly + lz * lz
        width = half * (abs(lx) * (bx - ax) + abs(ly) * (by - ay) + abs(lz) * (bz - az))
        gap = lateral - width - way * abs(lx * dx + ly * dy + lz * dz)  # the last term: l is across d to rounding only
        aside = gap * gap - square * lateral if gap > zero else -square
        missed[i] = max(max(at_end, at_start) - square, aside)
        late[i] = (reach4 + reach4) * along + lateral
