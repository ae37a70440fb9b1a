"""Kernel of the search for faint lines: sums over cells along and across every direction."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def best_segment(flat, height, weight, angles, size, cell_u, cell_v, section, lengths, least):  # type: ignore[no-untyped-def]
    """(signal-to-noise, angle, place across, beginning, end) of the clearest segment in any direction; zeros if none.

    Args:
        flat: (N, 2) places.
        height: (N,) in standard deviations.
        weight: (N,) usual standard deviation over that of the place.
        angles: (A,) directions, rad.
        size: diameter of a circle about the origin that holds all places.
        cell_u, cell_v: cells along and across the line.
        section: (2 k + 1,) heights of the line's section at cells across.
        lengths: (L,) of lines in cells along, ascending.
        least: sum of the section's squares over its places that a segment must have.
    """
    rows, columns, wings = int(size / cell_v) + 3, int(size / cell_u) + 3, len(section) // 2
    low_v, low_u = -0.5 * rows * cell_v, -0.5 * columns * cell_u
    total, count = np.zeros((rows, columns)), np.zeros((rows, columns))
    signal, square = np.zeros(columns + 1), np.zeros(columns + 1)
    match, power = np.empty(columns), np.empty(columns)
    best_square, best = 0.0, np.zeros(5)
    for angle in angles:
        c, s = np.cos(angle), np.sin(angle)
        total[:], count[:] = 0.0, 0.0
        for i in range(len(height)):
            u, v = flat[i, 0] * c + flat[i, 1] * s, flat[i, 1] * c - flat[i, 0] * s
            row, column = int((v - low_v) / cell_v), int((u - low_u) / cell_u)
            total[row, column] += height[i] * weight[i]
            count[row, column] += weight[i] ** 2
        for row in range(wings, rows - wings):
            match[:], power[:] = 0.0, 0.0
            for k in range(2 * wings + 1):  # along memory, several columns at a time
                share, share2 = section[k], section[k] ** 2
                for column in range(columns):
                    match[column] += share * total[row - wings + k, column]
                for column in range(columns):
                    power[column] += share2 * count[row - wings + k, column]
            for column in range(columns):
                signal[column + 1] = signal[column] + match[column]
                square[column + 1] = square[column] + power[column]
            for length in lengths:
                better = 0
                for column in range(columns - length + 1):  # hardly ever one is: told for several at a time
                    worth = square[column + length] - square[column]
                    felt = signal[column + length] - signal[column]
                    better += (worth > least) & (felt * felt > best_square * worth)
                if better == 0:
                    continue
                for column in range(columns - length + 1):
                    worth = square[column + length] - square[column]
                    felt = signal[column + length] - signal[column]
                    if worth > least and felt * felt > best_square * worth:
                        best_square = felt * felt / worth
                        begin = low_u + column * cell_u
                        best[0], best[1], best[2] = felt / np.sqrt(worth), angle, low_v + (row + 0.5) * cell_v
                        best[3], best[4] = begin, begin + length * cell_u
    return best
