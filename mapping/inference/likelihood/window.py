"""Window: the binned samples of a trace near one feature, all that its posterior depends on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapping import BoolArray, EmptyWindowError, FloatArray, IntArray, Trace, sides_of_box
from mapping.base import Base, Feet, LaidTrace, on_walls, over_levels
from mapping.instrument import Levels

# Samples are looked at in blocks of this many: the cost of the rest of a long log is that of its boxes.
SAMPLES_PER_BLOCK = 64
# Rounding of a plane's faces: by how much their normals may differ, and the feet on them rise off it for their reach
PLANE_ROUNDING = 1e-9
# Legs that a run's course is compared by; a run has four samples to each of them at least
COURSE_LEGS = 4
# Passes over one line share this part of the longer of them: noise scatters samples about the rim of a window
SHARED_SPAN = 0.5
# Standard deviations of its noise by which a pass may seem to lie farther off
APART_SDS = 3.0


@dataclass(frozen=True, eq=False)
class Window:
    """Bins along each run of consecutive samples near a feature.

    Args:
        feet: (n, 3) mean foot points of the bins on the base, m, smoothed along the run.
        normals: (n, 3) unit normals of the base there.
        tangents: (n, 3) unit directions of the sweep.
        height: (n,) mean height of the trace over the base's trace, m.
        count: (n,) samples in the bin.
        place: (n,) distance along the run of the bin's middle, m.
        last: (n,) distance along the run of the bin's last sample, m.
        half: (n,) half of the bin's extent, m.
        starts: (runs + 1,) first bin of each run, and n.
        samples: number of raw samples behind the bins.
        flat: True if all of them stand on one plane of the base: it neither bends nor folds between them.
        passes: (n,) passes over one line, of which the bin is the mean.
        level: (n,) standard deviation of the noise over that of its law.
        jumped: (n,) standard deviation of what else a bin's mean is off, where the height jumps between samples, m.
    """

    feet: FloatArray
    normals: FloatArray
    tangents: FloatArray
    height: FloatArray
    count: IntArray
    place: FloatArray
    last: FloatArray
    half: FloatArray
    starts: IntArray
    samples: int
    flat: bool = False
    passes: IntArray | int = 1
    level: FloatArray | float = 1.0
    jumped: FloatArray | float = 0.0

    def __len__(self) -> int:
        return len(self.height)

    @property
    def run(self) -> IntArray:
        """(n,) number of the run that each bin belongs to."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))

    def only(self, keep: BoolArray) -> Window:
        """The bins to keep (n,); a run that loses some in its midst is two."""
        run = self.run[keep]
        index = np.flatnonzero(keep)
        starts = np.flatnonzero(np.diff(index, prepend=-1) + np.diff(run, prepend=-1) > 1)

        def own(values: NDArray[Any] | float) -> Any:
            return values[keep] if isinstance(values, np.ndarray) else values

        return replace(
            self,
            feet=self.feet[keep],
            normals=self.normals[keep],
            tangents=self.tangents[keep],
            height=self.height[keep],
            count=self.count[keep],
            place=self.place[keep],
            last=self.last[keep],
            half=self.half[keep],
            starts=np.append(starts, len(index)).astype(np.int64),
            samples=int(self.count[keep].sum()),
            passes=own(self.passes),
            level=own(self.level),
            jumped=own(self.jumped),
        )


def samples_near(trace: Trace, points: FloatArray, reach: float) -> IntArray:
    """Indices of the samples whose centres lie within `reach` of any of the points (K, 3), in order."""
    from scipy.spatial import cKDTree

    if len(trace) == 0:
        return np.zeros(0, dtype=np.int64)
    cuts = np.arange(0, len(trace), SAMPLES_PER_BLOCK)
    low, high = np.minimum.reduceat(trace.centers, cuts), np.maximum.reduceat(trace.centers, cuts)
    box_low, box_high = points.min(axis=0) - reach, points.max(axis=0) + reach
    near = np.flatnonzero(((low <= box_high) & (high >= box_low)).all(axis=1))
    tree = cKDTree(points)
    middle, radius = 0.5 * (low[near] + high[near]), 0.5 * np.linalg.norm(high[near] - low[near], axis=1)
    near = near[tree.query(middle)[0] <= reach + radius]
    index = (near[:, None] * SAMPLES_PER_BLOCK + np.arange(SAMPLES_PER_BLOCK)).ravel()
    index = index[index < len(trace)]
    distance = tree.query(trace.centers[index], distance_upper_bound=reach)[0]
    return np.asarray(index[np.isfinite(distance)])


