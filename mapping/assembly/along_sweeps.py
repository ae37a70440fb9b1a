"""Along the sweeps: ridges and grooves that run beside the sweeps of a raster from end to end, crossed by none of them.

All that tells of such a line is that the sweeps over it run higher or lower as a whole. So do sweeps that an instrument
puts off by itself: by how much, the differences of all other neighbours say, and a line is told only where it stands
out of them as far as a detail stands out of the noise along a sweep. It comes back to the level that it left, which
what moved once does not; and no ball climbs a wall between two sweeps that are nearer to each other than it rolls.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mapping import Details, Feature, FloatArray, Interval, Support, Trace, length_text
from mapping.base import LaidSweep, LaidTrace
from mapping.detection import Detections
from mapping.estimate.sweeps import parallel_rows
from mapping.inference.kinds import kind_made_of
from mapping.instrument import Noise, robust_sd

# How the note begins that is on every such line
RUNS_ALONG = "runs along the sweeps from end to end"
# What follows was varied over 60 plates (20 slots, 20 wires, 20 bare; 15 to 44 sweeps, offsets to 8 um under noise of
# 10 um, a ball of 3 mm; seeds 500 to 559): 17 slots and 18 wires are told, no bare plate has a line.
#
# A scatter is told by fewer neighbours only so badly that nothing stands out of it: at 0.01 a metre and a pitch of 1 mm
# Student's t asks for 63 scatters of 9 sweeps, for 480 of 6, and for 7.6 of 31
ROWS_THAT_TELL = 9
# Parts of each sweep whose means are kept apart: a line whose height varies along it is seen to vary. Of 4 parts 19
# wires are told, of 16 parts 17, slots alike
PARTS_OF_ROW = 8
# A median absolute deviation tells a scatter as well as the standard deviation of this share of the values (Rousseeuw
# and Croux, J. Am. Stat. Assoc. 88, 1993)
MAD_EFFICIENCY = 0.37
# Cosine of the angle between chords of sweeps that run side by side, and how much their lengths may differ: 0.95 and
# 0.999, and 1.1 and 1.5 are alike
CHORDS_ALIKE, LENGTHS_ALIKE = 0.99, 1.2
# Of the standard deviation of a mean that of a median is, of Gaussian values: sqrt(pi / 2)
MEDIAN_SD = 1.2533
# Sweeps at one level, at least, of what may have a flat top: of one nothing tells a flat top from a crest
FEWEST_ON_TOP = 2
# Sweeps more than half-way off, at least: a single one may have been put off by the instrument. Of plates of 31 and of
# 100 sweeps whose offsets are Student's t of 3 degrees, 0.022 and 0.21 had a line with 1
FEWEST_OFF = 2
# Share of a jump by which the way back may differ from it, beside the scatter: 0.05 and 0.2 are alike
COMES_BACK = 0.1


@dataclass(frozen=True, eq=False)
class Rows:
    """The sweeps of a raster in order, as means of a few parts of each.

    Args:
        points, normals: (K, P, 3) under the middle of each part, m, and outward.
        height: (K, P) medians over the base, m.
        samples: behind each, on average.
    """

    points: FloatArray
    normals: FloatArray
    height: FloatArray
    samples: float

    @property
    def level(self) -> FloatArray:
        """(K,) of the whole sweeps, m."""
        return np.asarray(np.median(self.height, axis=1))

    @property
    def across(self) -> FloatArray:
        """(K,) places across the sweeps, m."""
        middle = self.points.mean(axis=1)
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))])

    def crosswise(self, tip_radius: float, offset: float) -> Trace:
        """What a ball felt that went across the sweeps along each of the parts, one after the other."""
        centers = self.points + (tip_radius + offset + self.height)[..., None] * self.normals
        count, parts = self.height.shape
        flat = np.ascontiguousarray(centers.transpose(1, 0, 2)).reshape(-1, 3)
        sweep = np.repeat(np.arange(parts), count)
        return Trace(np.arange(len(flat), dtype=np.float64), flat, sweep, tip_radius)


@dataclass(frozen=True, eq=False)
class AlongSweeps:
    """Lines beside the sweeps, what they are fitted to, and the noise there.

    Args:
        features: with preliminary sizes.
        trace: across the sweeps.
        noise: of its samples: what is one for all parts of a sweep counts as often as there are parts.
    """

    features: tuple[Feature, ...]
    trace: LaidTrace
    noise: Noise


def along_sweeps(trace: LaidTrace, detections: Detections, false_alarms_per_metre: float) -> AlongSweeps | None:
    """The ridges and grooves that run along the sweeps of a raster; None where there is no raster, or no such line.

    Args:
        trace: laid on its base, and searched: the heights are those that are known by now.
        detections: of the trace.
        false_alarms_per_metre: accepted rate of lines that are none, 1/m of the way across the sweeps.
    """
    rows = _rows(trace)
    if rows is None:
        return None
    level, across, tip = rows.level, rows.across, trace.tip_radius
    climbs = np.diff(level)
    usual = float(np.median(climbs))
    scatter = max(robust_sd(climbs - usual), detections.noise.sd / np.sqrt(rows.samples * rows.height.shape[1]))
    pitch = float(np.median(np.diff(across)))
    needed = scatter * _quantile(false_alarms_per_metre * pitch, MAD_EFFICIENCY * len(climbs))
    jumps = _jumps(climbs, usual, needed)
    features = []
    for up, down in itertools.pairwise(jumps):
        if _is_line(up, down, across, level, tip, needed) and _is_whole(up, down, rows):
            features.append(_feature(up, down, rows, scatter, trace, detections))
    if not features:
        return None
    laid = LaidTrace(rows.crosswise(tip, trace.base.offset), trace.base)
    own = MEDIAN_SD**2 * detections.noise.sd**2 / rows.samples
    white = float(np.sqrt(own + rows.height.shape[1] * 0.5 * scatter**2))
    return AlongSweeps(tuple(features), laid, Noise(white))


def _quantile(rate: float, freedom: float) -> float:
    """Of Student's t, which a difference of two sweeps passes as often as the rate says."""
    from scipy.special import stdtrit

    return float(-stdtrit(freedom, 0.5 * min(rate, 1.0)))


