"""A tree of bounding boxes over triangles, sixteen to a node (numba).

Triangles are ordered so that any sixteen neighbours, any sixteen groups of sixteen, and so on, lie close
together. The tree then needs no links but counting, and the boxes of a node's sixteen lanes are
tested by one vectorised loop. Boxes are float32: they only ever leave out what is surely missed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping.geometry.mesh.borrowing_kernels import borrowing, inlined
from mapping.geometry.mesh.vector_kernels import dot, moved

WIDTH = 16
STACK = 512  # 32 bit numbers of triangles make at most 8 levels, each leaving at most 15 lanes waiting
BOX_ROUNDING = 6e-6  # what float32 boxes and paths may be off by, in lengths of the scaled body
NOWHERE = 1e18  # a box that no path comes near
LEAST_SIDE_SQUARE = 1e-30  # of squared lengths, so that a side without length is no division by 0

# Bytes that memory comes in at once, as many as the lanes of a node take. Lanes that lie across two such lines cost
# contacts 25 % more time: numba begins arrays at any multiple of 32 bytes, so that it was chance in each call
CACHE_LINE = 64

F4 = np.float32


@njit(cache=True, error_model="numpy", nogil=True)
def lanes(rows):  # type: ignore[no-untyped-def]
    """(rows, WIDTH) float32, each row in one line of the cache, not written yet."""
    room = np.empty(rows * WIDTH + CACHE_LINE // 4, F4)
    first = (-(room.ctypes.data // 4)) % (CACHE_LINE // 4)
    return room[first : first + rows * WIDTH].reshape((rows, WIDTH))


@njit(cache=True, error_model="numpy")
def bounds(vertices, faces):  # type: ignore[no-untyped-def]
    """(2, 3) smallest and largest coordinates of the vertices that faces use."""
    box = np.empty((2, 3))
    for k in range(3):
        box[0, k] = box[1, k] = vertices[faces[0, 0], k]
    for i in range(len(faces)):
        for j in range(3):
            for k in range(3):
                x = vertices[faces[i, j], k]
                box[0, k], box[1, k] = min(box[0, k], x), max(box[1, k], x)
    return box


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


@borrowing
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


@borrowing
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
def build_tree(rows):  # type: ignore[no-untyped-def]
    """The tree over the rows (F, 12) of triangles in leaf order. Nodes count from the leaves; the last one is the root.

    Returns:
        leaves: (L, 12, WIDTH) float32, of each lane's triangle the nine coordinates of its corners and its unit normal.
        boxes: (M, 6, WIDTH) float32, of each lane of the other nodes the smallest and largest coordinates.
        links: (L + M, 2) int32: node in lane 0 (the others follow) or, of a leaf, -1 - triangle in lane 0; number
            of lanes in use.
    """
    count = (len(rows) + WIDTH - 1) // WIDTH
    others, level = 0, count
    while level > 1:
        level = (level + WIDTH - 1) // WIDTH
        others += level
    leaves, boxes = lanes(12 * count).reshape((count, 12, WIDTH)), lanes(6 * others).reshape((others, 6, WIDTH))
    leaves[:], boxes[:] = NOWHERE, NOWHERE
    links = np.empty((count + others, 2), np.int32)
    for i in range(len(rows)):
        for k in range(12):
            leaves[i // WIDTH, k, i % WIDTH] = rows[i, k]
    for i in range(count):
        links[i, 0], links[i, 1] = -1 - WIDTH * i, min(WIDTH, len(rows) - WIDTH * i)
    below, first = 0, count
    while count > 1:
        parents = (count + WIDTH - 1) // WIDTH
        for i in range(count):
            enclose(leaves, boxes, links, below + i, first + i // WIDTH - len(leaves), i % WIDTH)
        for i in range(parents):
            links[first + i, 0], links[first + i, 1] = below + WIDTH * i, min(WIDTH, count - WIDTH * i)
        below, first, count = first, first + parents, parents
    return leaves, boxes, links


@borrowing
def lane_box(leaves, boxes, node, lane):  # type: ignore[no-untyped-def]
    """(low, high): corners of the box of a lane."""
    i = node - len(leaves)
    if i >= 0:
        low, high = (boxes[i, 0, lane], boxes[i, 1, lane], boxes[i, 2, lane]), (
            boxes[i, 3, lane], boxes[i, 4, lane], boxes[i, 5, lane],
        )  # fmt: skip
        return low, high
    a = (leaves[node, 0, lane], leaves[node, 1, lane], leaves[node, 2, lane])
    b = (leaves[node, 3, lane], leaves[node, 4, lane], leaves[node, 5, lane])
    c = (leaves[node, 6, lane], leaves[node, 7, lane], leaves[node, 8, lane])
    low = (min(a[0], b[0], c[0]), min(a[1], b[1], c[1]), min(a[2], b[2], c[2]))
    return low, (max(a[0], b[0], c[0]), max(a[1], b[1], c[1]), max(a[2], b[2], c[2]))


@borrowing
def enclose(leaves, boxes, links, node, parent, lane):  # type: ignore[no-untyped-def]
    """Write the box around all lanes of a node into a lane of its parent (its number among `boxes`)."""
    for i in range(links[node, 1]):
        low, high = lane_box(leaves, boxes, node, i)
        for k in range(3):
            if i == 0 or low[k] < boxes[parent, k, lane]:
                boxes[parent, k, lane] = low[k]
            if i == 0 or high[k] > boxes[parent, 3 + k, lane]:
                boxes[parent, 3 + k, lane] = high[k]


@inlined
def square_to_segment(ax, ay, az, ux, uy, uz):  # type: ignore[no-untyped-def]
    """Squared distance of the origin from the segment from a to a + u."""
    share = -(ax * ux + ay * uy + az * uz) / max(ux * ux + uy * uy + uz * uz, F4(LEAST_SIDE_SQUARE))
    share = min(max(share, F4(0.0)), F4(1.0))
    x, y, z = ax + share * ux, ay + share * uy, az + share * uz
    return x * x + y * y + z * z


@inlined
def leaf_tests(leaves, node, end, d, reach, apart):  # type: ignore[no-untyped-def]
    """`box_tests` for the triangles of a leaf: of those that lie ahead as a whole it is their own distance.

    It is that of the foot on the plane if the triangle holds it, else that of the nearest side. Rounding may take a
    foot for outside that is inside by epsilons of its distance over the side; seen from there, that adds less than
    BOX_ROUNDING.
    """
    ex, ey, ez, dx, dy, dz = F4(end[0]), F4(end[1]), F4(end[2]), F4(d[0]), F4(d[1]), F4(d[2])
    zero, behind = F4(0.0), F4(-1.0)
    for i in range(leaves.shape[2]):
        ax, ay, az = leaves[node, 0, i] - ex, leaves[node, 1, i] - ey, leaves[node, 2, i] - ez
        bx, by, bz = leaves[node, 3, i] - ex, leaves[node, 4, i] - ey, leaves[node, 5, i] - ez
        cx, cy, cz = leaves[node, 6, i] - ex, leaves[node, 7, i] - ey, leaves[node, 8, i] - ez
        mx, my, mz = leaves[node, 9, i], leaves[node, 10, i], leaves[node, 11, i]
        nx = max(min(min(ax, bx), cx), zero) + min(max(max(ax, bx), cx), zero)
        ny = max(min(min(ay, by), cy), zero) + min(max(max(ay, by), cy), zero)
        nz = max(min(min(az, bz), cz), zero) + min(max(max(az, bz), cz), zero)
        box = nx * nx + ny * ny + nz * nz if nx * dx + ny * dy + nz * dz >= zero else behind
        ahead = min(min(ax * dx + ay * dy + az * dz, bx * dx + by * dy + bz * dz), cx * dx + cy * dy + cz * dz)
        ux, uy, uz, vx, vy, vz, wx, wy, wz = (
            bx - ax,
            by - ay,
            bz - az,
            cx - bx,
            cy - by,
            cz - bz,
            ax - cx,
            ay - cy,
            az - cz,
        )
        left = min(
            min(
                mx * (ay * uz - az * uy) + my * (az * ux - ax * uz) + mz * (ax * uy - ay * ux),
                mx * (by * vz - bz * vy) + my * (bz * vx - bx * vz) + mz * (bx * vy - by * vx),
            ),
            mx * (cy * wz - cz * wy) + my * (cz * wx - cx * wz) + mz * (cx * wy - cy * wx),
        )
        height = ax * mx + ay * my + az * mz
        side = min(
            min(square_to_segment(ax, ay, az, ux, uy, uz), square_to_segment(bx, by, bz, vx, vy, vz)),
            square_to_segment(cx, cy, cz, wx, wy, wz),
        )
        near = height * height if left > zero else side
        apart[i] = max(box, near if ahead >= zero else behind)


@inlined
def box_tests(boxes, node, end, d, reach, apart, late):  # type: ignore[no-untyped-def]
    """Look from the end of a ball's way, along the unit vector d, at the boxes of a node's lanes.

    apart: (WIDTH,) out, squared distance from `end` of a box that lies ahead, so that the rest of the way
        is further from it still; -1 if it lies behind, and the way may have been closer to it.
    late: (WIDTH,) out, larger where the ball would meet the middle of the box later (to the second order).
    """
    ex, ey, ez, dx, dy, dz = F4(end[0]), F4(end[1]), F4(end[2]), F4(d[0]), F4(d[1]), F4(d[2])
    zero, half, twice = F4(0.0), F4(0.5), F4(2.0 * reach)
    for i in range(boxes.shape[2]):  # a count unknown to the compiler: constant ones are unrolled, not vectorised
        ax, ay, az = boxes[node, 0, i], boxes[node, 1, i], boxes[node, 2, i]
        bx, by, bz = boxes[node, 3, i], boxes[node, 4, i], boxes[node, 5, i]
        nx = max(ax - ex, zero) - max(ex - bx, zero)
        ny = max(ay - ey, zero) - max(ey - by, zero)
        nz = max(az - ez, zero) - max(ez - bz, zero)
        apart[i] = nx * nx + ny * ny + nz * nz if nx * dx + ny * dy + nz * dz >= zero else F4(-1.0)
        lx, ly, lz = half * (ax + bx) - ex, half * (ay + by) - ey, half * (az + bz) - ez
        along = lx * dx + ly * dy + lz * dz
        late[i] = lx * lx + ly * ly + lz * lz + (twice - along) * along


@borrowing
def passes(leaves, boxes, node, lane, start, end, d, length, reach):  # type: ignore[no-untyped-def]
    """True if a ball on its way from `start` to `end` surely stays further than `reach` from a lane's box.

    Two more separating planes are tried: across the box's point closest to the start, and along the way.
    """
    low, high = lane_box(leaves, boxes, node, lane)
    n = (
        max(low[0] - start[0], 0.0) - max(start[0] - high[0], 0.0),
        max(low[1] - start[1], 0.0) - max(start[1] - high[1], 0.0),
        max(low[2] - start[2], 0.0) - max(start[2] - high[2], 0.0),
    )
    if dot(n, d) <= 0.0 and dot(n, n) > reach * reach:
        return True
    middle = (0.5 * (low[0] + high[0]) - end[0], 0.5 * (low[1] + high[1]) - end[1], 0.5 * (low[2] + high[2]) - end[2])
    aside = moved(middle, -dot(middle, d), d)
    half = 0.5 * (
        abs(aside[0]) * (high[0] - low[0]) + abs(aside[1]) * (high[1] - low[1]) + abs(aside[2]) * (high[2] - low[2])
    )
    square = dot(aside, aside)
    gap = square - half - length * abs(dot(aside, d))  # the last: aside is across d to rounding only
    return gap > 0.0 and gap * gap > reach * reach * square


@inlined
def push_lanes(leaves, boxes, links, stack, waiting, start, end, d, length, reach, apart, late):  # type: ignore[no-untyped-def]
    """Replace the node on top of the stack by the lanes that a ball on its way may touch, the earliest on top.

    Returns the new height of the stack. Numbers from 0 up are nodes; -1 - i is triangle i.
    """
    node = stack[waiting - 1]
    child, lanes = links[node, 0], links[node, 1]
    step = 1 if child >= 0 else -1
    reach += BOX_ROUNDING
    if child >= 0:
        box_tests(boxes, node - len(leaves), end, d, reach, apart, late)
    else:
        leaf_tests(leaves, node, end, d, reach, apart)
    bottom, square = waiting - 1, F4(reach * reach)
    end_of_lanes = np.uint64(bottom)  # what cannot be below 0 is not looked at for that
    for k in range(lanes):  # without a branch, which nobody could predict
        stack[end_of_lanes] = k
        end_of_lanes += np.uint64(apart[k] <= square)
    waiting = bottom
    for i in range(bottom, np.int64(end_of_lanes)):
        lane = np.uint64(stack[i])
        if apart[lane] < F4(0.0) and passes(leaves, boxes, node, lane, start, end, d, length, reach):
            continue
        place = waiting
        while step > 0 and place > bottom and late[stack[place - 1] - child] < late[lane]:
            stack[place] = stack[place - 1]
            place -= 1
        stack[place] = child + step * np.int64(lane)
        waiting += 1
    return waiting