@dataclass(frozen=True, eq=False)
class Samples:
    """The raw samples near a feature: feet on the base, the first sample of each run after the first, whether all
    of them stand on one plane, and their sweeps and times."""

    feet: Feet
    breaks: IntArray
    flat: bool
    sweep: IntArray
    t: FloatArray


def gather(trace: Trace, base: Base, points: FloatArray, normals: FloatArray, reach: float) -> Samples:
    """The samples near a feature; the cost of the rest of the trace is one look at the boxes of its blocks.

    Where the ball rests on a wall that rises out of the base beside the feature it tells nothing of it.

    Args:
        trace: the whole trace.
        base: the global model.
        points: (K, 3) crest of the feature lifted to the ball's centre, densely spaced, m.
        normals: (K, 3) unit normals of the base under it.
        reach: distance from it that still counts, m.

    Raises:
        EmptyWindowError: no sample is near.
    """
    index = samples_near(trace, points, reach)
    if len(index) == 0:
        raise EmptyWindowError(
            f"no sample of the trace ({len(trace)} in all) lies within {reach:.3g} m of the feature at "
            f"{np.array2string(points.mean(axis=0), precision=6)} m"
        )
    index, breaks = _whole_runs(index, trace.sweep)
    feet = LaidTrace.of(trace, base).feet(index)
    walls = on_walls(feet, points - trace.tip_radius * normals, normals)
    if walls.any() and not walls.all():
        feet, index = feet.select(~walls), index[~walls]
        breaks = _breaks(index, trace.sweep)
    if len(base.levels) > 1:
        feet = replace(feet, height=over_levels(feet.height, breaks, base.levels))
    return Samples(feet, breaks, _on_one_plane(feet, base), trace.sweep[index], trace.t[index])


def _on_one_plane(feet: Feet, base: Base) -> bool:
    normals = base.surface.face_normals[np.unique(feet.face)]
    turned = float(np.ptp(normals, axis=0).max())
    off, reach = np.ptp((feet.points - feet.points[0]) @ normals[0]), sides_of_box(feet.points).max()
    return bool(turned <= PLANE_ROUNDING and off <= PLANE_ROUNDING * reach)


def bin_samples(
    samples: Samples, width: float, noise_level: float, scale: float, levels: Levels | None = None
) -> Window:
    """Bin samples along their runs; passes over one line, one after the other, are one run, their mean.

    Noise is independent between passes, and they felt the same: nothing that tells of the feature is in them beside
    their mean, whose noise is that of one pass less by the root of their number (theory section 8.1).

    Args:
        samples: what `gather` found.
        width: wanted length of a bin along the sweep, m.
        noise_level: standard deviation of a sample, m: how far the path can be trusted.
        scale: half width of the feature's disturbance, m: the path is smooth over a small part of it; 0: it is not,
            and each bin lies where it was felt (a stage moves by steps, now along and now up).
        levels: of the noise along the sweeps; None: it is of one level.
    """
    feet, count = samples.feet, len(samples.feet.height)
    level = np.ones(count) if levels is None else levels.at(samples.sweep, samples.t)
    runs = []
    for start, stop in zip([0, *samples.breaks], [*samples.breaks, count], strict=True):
        own = slice(int(start), int(stop))
        path = distance_along(feet.points[own], noise_level)
        runs.append(_Run(feet.points[own], feet.normals[own], feet.height[own], path, level[own]))
    binned = [_mean_of_passes(passes, width, noise_level, scale) for passes in _over_one_line(runs, width, noise_level)]
    return replace(_join(binned), flat=samples.flat)


