"""Bent lines: how sharply a ball turns over all crossings of a ridge together, against how sharply it can.

A ball that passes over a line leans to neither side: where it turns about the crest its centre goes on a circle of its
own radius or a larger one, at every crossing. What noise hides in each of them, all together tell: the share s of the
own circle's bend, by least squares over the same stretch of each, is at most 1 for any body.

Reference: theory section 4.9.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mapping import BoolArray, Feature, FloatArray, IntArray, lengths
from mapping.base import LaidSweep, LaidTrace
from mapping.estimate.envelope.refuted_tip import (
    BEND_SDS,
    FEWEST_BENDS,
    RADIUS_SDS,
    RADIUS_STEP,
    REFUTED_BY_CHANCE,
    RefutedTip,
)
from mapping.geometry.mesh import arclengths, distances, nearest_on
from mapping.instrument import Noise

# Stretches that are looked at reach to both sides of the crest as far as a ball of these shares of the told radius
# would touch it: over more than the true ball does the path is no circle any more, and bends less. The first asks for a
# fifth, beyond RADIUS_SDS of a usual doubt; a stretch grows with the root of the radius, so that halves leave at least
# 0.7 of the longest that is sound; the last is of a radius told 160 times too large
SMALLER_BALLS = 0.8 * 0.5 ** np.arange(8.0)
# Bins of a stretch (24 means tell the bend of a parabola as well as all samples do, to 1 %), and its fewest samples:
# five more than the fit has numbers
BENT_BINS, FEWEST_STRETCHED = 24, 8
# Sine of the least angle between a sweep and the line that it crosses; along a line nothing bends
ACROSS = 0.5
# Samples of a sweep that are told together to be far from a line: of 32, 128 and 512 on the paper's wire all take the
# same time, to 10 %
SAMPLES_TOGETHER = 128


def refuted_by_lines(laid: LaidTrace, lines: Sequence[Feature], noise: Noise, tip_sd: float = 0.0) -> RefutedTip | None:
    """Hold the radius of the tip against how sharply its trace bends over the crests of lines.

    Args:
        laid: the trace, outliers included: to a ball that is too large, fine features are such.
        lines: ridges; their axes say where sweeps cross them, so that no bend is looked for where it is sharpest.
        noise: of the samples' heights.
        tip_sd: standard deviation of the radius, m.

    Returns:
        What refutes it; None if nothing does.
    """
    smallest = laid.tip_radius - RADIUS_SDS * tip_sd
    crossed = [each for line in lines for each in _crossings(laid, line)]
    if smallest <= 0.0 or len(crossed) < FEWEST_BENDS:
        return None
    chance, places = _chance(crossed, noise, smallest)
    if chance >= REFUTED_BY_CHANCE:
        return None
    largest = smallest
    while _chance(crossed, noise, largest)[0] < REFUTED_BY_CHANCE:
        largest /= RADIUS_STEP
    return RefutedTip(laid.tip_radius, largest, places, chance)


class _Crossed:
    """Where a sweep crosses a line.

    Args:
        sweep: its samples.
        at: of the sample nearest to the crest.
        along, up: (3,) unit direction of the sweep there, and of the base's normal.
        middle: (3,) place of the ball's centre over the line, m.
        height: of the line, m.
    """

    def __init__(
        self, sweep: LaidSweep, at: int, along: FloatArray, up: FloatArray, middle: FloatArray, height: float
    ) -> None:
        away = sweep.trace.centers - middle
        x = away @ along
        first, last = _run(np.abs(x) < sweep.trace.tip_radius, at)
        self.x, self.z, self.at = x[first:last], (away @ up)[first:last], at - first
        self.height = height

    def bend(self, half: float, radius: float, noise: Noise) -> tuple[float, float] | None:
        """Share of a ball's bend that the path has over a stretch, and its information; None with too few samples."""
        # a sweep that turns may come by again; noise of the places parts none
        first, last = _run(np.abs(self.x) <= half + BEND_SDS * noise.sd, self.at)
        inside = np.abs(self.x[first:last]) <= half
        x, z, count = self.x[first:last][inside], self.z[first:last][inside], int(inside.sum())
        if count < FEWEST_STRETCHED:
            return None
        bins = min(BENT_BINS, count // 2)
        row = np.minimum(((x / half + 1.0) * 0.5 * bins).astype(np.int64), bins - 1)
        held = np.bincount(row, minlength=bins)
        if held.min() == 0:
            return None  # samples are missing here
        arc, x, z = (np.bincount(row, of, bins) / held for of in (np.sqrt(radius**2 - x**2) - radius, x, z))
        lags = np.abs(np.subtract.outer(np.arange(bins), np.arange(bins)))
        covariance = noise.block_covariances(bins, 2.0 * half / bins, count / bins)[lags]
        columns = np.column_stack([arc, np.ones(bins), x])
        weighted = np.linalg.solve(covariance, columns)
        inverse = np.linalg.inv(columns.T @ weighted)
        return float((inverse @ (weighted.T @ z))[0]), float(1.0 / inverse[0, 0])


def _run(within: BoolArray, at: int) -> tuple[int, int]:
    """First, and one past the last, of the samples in a row around one that are all within."""
    first = at - int(np.argmin(within[at::-1])) + 1 if not within[: at + 1].all() else 0
    last = at + int(np.argmin(within[at:])) if not within[at:].all() else len(within)
    return first, last


def _chance(crossed: list[_Crossed], noise: Noise, radius: float) -> tuple[float, int]:
    """Chance, at most, of bends so sharp over all crossings under a ball of this radius, and of how many."""
    from scipy.special import ndtr

    best, places, asked = 1.0, 0, 0
    for share in SMALLER_BALLS:
        told = [
            found
            for each in crossed
            if (found := each.bend(min(np.sqrt(2.0 * share * radius * each.height), share * radius), radius, noise))
        ]
        if len(told) < FEWEST_BENDS:
            continue
        bend, information = np.array(told).T
        # each has a mean of 1 at most, so the sum of what exceeds it has one of 0 at most
        beyond = float(information @ (bend - 1.0) / np.sqrt(information.sum()))
        asked += 1
        if (chance := float(ndtr(-beyond))) < best:
            best, places = chance, len(told)
    return min(1.0, max(asked, 1) * best), places


def _crossings(laid: LaidTrace, line: Feature) -> Iterator[_Crossed]:
    """Where sweeps cross a line, further from its ends than the ball touches it."""
    axis, height = line.axis, min(line.height.median, laid.tip_radius)
    if len(axis) < 2 or height <= 0.0:
        return
    reach = float(np.sqrt(2.0 * laid.tip_radius * height))
    length = float(arclengths(axis)[-1])
    ends = 0.0 if np.array_equal(axis[0], axis[-1]) else reach
    for sweep in laid.laid_sweeps:
        centers = sweep.trace.centers
        if len(centers) < FEWEST_STRETCHED:
            continue
        near = _near(centers, axis, reach + height + laid.tip_radius)
        if len(near) < FEWEST_STRETCHED:
            continue
        on, place = nearest_on(centers[near], axis)
        leg = np.minimum(np.searchsorted(arclengths(axis), place, side="right") - 1, len(axis) - 2)
        forth = axis[leg + 1] - axis[leg]
        forth /= np.maximum(lengths(forth)[:, None], np.finfo(float).tiny)
        up = line.normals[leg]
        aside = np.einsum("ij,ij->i", centers[near] - on, np.cross(up, forth))
        told = (np.abs(aside) < reach) & (place > ends) & (place < length - ends)
        turned = (np.diff(near) == 1) & told[1:] & told[:-1] & (np.sign(aside[1:]) != np.sign(aside[:-1]))
        flips = np.flatnonzero(turned)
        # noise of the places makes several of one
        for run in np.split(flips, np.flatnonzero(np.diff(flips) > FEWEST_STRETCHED) + 1) if len(flips) else []:
            k = int(run[len(run) // 2])
            passed = _run((np.abs(aside) < reach) & (near - np.arange(len(near)) == near[k] - k), k)
            about = max(3, (passed[1] - passed[0]) // 4)
            first, last = max(k - about, passed[0]), min(k + about, passed[1] - 1)
            along = centers[near[last]] - centers[near[first]]
            along -= (along @ up[k]) * up[k]
            along /= max(float(np.linalg.norm(along)), float(np.finfo(float).tiny))
            across = float(np.linalg.norm(np.cross(along, forth[k])))
            if across >= ACROSS:
                # of an oblique crossing the circle is longer by the sine, and the bend less by its square
                middle = centers[near[k]] - (aside[k] / across) * np.sign(along @ np.cross(up[k], forth[k])) * along
                yield _Crossed(sweep, int(near[k]), along, up[k], middle, height)


def _near(centers: FloatArray, axis: FloatArray, within: float) -> IntArray:
    """Samples, by the stretches that they are in, that may be within a distance (m) of a line: most sweeps pass by."""
    first = np.arange(0, len(centers), SAMPLES_TOGETHER)
    low, high = np.minimum.reduceat(centers, first), np.maximum.reduceat(centers, first)
    radius = 0.5 * np.linalg.norm(high - low, axis=1)
    may = distances(0.5 * (low + high), axis) < within + radius
    return np.flatnonzero(np.repeat(may, SAMPLES_TOGETHER)[: len(centers)])
