"""Blocks: the mean heights of stretches of half a tip radius, and which of them one smooth surface can join."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapping import BoolArray, FloatArray, IntArray
from mapping.base import LaidSweep, LaidTrace, SweepHeights
from mapping.instrument import MAD_TO_SD

# Width of a bin in tip radii, and bins in a block: a crest of 0.06 tip radii spans three blocks under its whole width
BIN, BINS_PER_BLOCK = 0.1, 5
# Bins are no narrower than the samples are apart: one without a sample would be filled from its neighbours, curved by
# nothing, and most of them being so would say that there is no noise, and that the surface jumps at every sample.
# Of a long trace bins are wider: so many blocks tell any smooth deviation
MOST_DEVIATION_BLOCKS = 4000
# A smooth deviation is no steeper than this. The trace of an edge of height h rises by it within sqrt(2 r h), with the
# slope sqrt(h / 2 r): an edge of 0.005 tip radii and higher is steeper, and a model 3 degrees off is not.
STEEPEST = 0.05
# Heights that differ by less than so many standard deviations may be the same
SAME = 4.0
# Bins to either side of a place whose means differ where it is an edge, beyond how the bins further out go on: noise
# makes JUMP_SD standard deviations of a bin of that (weights 1/2, 3/2, 3/2, 1/2 over three bins each), and a field two
# tip radii long and 0.15 tip radii high LEAST_JUMP tip radii (its third derivative over three bins)
JUMP_BINS, JUMP_SD, LEAST_JUMP = 3, float(np.sqrt(5.0 / 3.0)), 5e-4
# Neighbours that a block is compared with beyond its own sweep, and cosine of the angle by which their normals differ
BLOCK_NEIGHBOURS, SAME_SIDE_COSINE = 6, 0.5
# Blocks from one side of a fine feature to the other, at most
BLOCKS_ACROSS = 5
# Nor is it, from one sweep to the next, so many times steeper than this share of all neighbours are: over the gap
# between two sweeps an edge is as gentle as any slope, but it is in one place alone
USUAL_TIMES, USUAL_SHARE = 2.0, 0.75
# By how much more than that share of them two sweeps that drift may be apart: of Gaussian levels one pair in 200,000 is
DRIFTING_TIMES = 4.0
TINY = float(np.finfo(float).tiny)
# Files of meshes hold single precision: of a coordinate so large a share is rounding
SINGLE = 2.0**-24
# A sweep of fewer bins tells nothing of long wavelengths
FEWEST_BINS = 3
# Blocks whose middles are nearer than half of one have more than half of their path in common, and lie in one place;
# which share it is hardly matters, for passes are counted against the usual number of them. Two sides of a wall are two
# places: normals count as so many tip radii, so that faces at right angles are 2.8 apart, farther than any place or
# cell (2) is wide
PLACE, SIDES_APART = 0.5 * BIN * BINS_PER_BLOCK, 2.0


@dataclass(frozen=True, eq=False)
class Blocks:
    """Mean heights over the base.

    Args:
        points: (B, 3) feet of the blocks' middles, m.
        normals: (B, 3) unit directions from there to the ball.
        height: (B,) m.
        sweep: (B,) number of the sweep that each is a part of.
        piece: (B,) number of the unbroken stretch of that sweep, not decreasing.
        place: (B,) arclength along it, m.
        t: (B,) when it was felt, s.
        steepness: (B,) largest slope of the height between the bins of a block and on to the next, beyond noise.
        edge: (B,) whether the height jumps there, however little.
        weight: (B,) what each counts, so that no place counts more than the usual one, however often it was passed: a
            finger that explores goes where the details are, and of the model it learns there no more than elsewhere.
        noise: standard deviation of one block by the differences of neighbouring bins, or a mesh's rounding, m.
    """

    points: FloatArray
    normals: FloatArray
    height: FloatArray
    sweep: IntArray
    piece: IntArray
    place: FloatArray
    t: FloatArray
    steepness: FloatArray
    edge: BoolArray
    weight: FloatArray
    noise: float

    @classmethod
    def of(cls, laid: LaidTrace, metres: float | None = None) -> Blocks:
        """The blocks of all sweeps over the base that they are laid on.

        Args:
            metres: length of all sweeps that was foretold where they were laid out beforehand (see `lay_out`); None:
                as long as they are.
        """
        tip = laid.tip_radius
        sweeps = [sweep for sweep in laid.laid_sweeps if len(sweep.trace) > 1]
        spacing = _bins(sum(float(sweep.arclength[-1]) for sweep in sweeps) if metres is None else metres, tip)
        profiles = [profile for sweep in sweeps for profile in _binned(sweep, spacing)]
        profiles = [p for p in profiles if len(p.height) >= FEWEST_BINS]
        # of samples far apart a block takes as many as its length does: a longer one would be wider than a feature
        each = [max(1, round(BINS_PER_BLOCK * spacing / p.spacing)) for p in profiles]
        curved = np.concatenate([np.zeros(0), *(np.diff(p.height, 2) for p in profiles)])
        sd = MAD_TO_SD * float(np.median(np.abs(curved))) / np.sqrt(6.0) if len(curved) else 0.0
        parts = [
            _grouped(p, number, bins, sd, laid) for number, (p, bins) in enumerate(zip(profiles, each, strict=True))
        ]
        if not parts:
            nothing = np.zeros(0)
            none = nothing.astype(np.int64)
            empty = np.zeros((0, 3))
            return cls(empty, empty, nothing, none, none, nothing, nothing, nothing, none > 0, nothing, 0.0)
        points, normals, height, piece, place, steepness, edge = map(np.concatenate, zip(*parts, strict=True))
        sweep = np.array([p.sweep for p in profiles])[piece]
        own = {s.number: s for s in laid.laid_sweeps}
        felt = [(own[profile.sweep], part[4]) for profile, part in zip(profiles, parts, strict=True)]
        t = np.concatenate([np.interp(where, of.arclength, of.trace.t) for of, where in felt])
        noise = max(
            sd / np.sqrt(float(np.median(np.array(each)[piece]))),
            SINGLE * float(np.abs(laid.base.surface.vertices).max()),
        )
        weight = _weights(points, normals, tip)
        return cls(points, normals, height, sweep, piece, place, t, steepness, edge, weight, noise)

    def __len__(self) -> int:
        return len(self.height)

    @property
    def step(self) -> float:
        """Length of the usual block, m; 0 of a single one."""
        along = np.diff(self.place)[np.diff(self.piece) == 0]
        return float(np.median(along)) if len(along) else 0.0

    def apart(self, distance: float) -> BoolArray:
        """(B,) True for blocks further (m) from all that is steep: nearer, a height may be the skirt of a feature."""
        from scipy.spatial import cKDTree

        steep = self.points[self.steepness > STEEPEST]
        if not len(steep):
            return np.ones(len(self), dtype=bool)
        return np.asarray(cKDTree(steep).query(self.points)[0] > distance)

    @cached_property
    def smooth_as_felt(self) -> BoolArray:
        """(B,) as `smooth` says of the heights as they are: asked at every turn."""
        return self.smooth(self.height)

    def smooth(self, height: FloatArray, drifting: bool = False) -> BoolArray:
        """(B,) True for the blocks of the largest part of the surface that no steep place divides.

        Fine features and the further side of steps stand off it, and would be bent away if they counted.

        Args:
            height: (B,) of the blocks, what is known of them already taken off, m.
            drifting: whether each sweep may stand at a level of its own.
        """
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components
        from scipy.spatial import cKDTree

        count, gentle = len(self), (self.steepness <= STEEPEST) & ~self.edge
        here = np.arange(count)
        along = (np.diff(self.piece) == 0) & gentle[:-1] & gentle[1:]
        one, other = [here[:-1][along]], [here[1:][along]]
        near = np.asarray(cKDTree(self.points).query(self.points, min(BLOCK_NEIGHBOURS + 1, count))[1])
        # and those a few blocks on: beyond a ridge the height is what it was before it, beyond a step it is not
        ahead = [(here[:-lag], here[lag:]) for lag in range(2, BLOCKS_ACROSS + 1)]
        ahead = [(i[same], j[same]) for i, j in ahead for same in [self.piece[i] == self.piece[j]]]
        first = np.concatenate([np.repeat(here, near.shape[1] - 1), *(i for i, _ in ahead)])
        second = np.concatenate([near[:, 1:].ravel(), *(j for _, j in ahead)])
        sides = (self.normals[first] * self.normals[second]).sum(axis=1) > SAME_SIDE_COSINE
        first, second = (each[sides & gentle[first] & gentle[second]] for each in (first, second))
        apart = np.linalg.norm(self.points[first] - self.points[second], axis=1)
        rise = np.maximum(np.abs(height[first] - height[second]) - SAME * np.sqrt(2.0) * self.noise, 0.0)
        slope = rise / np.maximum(apart, TINY)
        usual = np.full(len(slope), USUAL_TIMES * float(np.quantile(slope, USUAL_SHARE)) if len(slope) else 0.0)
        between = self.piece[first] != self.piece[second]
        if drifting and between.any():
            usual[between] = DRIFTING_TIMES * float(np.quantile(slope[between], USUAL_SHARE))
        alike = slope <= np.minimum(STEEPEST, usual)
        one.append(first[alike])
        other.append(second[alike])
        rows, columns = np.concatenate(one), np.concatenate(other)
        graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count))
        label = connected_components(graph, directed=False)[1]
        return np.asarray(label == np.bincount(label).argmax())


def lay_out(laid: LaidTrace, metres: float) -> None:
    """Lay sweeps out in the bins that `Blocks.of` will ask for once all are felt, so that it need not do it at once.

    Args:
        metres: length of all sweeps, as far as it can be foretold.
    """
    for sweep in laid.laid_sweeps:
        if len(sweep.trace) > 1:
            _binned(sweep, _bins(metres, laid.tip_radius))


def _bins(metres: float, tip: float) -> float:
    """Width of the bins of so many metres of sweeps, m."""
    return max(BIN * tip, metres / (BINS_PER_BLOCK * MOST_DEVIATION_BLOCKS))


def _binned(sweep: LaidSweep, spacing: float) -> tuple[SweepHeights, ...]:
    """A sweep's heights in bins of a width (m), or as wide as its samples are apart."""
    return sweep.heights(max(spacing, float(sweep.arclength[-1]) / (len(sweep.trace) - 1)))