@dataclass(frozen=True, eq=False)
class _Run:
    """Feet on the base and their normals (N, 3), heights (N,) and distances (N,) along a line, m, and levels (N,) of
    the noise."""

    points: FloatArray
    normals: FloatArray
    height: FloatArray
    path: FloatArray
    level: FloatArray

    @property
    def backwards(self) -> _Run:
        path = self.path[0] + self.path[-1] - self.path
        return _Run(self.points[::-1], self.normals[::-1], self.height[::-1], path[::-1], self.level[::-1])

    @property
    def course(self) -> tuple[FloatArray, FloatArray]:
        """(COURSE_LEGS, 3) means of feet one after the other, and (COURSE_LEGS,) their distances, m."""
        edges = np.linspace(0, len(self.path), COURSE_LEGS + 1).astype(np.int64)
        means = np.add.reduceat(np.column_stack([self.points, self.path]), edges[:-1]) / np.diff(edges)[:, None]
        return means[:, :3], means[:, 3]


def _over_one_line(runs: list[_Run], width: float, noise_level: float) -> list[list[_Run]]:
    """The runs, those that went over one line one after the other together, by distances from where its first began."""
    lines: list[list[_Run]] = []
    for run in runs:
        again = _along(lines[-1][0], run, width, noise_level) if lines else None
        if again is None:
            lines.append([run])
        else:
            lines[-1].append(again)
    return lines


def _along(first: _Run, run: _Run, width: float, noise_level: float) -> _Run | None:
    """A run with distances along another one, whichever way it went; None if it lies beside it by more than a bin."""
    if min(len(first.path), len(run.path)) < 4 * COURSE_LEGS:
        return None
    line, at = first.course
    if not (np.diff(at) > 0.0).all():  # a ball that rolls over a corner of the body stands on it: that is no line
        return None
    if (run.points[-1] - run.points[0]) @ (line[-1] - line[0]) < 0.0:
        run = run.backwards
    points, own = run.course
    for _ in range(2):  # the second time tells how well the first did
        leg = np.clip(np.searchsorted(at, own) - 1, 0, COURSE_LEGS - 2)
        way = (line[leg + 1] - line[leg]) / np.maximum(at[leg + 1] - at[leg], np.finfo(float).tiny)[:, None]
        off = points - line[leg] - (own - at[leg])[:, None] * way
        shift = float((off * way).sum(axis=1).mean())
        own = own + shift
    path = run.path + (own[0] - run.course[1][0])
    shared = min(path[-1], first.path[-1]) - max(path[0], first.path[0])
    if shared < SHARED_SPAN * max(np.ptp(path), np.ptp(first.path)):
        return None
    # the ends of a straight line through all are known half as well as its middle
    sd = 2.0 * noise_level * float(np.hypot(len(first.path) ** -0.5, len(path) ** -0.5))
    trend = np.column_stack([np.ones(COURSE_LEGS), own])
    beside = trend[[0, -1]] @ np.linalg.lstsq(trend, off, rcond=None)[0]
    if np.linalg.norm(beside, axis=1).max() > width + APART_SDS * sd:
        return None
    return replace(run, path=path)


def _mean_of_passes(passes: list[_Run], width: float, noise_level: float, scale: float) -> Window:
    """The window of one line."""
    each = [_bin(run, width, noise_level, scale) for run in passes]
    if len(each) == 1:
        return each[0]
    cells = np.concatenate([np.floor(one.place / width).astype(np.int64) for one in each])
    count = np.concatenate([one.count for one in each])
    cell, where = np.unique(cells, return_inverse=True)
    total = np.bincount(where, count)

    def mean(name: str) -> FloatArray:
        values = np.concatenate([getattr(one, name) for one in each])
        sums = np.zeros((len(cell), *values.shape[1:]))
        np.add.at(sums, where, values * count.reshape(-1, *[1] * (values.ndim - 1)))
        return np.asarray(sums / total.reshape(-1, *[1] * (values.ndim - 1)))

    feet, normals = mean("feet"), mean("normals")
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # a pass without a sample in a cell went over it all the same
    went = [(np.floor(run.path[0] / width) <= cell) & (cell <= np.floor(run.path[-1] / width)) for run in passes]
    last, half = (cell + 1.0) * width, np.full(len(cell), 0.5 * width)
    return Window(
        feet,
        normals,
        _tangents(feet),
        mean("height"),
        total.astype(np.int64),
        mean("place"),
        last,
        half,
        np.array([0, len(cell)], dtype=np.int64),
        sum(one.samples for one in each),
        passes=np.sum(went, axis=0),
        level=mean("level"),
    )


