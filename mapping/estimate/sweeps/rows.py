"""Rows: which sweeps run side by side, how far apart, and how to thin them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, lengths
from mapping.geometry.mesh import BoxedPoints

# Places along a line from which its distance to another is taken: the distance that a fifth of them lie beyond is then
# that of a fifth of the line to within 5 % of it (binomial)
PROBES = 65


def parallel_rows(points: FloatArray, sweep: IntArray) -> list[IntArray] | None:
    """Indices of each sweep, neighbours next to each other, if consecutive sweeps run side by side; else None."""
    rows = _of_each(sweep)
    if len(rows) < 2 or min(len(row) for row in rows) < 2:
        return None
    beside, as_felt = _Beside([points[row] for row in rows]), [*range(len(rows))]
    found: list[tuple[float, list[int]]] = []
    for order in (as_felt, _across(points, rows)):
        total = 0.0
        for first, second in pairwise(order):
            total += beside.distance(first, second)
            if np.isnan(total):
                break  # explored crosswise: the first pair or two tell
        else:
            found.append((total * (1 - 1e-9 * (order is as_felt)), order))
    return [rows[k] for k in min(found, key=lambda pair: pair[0])[1]] if found else None


def _of_each(sweep: IntArray) -> list[IntArray]:
    """Indices of the samples of each sweep, in the order in which the sweeps begin."""
    first, counts = np.unique(sweep, return_index=True, return_counts=True)[1:]
    each = np.split(np.argsort(sweep, kind="stable"), np.cumsum(counts)[:-1])
    return [each[k] for k in np.argsort(first)]


def _across(points: FloatArray, rows: list[IntArray]) -> list[int]:
    """Numbers of the rows, sorted by their middle along the direction in which the middles spread most."""
    middles = np.array([points[row].mean(axis=0) for row in rows])
    spread = np.linalg.svd(middles - middles.mean(axis=0), full_matrices=False)[2][0]
    return [int(k) for k in np.argsort(middles @ spread, kind="stable")]


class _Beside:
    """How far polylines are apart: each has boxes about it, and what a pair was asked for once is known."""

    def __init__(self, lines: list[FloatArray]) -> None:
        self.lines = lines
        self._boxed: dict[int, BoxedPoints] = {}
        self._ways: dict[tuple[int, int], tuple[float, float, float]] = {}

    def distance(self, first: int, second: int) -> float:
        """Usual distance of two lines that run side by side; NaN if they do not keep one distance or meet."""
        (usual, near, far), (_, near_back, far_back) = self._way(first, second), self._way(second, first)
        near, far = min(near, near_back), max(far, far_back)
        reach = np.linalg.norm(self.lines[first][-1] - self.lines[first][0])
        beside = usual > 0 and near > 0.2 * usual and far < 2.5 * usual and (reach == 0 or usual < 2 * reach + far)
        return usual if beside else float("nan")

    def _way(self, first: int, second: int) -> tuple[float, float, float]:
        """Distances from places along one line to another: usual, least, and the one that a fifth is beyond."""
        if (first, second) not in self._ways:
            if second not in self._boxed:
                self._boxed[second] = BoxedPoints(self.lines[second])
            line = self.lines[first]
            places = np.linspace(0, len(line) - 1, min(len(line), PROBES)).astype(int)
            distance = self._boxed[second].nearest(line[places])[0]
            told = float(np.median(distance)), float(np.min(distance)), float(np.quantile(distance, 0.8))
            self._ways[first, second] = told
        return self._ways[first, second]


def pitch(points: FloatArray, sweep: IntArray) -> float:
    """Usual distance from a sample to the nearest sample of another sweep, m; 0 for a single sweep."""
    rows = _of_each(sweep)
    if len(rows) < 2:
        return 0.0
    distances = []
    for own, following in pairwise(rows):
        probes = points[own[np.linspace(0, len(own) - 1, min(len(own), 33)).astype(int)]]
        distances.append(float(np.median(BoxedPoints(points[following]).nearest(probes)[0])))
    return float(np.median(distances))


def thinned(points: FloatArray, sweep: IntArray, spacing: float, keep: BoolArray | None = None) -> IntArray:
    """Indices of samples at least `spacing` apart along each sweep, with its ends and whatever `keep` marks."""
    if spacing <= 0:
        return np.arange(len(points))
    steps = lengths(np.diff(points, axis=0, prepend=points[:1]))
    border = np.r_[True, np.diff(sweep) != 0]
    length = np.cumsum(np.where(border, 0.0, steps))
    # A sweep is cut into equal cells of its length; the first sample of each cell stays.
    start = np.maximum.accumulate(np.where(border, np.arange(len(points)), 0))
    cell = np.floor((length - length[start]) / spacing * (1 + 1e-12))
    chosen = border | np.r_[border[1:], True] | np.r_[True, np.diff(cell) != 0]
    return np.flatnonzero(chosen if keep is None else chosen | keep)