def _grouped(
    profile: SweepHeights, number: int, bins: int, sd: float, laid: LaidTrace
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray, BoolArray]:
    """The blocks of one profile: points, normals, heights, its number, places, steepness, edges (see Blocks).

    Args:
        bins: in a block.
        sd: noise of one bin, m.
    """
    starts = np.arange(0, len(profile.height), bins)
    if len(starts) > 1 and len(profile.height) - starts[-1] < min(FEWEST_BINS, bins):
        starts = starts[:-1]
    counts = np.diff(np.append(starts, len(profile.height)))
    middle = starts + counts // 2
    if profile.feet is None or profile.normals is None:
        feet = laid.base.foot(profile.centers[middle], laid.tip_radius)
        points, normals = feet.points, feet.normals
    else:
        points, normals = profile.feet[middle], profile.normals[middle]
    rise = np.maximum(np.abs(np.diff(profile.height)) - SAME * np.sqrt(2.0) * sd, 0.0) / profile.spacing
    jumps = _jumps(profile.height) > max(SAME * JUMP_SD * sd, LEAST_JUMP * laid.tip_radius)
    steep, edge = (np.maximum.reduceat(np.append(values, 0), starts) for values in (rise, jumps))
    height, place = (np.add.reduceat(values, starts) / counts for values in (profile.height, profile.s))
    return points, normals, height, np.full(len(starts), number), place, steep, edge > 0


