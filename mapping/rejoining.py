"""Rejoining: pieces of one line that the tree of its points left apart."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mapping.branches import DIRECTION, LONGEST_GAP, STRAIGHT_ON, Branch

FloatArray = NDArray[np.float64]
FreeEnd = tuple[int, int]


def rejoined(lines: list[Branch], half_width: float, denied: Callable[[FloatArray, FloatArray], bool]) -> list[Branch]:
    """The lines, those of them joined that go straight on into each other over a gap that nothing denies.

    Where two lines run side by side with few crossings, the way across to the other one may be shorter than the way on:
    the tree of all points then hangs a line on its neighbour in pieces. Such a piece may be a single point, which goes
    wherever a line leads to it.

    Args:
        lines: some of which end free.
        half_width: of the disturbance, m.
        denied: whether a place between two points (3,) felt no crest.
    """
    lines = list(lines)
    while (pair := _straightest(lines, half_width, denied)) is not None:
        (a, e), (b, f) = pair
        first, second = _turned(lines[a], 1 - e), _turned(lines[b], f)
        axis = np.concatenate([first.axis, second.axis])
        whole = Branch(axis, (first.free[0], second.free[1]), first.junction or second.junction)
        lines = [line for k, line in enumerate(lines) if k not in (a, b)] + [whole]
    return lines


def _turned(line: Branch, turn: int) -> Branch:
    """The line, backwards if `turn` is 1."""
    return Branch(line.axis[::-1], line.free[::-1], line.junction) if turn else line


def _straightest(
    lines: list[Branch], half_width: float, denied: Callable[[FloatArray, FloatArray], bool]
) -> tuple[FreeEnd, FreeEnd] | None:
    """The two free ends of different lines that continue each other best, if any do."""
    ends = [(k, e) for k, line in enumerate(lines) if not line.closed for e in (0, 1) if line.free[e]]
    way = {(k, e): _outward(lines[k].axis, e, DIRECTION * half_width) for k, e in ends if len(lines[k].axis) > 1}
    best, pair = -STRAIGHT_ON, None
    for one in ends:
        for other in ends:
            start, stop = (lines[k].axis[-e] for k, e in (one, other))
            length = float(np.linalg.norm(stop - start))
            if one[0] >= other[0] or not 0.0 < length < LONGEST_GAP * half_width:
                continue
            gap = (stop - start) / length
            turns = [float(sign * way[end] @ gap) for end, sign in ((one, 1), (other, -1)) if end in way]
            turns += [float(-way[one] @ way[other])] if len(turns) == 2 else []
            straight = min(turns, default=-1.0)
            if straight > best and not denied(start, stop):
                best, pair = straight, (one, other)
    return pair


def _outward(axis: FloatArray, end: int, reach: float) -> FloatArray:
    """Unit direction (3,) off an end of a line, over a stretch before it."""
    points = axis if end == 0 else axis[::-1]
    away = np.linalg.norm(points - points[0], axis=1)
    far = min(int(np.searchsorted(away, reach)), len(points) - 1)
    step = points[0] - points[max(far, 1)]
    return np.asarray(step / np.linalg.norm(step))
