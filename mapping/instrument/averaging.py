"""RunMeans: long recordings as the means of runs of consecutive samples, taken while the samples pass by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray, IntArray

# A run whose positions fall back along its way by more than this holds a turn, not noise: standard deviations of one
# position (white noise of 1e6 samples has a range of 10), and a share of the run's length, below which no mean moves
TURN_SDS, TURN_SHARE = 12.0, 0.01
# Runs that are looked at before those in front of them are taken: what is left before a turn is then a run or more
LOOK_AHEAD = 2
# Of white noise, the mean absolute second difference is so many standard deviations: sqrt(6) sqrt(2 / pi)
SECOND_DIFFERENCE = float(np.sqrt(12.0 / np.pi))


def running_mean(values: FloatArray, half: int) -> FloatArray:
    """(N,) means over 2 half + 1 values (N,), over fewer at the ends."""
    return np.asarray(running_means(values, np.array([half]))[0])


def running_means(values: FloatArray, halves: IntArray) -> FloatArray:
    """(K, N) the same for each of K halves."""
    from mapping.instrument.averaging_kernels import means_about

    return np.asarray(means_about(np.ascontiguousarray(values, dtype=np.float64), halves))


@dataclass(frozen=True, eq=False)
class Means:
    """What became of some samples.

    Args:
        values: (M, C) means of the runs.
        first: (M,) number of each run's first sample, counted over all samples from 0.
        count: (M,) samples of each run.
    """

    values: FloatArray
    first: IntArray
    count: IntArray


class RunMeans:
    """Means of runs of consecutive samples, in memory that does not grow with the recording.

    A stretch ends where the caller cuts it (the end of a sweep, a jump, a gap) and where the path turns back. Within a
    stretch each run has `length` samples; the last one or two share what remains, 3/4 to 3/2 of that; a stretch of
    fewer than half is left out. What comes out does not depend on the pieces that the samples come in, but for where
    within its noise a path turns.

    Args:
        length: samples of a run.
    """

    def __init__(self, length: int) -> None:
        if length < 1:
            raise ValueError(f"runs need one sample or more; found {length}")
        self.length = length
        self.left_out = self.turns = 0
        self._held: FloatArray = np.zeros((0, 3))
        self._cut: BoolArray = np.zeros(0, dtype=np.bool_)
        self._passed = 0  # samples before those that are held

    def add(self, values: FloatArray, cut: BoolArray) -> Means:
        """The runs that are whole after some more samples.

        Args:
            values: (N, C), of which the first three are the position, m.
            cut: (N,) True where a sample does not follow the one before it.
        """
        if len(self._held):
            values, cut = np.concatenate([self._held, values]), np.concatenate([self._cut, cut])
        return self._taken(values, cut, False)

    def rest(self) -> Means:
        """The last runs, when all samples have passed by."""
        return self._taken(self._held, self._cut, True)

    def _taken(self, values: FloatArray, cut: BoolArray, last: bool) -> Means:
        """Means of what is whole; the end of the last stretch is held back for what may follow it."""
        begins = np.union1d(np.flatnonzero(cut), [0]) if len(values) else np.zeros(0, dtype=np.int64)
        ends = np.append(begins[1:], len(values))[: len(begins)]
        open_end = np.zeros(len(begins), dtype=np.bool_)
        open_end[-1:] = not last
        firsts, counts, held = [], [], len(values)
        while len(begins):
            first, count, stretch, rest = runs(begins, ends, open_end, self.length)
            at = turns(values[:, :3], first, count)
            turned = np.isin(stretch, stretch[at >= 0])  # their runs are made anew, with the turns for cuts
            # of an open stretch two runs are looked at and not taken yet: no turn follows close behind the others
            ahead = open_end[stretch] & (first + LOOK_AHEAD * self.length >= rest)
            firsts.append(first[~turned & ~ahead])
            counts.append(count[~turned & ~ahead])
            again = np.unique(stretch[turned])
            self.turns += int((at >= 0).sum())
            kept = np.ones(len(begins), dtype=np.bool_)
            kept[again] = False
            closed = kept & ~open_end
            taken = np.bincount(stretch, count, len(begins))
            self.left_out += int((ends - begins - taken)[closed].sum())
            if (kept & open_end).any():
                held = max(rest - LOOK_AHEAD * self.length, int(begins[open_end][0]))
            parts = np.union1d(begins[again], at[at >= 0])
            tails = {int(end): bool(more) for end, more in zip(ends[again], open_end[again], strict=True)}
            stops = np.union1d(ends[again], parts)
            begins, ends = parts, stops[np.searchsorted(stops, parts, side="right")]
            open_end = np.array([tails.get(int(end), False) for end in ends], dtype=np.bool_)
        first, count = np.concatenate([*firsts, begins]), np.concatenate([*counts, begins])
        order = np.argsort(first)
        first, count = first[order].astype(np.int64), count[order].astype(np.int64)
        means = np.empty((len(first), values.shape[1]))
        if len(first):
            inside = rows_of(first, count)
            edges = np.cumsum(count) - count
            means[:] = np.add.reduceat(values[inside], edges, axis=0) / count[:, None]
        found = Means(means, first + self._passed, count)
        self._held, self._cut = values[held:].copy(), cut[held:].copy()
        self._passed += held
        return found


def runs(begins: IntArray, ends: IntArray, is_open: BoolArray, length: int) -> tuple[IntArray, IntArray, IntArray, int]:
    """Runs of stretches: (R,) first samples, counts and stretches, and where what an open stretch holds back begins.

    Args:
        begins, ends: (S,) first sample of each stretch, and the one after its last.
        is_open: (S,) more may follow: of these only whole runs are taken that leave two more.
        length: samples of a run.
    """
    size = ends - begins
    whole = np.maximum(size // length - 1, 0)
    left = size - whole * length  # fewer than two runs
    more = np.where(2 * left < length, 0, np.where(2 * left < 3 * length, 1, 2))
    more[is_open] = 0
    number = whole + more
    stretch = np.repeat(np.arange(len(begins)), number)
    at = np.arange(len(stretch)) - np.repeat(np.cumsum(number) - number, number)
    half = np.where(more == 2, left // 2, left)[stretch]
    nth = at - whole[stretch]  # of those that share what remains
    first = begins[stretch] + np.minimum(at, whole[stretch]) * length + np.where(nth > 0, half, 0)
    count = np.where(nth < 0, length, np.where(nth == 0, half, left[stretch] - half))
    rest = int((begins + whole * length)[is_open][0]) if is_open.any() else 0
    return first, count, stretch, rest


def rows_of(first: IntArray, count: IntArray) -> IntArray | slice:
    """The samples of runs, one run after the other; a slice where they are neighbours."""
    if len(first) and (first[1:] == first[:-1] + count[:-1]).all():
        return slice(int(first[0]), int(first[-1] + count[-1]))
    return np.repeat(first - (np.cumsum(count) - count), count) + np.arange(int(count.sum()))


def turns(points: FloatArray, first: IntArray, count: IntArray) -> IntArray:
    """(R,) the sample of each run with which the path goes back, -1 where it goes on.

    The way of a run leads from its first position to the one that is furthest from it; a path that goes on never falls
    back behind the furthest that it had come along that way.

    Args:
        points: (N, 3) positions, m.
        first, count: (R,) of the runs.
    """
    found = np.full(len(first), -1, dtype=np.int64)
    doubtful = ~_goes_on(points, first, count)
    if doubtful.any():
        found[doubtful] = _turns(points, first[doubtful], count[doubtful])
    return found


def _goes_on(points: FloatArray, first: IntArray, count: IntArray) -> BoolArray:
    """(R,) True where x, or y, only rises or only falls, over as much as the other covers: most runs, cheaply told."""
    inside, edges = rows_of(first, count), np.cumsum(count) - count
    found: BoolArray = np.zeros(len(first), dtype=np.bool_)
    if not len(first):
        return found
    columns = [points[inside, axis] for axis in (0, 1)]
    spans = [np.maximum.reduceat(each, edges) - np.minimum.reduceat(each, edges) for each in columns]
    for column, span, other in zip(columns, spans, spans[::-1], strict=True):
        steps = np.diff(column, prepend=column[0])
        steps[edges] = 0.0
        up, down = np.maximum.reduceat(steps, edges) > 0.0, np.minimum.reduceat(steps, edges) < 0.0
        found |= (up != down) & (span >= other)
    return found


def _turns(points: FloatArray, first: IntArray, count: IntArray) -> IntArray:
    """The same of runs that have to be looked at more closely."""
    found = np.full(len(first), -1, dtype=np.int64)
    edges = np.cumsum(count) - count
    which = np.repeat(np.arange(len(first)), count)
    away = points[rows_of(first, count)] - points[first][which]
    reach = np.einsum("ij,ij->i", away, away)
    way = away[_first_of(reach == np.maximum.reduceat(reach, edges)[which], which)]
    length = np.sqrt(np.einsum("ij,ij->i", way, way))
    way /= np.where(length > 0.0, length, 1.0)[:, None]
    u = np.einsum("ij,ij->i", away, way[which])
    span = np.maximum.reduceat(u, edges) - np.minimum.reduceat(u, edges)
    bends = np.zeros(len(u))
    bends[1:-1] = np.where(which[2:] == which[:-2], np.abs(u[2:] - 2.0 * u[1:-1] + u[:-2]), 0.0)
    sd = np.add.reduceat(bends, edges) / np.maximum(count - 2, 1) / SECOND_DIFFERENCE
    sd = np.minimum(sd, np.median(sd))  # of few samples the turn itself is the noise
    allowed = np.maximum(TURN_SDS * sd, TURN_SHARE * span)
    steps = (2.0 * np.cumsum(span) - span)[which]  # each run lies above the one before: one running maximum serves all
    furthest = np.maximum.accumulate(u + steps)
    fallen = furthest - steps - u > allowed[which]
    at = np.flatnonzero(fallen)
    back, once = np.unique(which[at], return_index=True)
    if not len(back):
        return found
    record = np.maximum.accumulate(np.where(u + steps >= furthest, np.arange(len(u)), 0))[at[once]]
    lowest = _first_of(u == np.minimum.reduceat(u, edges)[which], which)[back]
    # a path that first goes away from its furthest place turns at the other end of its way
    turn = np.where(record == edges[back], lowest, record)
    found[back] = (first - edges)[back] + turn + 1
    return _at_the_step_aside(points, found, first, count, way)


def _at_the_step_aside(
    points: FloatArray, found: IntArray, first: IntArray, count: IntArray, way: FloatArray
) -> IntArray:
    """The turns at the step that leads aside, from row to row: which of its ends is the last of a row is chance."""
    back = np.flatnonzero(found >= 0)
    low, high = first[back] + 1, first[back] + count[back] - 1
    near = np.clip(found[back, None] + np.array([0, -1, 1]), low[:, None], high[:, None])
    step = points[near] - points[near - 1]
    along = np.einsum("ijk,ik->ij", step, way[back])
    aside = np.einsum("ijk,ijk->ij", step, step) - along**2
    found[back] = near[np.arange(len(back)), np.argmax(aside, axis=1)]
    return found


def _first_of(mask: BoolArray, which: IntArray) -> IntArray:
    """(R,) the first row of each run that a mask holds; each has one."""
    rows = np.flatnonzero(mask)
    return np.asarray(rows[np.unique(which[rows], return_index=True)[1]])