def _weights(points: FloatArray, normals: FloatArray, tip: float) -> FloatArray:
    """(B,) of blocks at places (B, 3): 1 where no more of them lie than in the usual place, else in proportion less."""
    from scipy.spatial import cKDTree

    places = np.column_stack([points, SIDES_APART * tip * normals])
    counts = cKDTree(places).query_ball_point(places, PLACE * tip, return_length=True)
    passes = np.asarray(counts, dtype=np.float64)
    return np.asarray(np.minimum(weighted_median(passes, 1.0 / passes) / passes, 1.0))


def weighted_median(values: FloatArray, weight: FloatArray) -> float:
    """The value (N,) up to which half of the weight (N,) lies."""
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weight[order])
    return float(values[order[np.searchsorted(below, 0.5 * below[-1])]])


def _jumps(height: FloatArray) -> FloatArray:
    """(n - 1,) by how much the heights (n,) of bins jump from each to the next; zero near the ends.

    What is smooth goes on as it came: half of the rise before and half of that behind are taken off.
    """
    jumps = np.zeros(max(len(height) - 1, 0))
    means = np.convolve(height, np.full(JUMP_BINS, 1.0 / JUMP_BINS), mode="valid")
    if len(means) > 3 * JUMP_BINS:
        before, left, right, behind = (means[k * JUMP_BINS : len(means) - (3 - k) * JUMP_BINS] for k in range(4))
        jumps[2 * JUMP_BINS - 1 :][: len(left)] = np.abs(1.5 * (right - left) - 0.5 * (behind - before))
    return jumps