def _whole_runs(index: IntArray, sweep: IntArray) -> tuple[IntArray, IntArray]:
    """Indices with short gaps closed (noise scatters samples about the rim of a window), and where runs begin."""
    begins = _breaks(index, sweep)
    firsts, lasts = index[np.append(0, begins)], index[np.append(begins - 1, len(index) - 1)]
    sizes = lasts - firsts + 1
    begins = np.cumsum(sizes) - sizes
    whole = np.arange(int(sizes.sum())) + np.repeat(firsts - begins, sizes)
    return whole, begins[1:]


def _breaks(index: IntArray, sweep: IntArray) -> IntArray:
    """Where among samples other runs begin, but for the first."""
    return np.flatnonzero((np.diff(index) > SAMPLES_PER_BLOCK) | (np.diff(sweep[index]) != 0)) + 1


def _join(runs: list[Window]) -> Window:
    def every(name: str) -> NDArray[Any]:
        return np.concatenate([getattr(run, name) for run in runs])

    starts = np.cumsum([0, *(len(run) for run in runs)])
    return Window(
        every("feet"),
        every("normals"),
        every("tangents"),
        every("height"),
        every("count"),
        every("place"),
        every("last"),
        every("half"),
        starts.astype(np.int64),
        sum(run.samples for run in runs),
        passes=np.concatenate([np.broadcast_to(run.passes, len(run)) for run in runs]),
        level=every("level"),
    )


def distance_along(points: FloatArray, noise_level: float) -> FloatArray:
    """(N,) distance travelled along one run, from means of blocks so long that noise cannot lengthen it."""
    count = len(points)
    chord = float(np.linalg.norm(sides_of_box(points)))
    blocks = count
    if noise_level > 0.0:
        blocks = int((chord * np.sqrt(count) / (5.0 * noise_level)) ** (2.0 / 3.0))
    blocks = min(max(blocks, 2), count)
    if blocks < 2 or chord == 0.0:
        return np.zeros(count)
    edges = np.linspace(0, count, blocks + 1).astype(np.int64)
    sizes = np.diff(edges)
    means = np.add.reduceat(points, edges[:-1]) / sizes[:, None]
    centre = edges[:-1] + 0.5 * (sizes - 1)
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(means, axis=0), axis=1))])
    index = np.arange(count)
    along = np.interp(index, centre, travelled)
    first, final = np.diff(travelled[:2])[0], np.diff(travelled[-2:])[0]
    along += np.minimum(index - centre[0], 0.0) * first / (centre[1] - centre[0])
    along += np.maximum(index - centre[-1], 0.0) * final / (centre[-1] - centre[-2])
    return np.asarray(along - along[0])


def _bin(run: _Run, width: float, noise_level: float, scale: float) -> Window:
    """The window of one run."""
    points, normals, height, path = run.points, run.normals, run.height, run.path
    cell = np.floor(path / width).astype(np.int64)
    edges = np.flatnonzero(np.diff(cell, prepend=cell[0] - 1))
    count = np.diff(np.append(edges, len(path)))
    share = _shares(path, edges, count)
    feet = np.add.reduceat(share[:, None] * points, edges)
    mean_normals = np.add.reduceat(share[:, None] * normals, edges)
    place = np.add.reduceat(share * path, edges)
    last = path[edges + count - 1]
    spacing = float(path[-1] - path[0]) / max(len(path) - 1, 1)
    # a single sample was felt at a point, however far the next one is (a machine that pecks)
    extent = np.where(count > 1, last - path[edges] + spacing, 0.0)
    if noise_level > 0.0:
        feet, mean_normals = _smooth(feet, place, width, scale), _smooth(mean_normals, place, width, scale)
    mean_normals = mean_normals / np.linalg.norm(mean_normals, axis=1, keepdims=True)
    if noise_level > 0.0:
        share, count = _without_spikes(height, edges, count, share, noise_level)
    mean_height = np.add.reduceat(share * height, edges)
    mean_level = np.add.reduceat(share * run.level, edges)
    # as many samples of equal share as would be known as well: where the finger stood, they are worth fewer
    worth = np.maximum(np.rint(1.0 / np.add.reduceat(share**2, edges)), 1.0).astype(np.int64)
    whole = np.array([0, len(count)], dtype=np.int64)
    return Window(
        feet,
        mean_normals,
        _tangents(feet),
        mean_height,
        worth,
        place,
        last,
        0.5 * extent,
        whole,
        int(count.sum()),
        level=mean_level,
    )


