"""Terraces: a height field that stands on several levels, as a plate with a step or a wide groove does.

Half of what is felt of such a body lies off any smooth surface. Taken for outliers it costs so much that a freer
family, which bends over the edges, would explain the trace better, and hide the step or leave ghosts beside it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import FloatArray, IntArray
from mapping.base.profiles import EDGE_FREEDOM
from mapping.base.quadrics import (
    Cloud,
    Design,
    Fitted,
    height_field,
    independent_share,
    plane_design,
    quadric_design,
)
from mapping.instrument import FEATURE_RESIDUAL_SDS, robust_fit, robust_scale

# Cells whose heights are compared lie the first of these shares of the cloud's extent apart that tells the slope: by it
# several levels are found, or one that holds most cells. Of a staircase of n edges, n eighths of the pairs an eighth
# apart stand on two levels: the sum of absolute residuals finds the slope as long as these are less than half, that is
# up to three edges one way. Nearer pairs tell less of it, but beside as many edges as there may be levels. Edges that
# come again as often as the cells lie apart make another slope of it: no level holds most cells then, about any they
# lie farther off than those of pairs scatter
PAIRS_APART = (1 / 8, 1 / 16, 1 / 32, 1 / 64)
# Of all cells so many must have a partner. Where lines are so far apart that it must be half the extent away, or all of
# it between two, half of the cells can have one at most; a fifth of these may lie off the path
FEWEST_PAIRS = 0.4
# Of a run's samples, the share that is its end: the detail itself lies in the middle, and a median minds nothing that
# reaches into less than half of an end
END_SHARE = 8
# More levels than that have no two cells of the nearest pairs on one of them
MOST_LEVELS = round(1 / PAIRS_APART[-1])
# Mean square, in standard deviations, up to which what lies about a height (FEATURE_RESIDUAL_SDS to either side) is as
# likely to scatter about it as to lie anywhere there: 2 log(2 FEATURE_RESIDUAL_SDS / sqrt(2 pi)). Of a level it is 1,
# of a crest or a flank that passes through the height 3 and more
PASSING_SQUARE = 2.0 * float(np.log(2.0 * FEATURE_RESIDUAL_SDS / np.sqrt(2.0 * np.pi)))
# Relative change of a standard deviation that a window of three to either side does not show: it cuts 1.3 % off it
SCATTER_TOLD = 0.02
# Rounds until no cell changes its level: of 108 fits to noisy rasters over steps, stairs and slopes 103 took no more
# than five; after six the last levels stand
LEVEL_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class _Levels:
    """Heights (L,) over the field, m, the first of them 0, the level (C,) of each cell, -1: on none, and its sweep."""

    heights: FloatArray
    level: IntArray
    sweep: IntArray

    @property
    def edges(self) -> int:
        """Places on sweeps where one level gives way to another."""
        standing, sweep = self.level[self.level >= 0], self.sweep[self.level >= 0]
        return int(((np.diff(standing) != 0) & (np.diff(sweep) == 0)).sum())

    @property
    def freedom(self) -> int:
        """Of the levels beyond the first and of their edges."""
        return len(self.heights) - 1 + EDGE_FREEDOM * self.edges


def terraced_plane(cloud: Cloud) -> Fitted | None:
    """A plane and its parallels: see `terraced`."""
    return terraced(plane_design, "plane", cloud)


def terraced_quadric(cloud: Cloud) -> Fitted | None:
    """A quadric and its parallels: see `terraced`."""
    return terraced(quadric_design, "quadric", cloud)


def terraced(design: Design, kind: str, cloud: Cloud) -> Fitted | None:
    """A height field z = design(x, y) @ coefficients + one of a few levels, or None where one level is enough.

    The field's slopes come from differences of heights of cells that lie apart (`PAIRS_APART`), of which most stand on
    one level. A level counts if the cells on it gain more than its height and the places of its edges cost. The field
    of the level with the most cells is the base; the others are what detection finds as steps.
    Cells on a level may differ by what the cells of such pairs do, or by more where a level holds more (drift goes on
    beyond the pairs' distance), and as many count as are independent then: roughness and drift are no levels, however
    smooth from cell to cell.
    """
    for apart in PAIRS_APART:
        pairs = _pairs(cloud, apart)
        if pairs is None:
            return None
        fit, held = _by_pairs(design, kind, cloud, *pairs)
        if fit is not None or held > 0.5:
            return fit
    return None


def _by_pairs(design: Design, kind: str, cloud: Cloud, one: IntArray, other: IntArray) -> tuple[Fitted | None, float]:
    """The field whose slopes are those between cells (P,) and others (P,), None where one level is enough, and the
    share of all cells that its fullest level holds to begin with, no farther off it than the cells of pairs scatter."""
    x, y, z = cloud.points.T
    columns = design(x, y)
    # what differences cannot tell, the constant, comes out as zero: the levels hold it
    slopes = robust_fit(columns[one] - columns[other], z[one] - z[other], np.sqrt(2.0) * cloud.scale).coefficients
    rest = z - columns @ slopes
    paired = max(cloud.scale, robust_scale(rest[one] - rest[other]) / np.sqrt(2.0))
    levels = _levels(rest, cloud, paired)
    reach = FEATURE_RESIDUAL_SDS * paired
    held = float(np.mean(np.abs(rest - _densest(np.sort(rest), reach)) < reach))
    for _ in range(LEVEL_ROUNDS):
        if len(levels.heights) < 2:
            return None, held
        on = np.maximum(levels.level, 0)
        fit = robust_fit(columns, z - levels.heights[on], cloud.scale)
        before, rest = levels, z - columns @ fit.coefficients
        levels = _levels(rest, cloud, paired)
        if np.array_equal(before.level, levels.level):
            break
    if len(levels.heights) < 2:
        return None, held
    on = np.maximum(levels.level, 0)
    lowered = replace(cloud, points=np.column_stack([x, y, z - levels.heights[on]]))
    flat = height_field(design, kind, lowered)
    # along the field's normal in the middle, not along the axis of a cloud that the step itself tilts
    slope = np.asarray(flat.parameters["coefficients"], dtype=np.float64)[1:3]
    heights = levels.heights / np.sqrt(1.0 + slope @ slope)
    terraces = replace(
        flat,
        parameters=flat.parameters | {"levels": heights.tolist()},
        freedom=flat.freedom + levels.freedom,
        # rows that each stand on a level of their own may be those of any body
        explains=levels.edges >= len(levels.heights) - 1,
    )
    return terraces, held


def _pairs(cloud: Cloud, apart: float) -> tuple[IntArray, IntArray] | None:
    """Cells (P,) and those (P,) that lie a share of the extent from them along x and along y, or farther.

    None if there are too few of them along one of the two: then each line could stand on a level of its own.
    """
    from scipy.spatial import cKDTree

    flat = cloud.points[:, :2]
    tree, extent = cKDTree(flat), np.ptp(flat, axis=0)
    one, other = [], []
    for axis in range(2):
        for share in apart * 2.0 ** np.arange(round(-np.log2(apart)) + 1):
            away = np.zeros(2)
            away[axis] = share * extent[axis]
            distance, found = tree.query(flat + away)
            near = np.flatnonzero(distance < 0.5 * away[axis])
            if len(near) > FEWEST_PAIRS * len(flat):
                break
        else:
            return None
        one.append(near)
        other.append(np.asarray(found, dtype=np.int64)[near])
    return np.concatenate(one), np.concatenate(other)


def _levels(rest: FloatArray, cloud: Cloud, paired: float) -> _Levels:
    """Levels of what is left (C,) of the heights, the one with the most cells first, as long as each pays.

    Args:
        rest: heights without the field's slopes, m.
        cloud: the cells.
        paired: standard deviation of cells that lie apart, m.
    """
    sweep, scale = cloud.sweep, _scatter(rest, paired)
    share = independent_share(1.0 - (cloud.scale / scale) ** 2)
    reach = FEATURE_RESIDUAL_SDS * scale
    heights: list[float] = []
    level = np.full(len(rest), -1, dtype=np.int64)
    price = float(np.log(max(share * len(rest), 2.0)))  # Schwarz's, of as many as are independent
    while len(heights) < MOST_LEVELS and (level < 0).any():
        height = _densest(np.sort(rest[level < 0]), reach)
        here = (level < 0) & (np.abs(rest - height) < reach)
        new = np.where(here, len(heights), level)
        square = ((rest[here] - height) / scale) ** 2
        gain = share * float((FEATURE_RESIDUAL_SDS**2 - square).sum())
        before = _Levels(np.array(heights), level, sweep).freedom if heights else 0
        cost = price * (_Levels(np.array([*heights, height]), new, sweep).freedom - before)
        if heights and (gain <= cost or square.mean() > PASSING_SQUARE):
            break
        heights.append(height)
        level = new
    return _Levels(np.array(heights) - heights[0], level, sweep)


def _scatter(rest: FloatArray, paired: float) -> float:
    """Standard deviation of cells on one level, m: the least from `paired` on that its fullest level agrees with.

    What lies evenly about a height, as a slope's cells do, scatters by more than any that is tried, up to all there is:
    it makes one level.
    """
    ordered, scale, told = np.sort(rest), 0.0, paired
    while told > (1.0 + SCATTER_TOLD) * scale:
        scale = told
        height = _densest(ordered, FEATURE_RESIDUAL_SDS * scale)
        near = ordered[np.abs(ordered - height) < FEATURE_RESIDUAL_SDS * scale]
        told = max(scale, float(np.sqrt(((near - height) ** 2).mean())))
    return told


def _densest(ordered: FloatArray, reach: float) -> float:
    """The middle of the window of twice the reach that holds the most of ordered values."""
    stop: IntArray = np.searchsorted(ordered, ordered + 2 * reach, side="right").astype(np.int64)
    count = stop - np.arange(len(ordered))
    begin = int(count.argmax())
    return float(np.median(ordered[begin : begin + count[begin]]))


def over_levels(height: FloatArray, breaks: IntArray, levels: FloatArray) -> FloatArray:
    """Heights (N,) of each run of samples over the level of the base's that its ends stand on, m.

    Args:
        height: over the base, m.
        breaks: where runs begin but for the first, ascending.
        levels: (L,) of the base, m; of a run whose ends stand on two of them the lower one counts.
    """
    lowered = height.copy()
    for start, stop in zip([0, *breaks], [*breaks, len(height)], strict=True):
        end = max(1, (stop - start) // END_SHARE)
        ends = (np.median(height[start : start + end]), np.median(height[stop - end : stop]))
        lowered[start:stop] -= min(float(levels[np.abs(levels - place).argmin()]) for place in ends)
    return lowered
