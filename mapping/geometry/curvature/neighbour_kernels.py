"""The nearest of many points to each of many places, compiled: hundreds each, for which a heap of the best is slow."""

from __future__ import annotations

import numpy as np
from numba import njit

from mapping.geometry.mesh import MOST_WAITING, POINTS_PER_BOX

# Room within which the neighbours are looked for, over the room that held those of the place before: places in a row
# lie beside each other, and what is found too much costs less than to look again
ROOMIER = 1.2
# So many times the wanted number are too many to sort: where points lie far denser than about the place before
MOST_FOUND = 8
# Squared radii that differ by less of themselves are one: as many points as lie between are equally near
ONE_RADIUS = 1e-9
LEAST_SQUARE = 1e-300  # of points that all lie on one place


@njit(cache=True, error_model="numpy", nogil=True)
def nearest_points(points, order, boxes, places, out):  # type: ignore[no-untyped-def]
    """The nearest points of each place, nearest first, of equally near ones that of the lower number first.

    Args:
        points: (N, 3) m, as `boxes` of `boxes_about` hold them.
        order: (N,) their numbers.
        places: (M, 3) m.
        out: (M, K) their numbers, written; N where there are no more.
    """
    total, count = len(points), min(out.shape[1], len(points))
    # one more: each point is written where the next found one belongs
    squares, found, shelf = np.empty(total + 1), np.empty(total + 1, np.int64), np.empty(total, np.int64)
    near, numbers = np.empty(total), np.empty(total, np.int64)
    ends, waiting = np.empty(count + 1, np.int64), np.empty(MOST_WAITING, np.int64)
    size = 0.0
    for c in range(3):
        size += (boxes[1, 3 + c] - boxes[1, c]) ** 2
    start = max(size * count / total, LEAST_SQUARE)
    reach = start
    for m in range(len(places)):
        x, y, z = places[m, 0], places[m, 1], places[m, 2]
        low, high, most = 0.0, np.inf, MOST_FOUND * count
        while True:
            number = _within(points, order, boxes, x, y, z, reach, most, waiting, squares, found)
            if count <= number <= most:
                break
            if number > most:
                high = reach
            else:
                low = reach
            if high <= LEAST_SQUARE or (high < np.inf and high - low <= ONE_RADIUS * high):
                reach = high
                number = _within(points, order, boxes, x, y, z, reach, total, waiting, squares, found)
                break
            wider = reach * (ROOMIER * count / number if number > 0 else 4.0)
            reach = wider if number < count and wider < high else max(0.5 * (low + high), LEAST_SQUARE)
        # shelves of equal area, which hold about one each, and then their few in order
        ends[:], shelves_to_one = 0, count / reach
        for i in range(number):
            shelf[i] = min(int(squares[i] * shelves_to_one), count - 1)
            ends[shelf[i] + 1] += 1
        for k in range(count):
            ends[k + 1] += ends[k]
        for i in range(number):
            k = shelf[i]
            near[ends[k]], numbers[ends[k]] = squares[i], found[i]
            ends[k] += 1
        k = 0
        while ends[k] < count:
            k += 1
        for i in range(1, ends[k]):
            square, own, j = near[i], numbers[i], i
            while j > 0 and (near[j - 1] > square or (near[j - 1] == square and numbers[j - 1] > own)):
                near[j], numbers[j] = near[j - 1], numbers[j - 1]
                j -= 1
            near[j], numbers[j] = square, own
        for i in range(count):
            out[m, i] = numbers[i]
        for i in range(count, out.shape[1]):
            out[m, i] = total
        reach = ROOMIER * near[count - 1] if near[count - 1] > LEAST_SQUARE else start


@njit(cache=True, error_model="numpy")
def _within(points, order, boxes, x, y, z, reach, most, waiting, squares, found):  # type: ignore[no-untyped-def]
    """How many points have a squared distance from a place of at most `reach`; their squares and numbers are written.

    More than `most` are not counted on.
    """
    leaves, number = len(boxes) // 2, 0
    top, waiting[0] = 1, 1
    while top and number <= most:
        top -= 1
        box = waiting[top]
        u = max(boxes[box, 0] - x, 0.0, x - boxes[box, 3])
        v = max(boxes[box, 1] - y, 0.0, y - boxes[box, 4])
        w = max(boxes[box, 2] - z, 0.0, z - boxes[box, 5])
        if u * u + v * v + w * w > reach:
            continue
        if box < leaves:
            waiting[top], waiting[top + 1] = 2 * box + 1, 2 * box
            top += 2
            continue
        start = (box - leaves) * POINTS_PER_BOX
        for i in range(start, min(start + POINTS_PER_BOX, len(points))):
            square = (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 + (points[i, 2] - z) ** 2
            squares[number], found[number] = square, order[i]
            number += 1 if square <= reach else 0
    return number