def _shares(path: FloatArray, edges: IntArray, count: IntArray) -> FloatArray:
    """(N,) weight of each sample in the mean over its bin: of the way it stands for, not of the time spent there.

    A template is averaged over the way; a finger that slows down at a flank leaves most samples of a bin there.
    """
    way = (
        np.maximum(np.gradient(path), 1e-3 * (path[-1] - path[0]) / len(path))
        if len(path) > 1 and path[-1] > path[0]
        else 0.0 * path + 1.0
    )
    return np.asarray(way / np.repeat(np.add.reduceat(way, edges), count))


def _without_spikes(
    height: FloatArray, edges: IntArray, count: IntArray, share: FloatArray, noise_level: float
) -> tuple[FloatArray, IntArray]:
    """Shares and counts without single samples far outside their bin (a knock, a lost bit).

    On a flank the samples of a bin differ by more than the noise: what lies between the medians of the bins beside it
    is no spike.
    """
    bins = np.repeat(np.arange(len(edges)), count)
    order = np.lexsort((height, bins))
    middle = height[order][edges + count // 2]
    beside = np.stack([middle, np.append(middle[:1], middle[:-1]), np.append(middle[1:], middle[-1:])])
    low, high = beside.min(axis=0) - 6.0 * noise_level, beside.max(axis=0) + 6.0 * noise_level
    spike = ((height < low[bins]) | (height > high[bins])) & (count[bins] >= 5)
    if not spike.any():
        return share, count
    kept = np.where(spike, 0.0, share)
    left = count - np.add.reduceat(spike.astype(np.int64), edges)
    return kept / np.repeat(np.maximum(np.add.reduceat(kept, edges), 1e-300), count), np.maximum(left, 1)


def _smooth(values: FloatArray, place: FloatArray, width: float, scale: float) -> FloatArray:
    """Local parabolas over a quarter of the feature's half width: the path's own noise goes, its course stays.

    A bin's few samples do not lie evenly in it: what the filter makes of their `place` (n,) says for where it holds,
    and each value is brought back to its own place.
    """
    smooth = _filtered(np.column_stack([values, place]), width, scale)
    smooth, at = smooth[:, :-1], smooth[:, -1]
    if len(at) < 2 or not (np.diff(at) > 0.0).all():
        return smooth
    return np.asarray(smooth + np.gradient(smooth, at, axis=0) * (place - at)[:, None])


def _filtered(values: FloatArray, width: float, scale: float) -> FloatArray:
    """Savitzky and Golay's filter (Analytical Chemistry 36, 1964); its outermost parabolas serve at both ends."""
    half = min(int(0.25 * scale / width), (len(values) - 1) // 2)
    if half < 2:
        return values
    powers = np.arange(-half, half + 1)[:, None] ** np.arange(3.0)
    fit = np.linalg.pinv(powers)
    count = 2 * half + 1
    middle = np.column_stack([np.convolve(column, fit[0][::-1], mode="valid") for column in values.T])
    first = powers[:half] @ (fit @ values[:count])
    final = powers[half + 1 :] @ (fit @ values[-count:])
    return np.concatenate([first, middle, final])


def _tangents(feet: FloatArray) -> FloatArray:
    if len(feet) < 2:
        return np.zeros_like(feet)
    along = np.gradient(feet, axis=0)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(np.divide(along, length, out=np.zeros_like(along), where=length > 0))
