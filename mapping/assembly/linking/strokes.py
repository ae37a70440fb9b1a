"""Strokes: the straight pieces of a line that bends in corners.

Reference: Douglas and Peucker, Algorithms for the reduction of the number of points required to represent a digitized
line, Cartographica 10, 1973.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping import FloatArray
from mapping.assembly.linking.branches import Branch, nearest_to_lines

# Middle and direction of a straight line
Straight = tuple[FloatArray, FloatArray]


def strokes(line: Branch, tolerance: float, shortest: float) -> list[Branch]:
    """The straight pieces of a line, which meet in its corners; none if it has no corner.

    Args:
        line: a course.
        tolerance: distance from a straight piece up to which points are of it, m.
        shortest: length of a piece: what is shorter is a corner, which a line cuts, m.
    """
    axis = line.axis
    if line.closed:  # it begins where it turns: a piece is not cut
        farthest = int(np.linalg.norm(axis - axis.mean(axis=0), axis=1).argmax())
        axis = np.vstack([axis[farthest:], axis[: farthest + 1]])
    cuts = _cuts(axis, tolerance)
    pieces = [axis[first : last + 1] for first, last in itertools.pairwise(cuts)]
    pieces = [piece for piece in pieces if np.linalg.norm(piece[-1] - piece[0]) > shortest]
    if len(pieces) < 2:
        return []
    straight = [_through(piece) for piece in pieces]
    corners = [_corner(pieces[k : k + 2], straight[k : k + 2], shortest) for k in range(len(pieces) - 1)]
    first, last = _on(straight[0], axis[0]), _on(straight[-1], axis[-1])
    if line.closed:
        first = last = _corner([pieces[-1], pieces[0]], [straight[-1], straight[0]], shortest)
    free = (line.free[0] and not line.closed, *(False for _ in corners), line.free[1] and not line.closed)
    return [
        replace(line, axis=np.stack(ends), free=each, junction=True, closed=False)
        for ends, each in zip(itertools.pairwise([first, *corners, last]), itertools.pairwise(free), strict=True)
    ]


def _cuts(axis: FloatArray, tolerance: float) -> list[int]:
    """Indices of the ends of straight pieces of a polyline (K, 3), its own ends among them."""
    chord = axis[-1] - axis[0]
    length = float(np.linalg.norm(chord))
    off = axis - axis[0]
    if length > tolerance:
        off = off - np.outer(off @ chord, chord) / length**2
    away = np.linalg.norm(off, axis=1)
    farthest = int(away.argmax())
    if away[farthest] < tolerance or len(axis) < 3 or farthest in (0, len(axis) - 1):
        return [0, len(axis) - 1]
    return [*_cuts(axis[: farthest + 1], tolerance)[:-1], *(farthest + k for k in _cuts(axis[farthest:], tolerance))]


def _through(piece: FloatArray) -> Straight:
    """The straight line through points (K, 3), in their order."""
    middle = piece.mean(axis=0)
    way = np.linalg.svd(piece - middle, full_matrices=False)[2][0]
    return middle, way * (1.0 if way @ (piece[-1] - piece[0]) > 0.0 else -1.0)


def _corner(pieces: Sequence[FloatArray], straight: Sequence[Straight], reach: float) -> FloatArray:
    """Where two pieces that follow each other meet."""
    return nearest_to_lines(list(straight), 0.5 * (pieces[0][-1] + pieces[1][0]), reach)


def _on(straight: Straight, point: FloatArray) -> FloatArray:
    """The place of a straight line that is nearest to a point (3,)."""
    middle, way = straight
    return np.asarray(middle + ((point - middle) @ way) * way)