def _rows(trace: LaidTrace) -> Rows | None:
    """The sweeps as rows side by side; None of anything else, as of a grid of crossing sweeps or of circuits."""
    usable = [sweep for sweep in trace.laid_sweeps if sum(len(each.height) for each in sweep.known_heights()) > 1]
    if len(usable) < ROWS_THAT_TELL:
        return None
    ends = np.array([sweep.trace.centers[[0, -1]] for sweep in usable])
    chords = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(chords, axis=1)
    usual = float(np.median(lengths))
    way = chords[0] / max(lengths[0], np.finfo(float).tiny)
    if (
        lengths.min() * LENGTHS_ALIKE < usual
        or lengths.max() > LENGTHS_ALIKE * usual
        or (np.abs(chords @ way) < CHORDS_ALIKE * lengths).any()
    ):
        return None
    parts = [_parts(sweep, way, trace) for sweep in usable]
    points = np.array([each[0] for each in parts])
    order = parallel_rows(points.reshape(-1, 3), np.repeat(np.arange(len(parts)), PARTS_OF_ROW))
    if order is None:
        return None
    numbers = [int(index[0]) // PARTS_OF_ROW for index in order]
    points, normals, height = (np.array([parts[k][m] for k in numbers]) for m in range(3))
    samples = float(np.mean([len(sweep.trace) for sweep in usable])) / PARTS_OF_ROW
    return Rows(points, normals, height, samples)


def _parts(sweep: LaidSweep, way: FloatArray, trace: LaidTrace) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(P, 3) points, (P, 3) normals and (P,) heights of the parts of one sweep, in order along a direction."""
    pieces = sweep.known_heights()
    height = np.concatenate([piece.height for piece in pieces])
    centers = np.concatenate([piece.centers for piece in pieces])
    if (centers[-1] - centers[0]) @ way < 0.0:
        height, centers = height[::-1], centers[::-1]
    each = np.array_split(np.arange(len(height)), PARTS_OF_ROW)
    middle = np.array([centers[own].mean(axis=0) if len(own) else centers[-1] for own in each])
    feet = trace.base.foot(middle, trace.tip_radius)
    return feet.points, feet.normals, np.array([np.median(height[own]) if len(own) else height[-1] for own in each])


@dataclass(frozen=True)
class _Jump:
    """From one sweep to another one behind it, by so much, m."""

    begin: int
    end: int
    height: float


def _jumps(climbs: FloatArray, usual: float, needed: float) -> list[_Jump]:
    """Neighbours that differ by more than is needed: in a row and one way they are one jump."""
    found: list[_Jump] = []
    for k in np.flatnonzero(np.abs(climbs - usual) > needed):
        by = float(climbs[k] - usual)
        if found and found[-1].end == k and found[-1].height * by > 0.0:
            found[-1] = _Jump(found[-1].begin, int(k) + 1, found[-1].height + by)
        else:
            found.append(_Jump(int(k), int(k) + 1, by))
    return found


def _is_line(first: _Jump, second: _Jump, across: FloatArray, level: FloatArray, tip: float, needed: float) -> bool:
    """True of a jump and the way back, if several sweeps were off and a ball can have climbed both."""
    off = np.abs(level[first.begin : second.end + 1] - 0.5 * (level[first.begin] + level[second.end]))
    if int((off > 0.5 * abs(first.height)).sum()) < FEWEST_OFF:
        return False
    away = abs(first.height + second.height)
    if first.height * second.height > 0.0 or away > 2.0 * needed + COMES_BACK * abs(first.height):
        return False
    for jump in (first, second):
        # a sweep that is not yet off its level may be within what is needed of it, and one on the top likewise
        climbed = max(abs(jump.height) - 2.0 * needed, 0.0)
        rolled = float(np.sqrt(climbed * max(2.0 * tip - climbed, 0.0)))
        if across[jump.end] - across[jump.begin] < rolled:
            return False
    return True


def _is_whole(first: _Jump, second: _Jump, rows: Rows) -> bool:
    """True if all parts of the sweeps stand off: what ends within the sweeps they cross themselves."""
    inside, beside = rows.height[first.end : second.begin + 1], rows.height[[first.begin, second.end]].mean(axis=0)
    off = (np.median(inside, axis=0) - beside) / (0.5 * (first.height - second.height))
    return bool(off.min() > 0.5)


def _feature(
    first: _Jump, second: _Jump, rows: Rows, scatter: float, trace: LaidTrace, detections: Detections
) -> Feature:
    """The line between two jumps, from end to end of the sweeps."""
    across, level = rows.across, rows.level
    inside = np.arange(first.end, second.begin + 1)
    height = 0.5 * (first.height - second.height)
    weight = np.abs(level[first.begin : second.end + 1] - 0.5 * (level[first.begin] + level[second.end]))
    place = float(weight @ across[first.begin : second.end + 1] / weight.sum())
    points = _at(rows.points, across, place)
    feet = trace.base.foot(points + trace.tip_radius * rows.normals[inside[0]], trace.tip_radius)
    pitch = float(np.median(np.diff(across)))
    felt = float(across[second.end] - across[first.begin])
    flat = len(inside) >= FEWEST_ON_TOP and height > 0.0
    top = float(across[inside[-1]] - across[inside[0]])
    width = (top if flat else height) if height > 0.0 else felt - pitch
    legs = float(np.linalg.norm(np.diff(feet.points, axis=0), axis=1).sum())
    told = (
        f"{RUNS_ALONG}, so that only differences between them show it: those of other neighbours scatter by "
        f"{length_text(scatter, 2)}, and sweeps across would tell whether it is the body's or the instrument's own"
    )
    return Feature(
        kind=kind_made_of("convex" if height > 0.0 else "concave", line=True).name,
        axis=feet.points,
        normals=feet.normals,
        height=Interval.normal(height, scatter),
        width=Interval(width, 0.5 * width, max(felt, width)),
        length=Interval(legs, legs, np.inf, censored=True),
        evidence=Support(abs(height) / scatter, PARTS_OF_ROW, (detections.algorithm,)),
        curvature_feature=True,
        position_sd=0.3 * pitch,
        notes=(told,),
        details=Details(top=top, run=0.0) if flat else Details(),
    )


def _at(points: FloatArray, across: FloatArray, place: float) -> FloatArray:
    """(P, 3) between the rows (K, P, 3) at a place across them."""
    k = int(np.clip(np.searchsorted(across, place) - 1, 0, len(across) - 2))
    share = (place - across[k]) / (across[k + 1] - across[k])
    return np.asarray(points[k] + share * (points[k + 1] - points[k]))
