"""Outliers: runs of readings that no ball on any surface can give, and readings that do not change.

The centre of a ball of radius r that touches from outside traces the upper envelope of spheres of that radius about
the points of the body (a dilation): all that lies under a sweep is a union of the ball's circles, so that the opening
by this circle changes nothing. Crests, brims and walls of any height stay; bursts, spikes, sentinels and lost contact
begin and end with a bend that no circle fits under, in whichever direction they go. What stands out of its opening by
far more than the noise does was not felt. (Serra, Image Analysis and Mathematical Morphology, 1982; theory 6.7.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, lengths
from mapping.base import LaidSweep, SweepHeights
from mapping.instrument import FEATURE_RESIDUAL_SDS, MAD_TO_SD, robust_sd

# Blocks in which the bend is looked for, in samples: a run between two of them loses less than half of its bend.
BLOCKS = (1, 3, 9, 27, 81)
# Longest run that is recognised, in tip radii: of 84 simulated bursts of a tenth to two fifths, 3 were taken for
# something felt (5 with a fifth); what is longer may be a part of the body.
LONGEST_RUN = 0.5
# Share of the tip's radius that the circle under a sweep has at least: a ball that leans by 70 degrees to the side,
# against what the sweep passes, turns about it on a circle of r cos 70. Means over blocks want a half: of steps,
# blades, grooves and pits up to 2 r high, at 5e-4 to 0.05 r between samples, they stand above their opening by up to
# 4e-3 r at 0.8 r, and nowhere at 0.5 r.
LEANT = 1.0 / 3.0
# Ways to either side in which the circle is tried to lean, beside that through both neighbours, and the factor between
# the distances of what it must stay below: the same shapes stand above nothing with 12 nor with 24 ways. Factors of 2,
# 3, 4 and 6 find the same crossings of 160 simulated details and of 120 bursts; 2 takes a third longer.
LEANT_PLACES, ARMS = 12, 3.0
# Standard deviations beyond that: at 5 kHz a Gaussian law has one such sample in 10^6 hours.
OUT = 7.0
# A single sample is out by less where so many more are than a Gaussian law lets: of those left out, it may have made
# this share (Benjamini and Hochberg 1995). Never by less than LEAST_OUT, for what is nearer costs little and tells
# much, nor for fewer than MANY_OUT: three beyond where 0.03 are expected have a chance of 0.03^3 / 6, 5 in 10^6 sweeps.
FALSELY_OUT, LEAST_OUT, MANY_OUT = 0.01, 3.5, 3
# Samples over which the level of the noise is taken; a burst must not fill half of them.
LEVEL_SAMPLES = 256
# Samples over which a slope is taken out of it: their median takes some of the scatter with it, and an arc turns over
# them. Of white noise 8, 32 and 128 leave 0.84, 0.97 and 0.99; up a step of 0.9 r, a hundredth of r between samples and
# a noise of a tenth of that, the largest level is 0.98, 1.22 and 1.65 times the true one.
SLOPE_SAMPLES = 32
# Share of a run's height at which it begins and ends.
FOOT = 0.25
# Share of the usual step between readings below which a reading counts as the one before, and how many such in a row
# are a reading that is stuck: by chance (0.008)^8.
UNCHANGED, STUCK = 0.01, 8


@dataclass(frozen=True, eq=False)
class Outliers:
    """Samples of one sweep that were not felt.

    Args:
        keep: (N,) False for these.
        impossible: number of runs that bend sharper than the ball.
        stuck: number of runs in which the reading did not change.
    """

    keep: BoolArray
    impossible: int
    stuck: int


def outliers(sweep: LaidSweep, profiles: Sequence[SweepHeights], tip_radius: float, resolution: float) -> Outliers:
    """Runs of a sweep that cannot have been felt.

    Args:
        sweep: its samples on their base.
        profiles: of this sweep.
        tip_radius: m.
        resolution: step of rounded positions, m; 0 if they are not rounded.
    """
    keep = np.ones(len(sweep.trace), dtype=bool)
    impossible = stuck = 0
    for profile in profiles:
        begin, end = int(profile.first[0]), int(profile.first[-1])
        if end - begin < LEVEL_SAMPLES:
            continue
        height = _sample_heights(sweep, profile, begin, end)
        level = _level(np.diff(height), resolution)
        if level is None:
            continue
        step = profile.length / (end - begin)
        off, runs = _impossible(height, level, step, tip_radius)
        same, more = _stuck(height, level, resolution)
        keep[begin:end] = ~(off | same)
        impossible, stuck = impossible + runs, stuck + more
    return Outliers(keep, impossible, stuck)


def _sample_heights(sweep: LaidSweep, profile: SweepHeights, begin: int, end: int) -> FloatArray:
    """(N,) heights of the samples over the base, m: where only bins were laid, along the normals under these."""
    if profile.feet is None:
        return sweep.feet(slice(begin, end)).height
    normal = profile.centers - profile.feet
    normal /= np.maximum(lengths(normal), np.finfo(float).tiny)[:, None]
    bins = np.repeat(np.arange(len(profile.height)), np.diff(profile.first))
    away = np.einsum("ij,ij->i", sweep.trace.centers[begin:end] - profile.centers[bins], normal[bins])
    return np.asarray(profile.height[bins] + away)


def _level(differences: FloatArray, resolution: float) -> FloatArray | None:
    """(N,) sd of the differences of neighbouring samples around each; None where they do not scatter at all.

    Differences (N - 1,) are taken about the slope near them, which on a flank is no scatter.
    """
    cells = max(1, len(differences) // LEVEL_SAMPLES)
    size = len(differences) // cells // SLOPE_SAMPLES * SLOPE_SAMPLES
    pieces = differences[: cells * size].reshape(-1, SLOPE_SAMPLES)
    about = np.abs(pieces - np.median(pieces, axis=1, keepdims=True))
    levels = MAD_TO_SD * np.median(about.reshape(cells, -1), axis=1)
    usual = float(np.median(levels))
    if usual <= resolution:
        return None
    levels = np.maximum(levels, 0.2 * usual)
    middles = (np.arange(cells) + 0.5) * size
    return np.asarray(np.interp(np.arange(len(differences) + 1), middles, levels))


def _impossible(height: FloatArray, level: FloatArray, step: float, tip_radius: float) -> tuple[BoolArray, int]:
    """(N,) True in runs that bend sharper than the ball, and their number."""
    off = np.zeros(len(height), dtype=bool)
    sums = np.concatenate([[0.0], np.cumsum(height)])
    runs = 0
    for size in BLOCKS:
        if size * step > LONGEST_RUN * tip_radius or len(height) < 8 * size:
            break
        means = (sums[size:] - sums[:-size]) / size
        # of the block that begins at sample i + size, against those right before and behind
        bend = (2 * means[size:-size] - means[: -2 * size] - means[2 * size :]) / level[size : 1 - 2 * size]
        # a few thousand tell the scatter as well as all of them
        every = max(1, size // 2, len(bend) // 2000)
        sd = robust_sd(bend[::every])
        if sd * level.max() <= np.finfo(float).eps * tip_radius:
            continue  # most of the path does not bend but by rounding: there is no scatter to stand out of
        excess = bend / sd
        least = LEAST_OUT if size == 1 else OUT
        asked = np.flatnonzero(excess > least)
        if not len(asked):
            continue
        allowed = _allowed_bend(means, asked + size, size, step, level[asked + size], tip_radius)
        excess[asked] -= allowed / (sd * level[asked + size])
        out = _out(excess) if size == 1 else OUT
        for at in np.flatnonzero((excess > out) & (excess >= np.roll(excess, 1)) & (excess > np.roll(excess, -1))):
            low, high = _run(height, int(at) + size, size)
            if high - low <= LONGEST_RUN * tip_radius / step and not off[low:high].all():
                runs += not off[low:high].any()
                off[low:high] = True
    return off, runs


def _allowed_bend(
    means: FloatArray, at: IntArray, size: int, step: float, level: FloatArray, tip_radius: float
) -> FloatArray:
    """(C,) bend that the opening by the ball's circle leaves at some blocks, in the unit of heights, m.

    Under a block fits the highest of all circles, leaning to either side, that stay below the blocks before and behind,
    near and far: on level ground one about upright; up a wall and over a brim one that leans, where what is beside goes
    on as the circle does. A rise that noise may have made is none: it would lean the circle where the path is level.

    Args:
        means: (n,) of blocks that begin at every sample, m.
        at: (C,) of these, one block or more from either end.
        size, step: samples of a block, and their distance, m.
        level: (C,) sd of the differences of neighbouring samples there.
        tip_radius: m.
    """
    near, radius = size * step, LEANT * tip_radius
    if radius <= near:
        return np.full(len(at), np.inf)
    unsure = FEATURE_RESIDUAL_SDS * level / np.sqrt(size)
    low, high = means[at - size], means[at + size]
    middle = 0.5 * (low + high)
    rise = np.sign(high - low) * np.maximum(np.abs(high - low) - unsure, 0.0)
    ends = np.column_stack([middle - 0.5 * rise, middle + 0.5 * rise])
    farther = np.arange(1, 1 + int(np.log(2.0 * radius / near) / np.log(ARMS)))
    blocks = np.outer([-1, 1], np.rint(ARMS**farther)).astype(np.int64).ravel()
    beside = at[:, None] + size * blocks
    inside = (beside >= 0) & (beside < len(means))
    far = np.where(inside, means[np.clip(beside, 0, len(means) - 1)] + unsure[:, None] / np.sqrt(2.0), np.inf)
    heights, away = np.column_stack([ends, far]), near * np.concatenate([[-1, 1], blocks])
    # from one that does not lean to one that is upright just behind the block before, or just before the block behind
    aside = radius - np.geomspace(radius, 0.99 * near, LEANT_PLACES)
    half = np.hypot(near, 0.5 * rise)  # of the chord of the circle through both
    through = np.sqrt(np.clip(radius**2 - half**2, 0.0, None)) * 0.5 * rise / half
    best = middle + radius - np.sqrt(radius**2 - near**2)
    for top in [*aside, *-aside[1:], np.clip(through, -aside[-1], aside[-1])[:, None]]:
        under = radius**2 - (away - top) ** 2
        arcs = np.where(under >= 0.0, np.sqrt(np.maximum(under, 0.0)) - np.sqrt(radius**2 - top**2), -np.inf)
        best = np.maximum(best, (heights - arcs).min(axis=1))
    return np.asarray(2.0 * (best - middle))


def _out(excess: FloatArray) -> float:
    """Standard deviations beyond which hardly any of the values (N,) is of a Gaussian law, OUT at most."""
    from scipy.special import ndtr

    high = np.sort(excess[excess > LEAST_OUT])
    beyond = np.arange(len(high), 0, -1)  # so many are at least as high
    unlikely = (len(excess) * ndtr(-high) < FALSELY_OUT * beyond) & (beyond >= MANY_OUT)
    return min(OUT, float(np.nextafter(high[unlikely.argmax()], 0.0))) if unlikely.any() else OUT


def _run(height: FloatArray, begin: int, size: int) -> tuple[int, int]:
    """First and past-last sample of the run around a bend at the block of so many samples that begins there."""
    low, high = max(0, begin - 6 * size), min(len(height), begin + 7 * size)
    rest = height[low:high] - np.median(height[low:high])
    near = slice(max(0, begin - low - size), begin - low + 2 * size)
    sums = np.concatenate([[0.0], np.cumsum(rest)])
    half = max(1, size // 2)
    count = len(rest) - half + 1
    smooth = (sums[half:] - sums[:-half]) / half  # of the half block that begins at each sample
    top = near.start + int(np.abs(smooth[near]).argmax())
    inside = np.sign(smooth[top]) * smooth > FOOT * abs(smooth[top])
    first = top - int(np.argmin(inside[top::-1])) + 1 if not inside[: top + 1].all() else 0
    last = top + int(np.argmin(inside[top:])) if not inside[top:].all() else count
    return low + first, min(low + last - 1 + half, len(height))


def _stuck(height: FloatArray, level: FloatArray, resolution: float) -> tuple[BoolArray, int]:
    """(N,) True where the reading did not change, and the number of such runs; rounded readings may repeat."""
    stuck = np.zeros(len(height), dtype=bool)
    steps = np.abs(np.diff(height))
    # a smooth path has flat places: readings are stuck where others scatter from one to the next
    if resolution > 0 or robust_sd(np.diff(height, 2)) < UNCHANGED * MAD_TO_SD * float(np.median(steps)):
        return stuck, 0
    same = np.concatenate([[False], steps < UNCHANGED * level[1:], [False]])
    edges = np.flatnonzero(np.diff(same.astype(np.int8)))
    runs = [(first + 1, last + 1) for first, last in edges.reshape(-1, 2) if last - first >= STUCK]
    for first, last in runs:
        stuck[first:last] = True
    return stuck, len(runs)
