"""Parts: wide places where body and model differ steeply: dents, studs, handles that are missing or too much."""

from __future__ import annotations

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.base import Feet
from mapping.estimate.deviation.blocks import Blocks
from mapping.estimate.deviation.on_details import WIDE_PART, beside
from mapping.estimate.deviation.result import Part
from mapping.instrument import MAD_TO_SD

# It stands off by more than so many standard deviations of the rest, and by so much of a tip radius
STANDS_OFF, LEAST_PART = 6.0, 0.02
# Places where nothing was felt are a tip radius from all that was: when they are so many apart, the hole is wide
MISSED_SPAN = 1.0
# A ball that sinks by so many tip radii sinks into an opening 1.3 tip radii wide, or beside the body
DEEP = 0.25
# Of the blocks about its middle so many stand off with it: the inside of a ring does not
FILLED_SHARE = 0.7
# A part whose level varies by less than this share of itself is level: it ends at steps, which are fine features
LEVEL = 0.25
# A part of whose upper half more than this share goes over smoothly into the rest is no part, but bends with it; and
# what is level counts if more than this share of it is deep
JOINED = MOSTLY = 0.5
# Blocks of one part are no further apart than this, and this far around them nothing is looked for, in tip radii
PART_REACH, AROUND_PART = 2.5, 1.0


def parts_of(blocks: Blocks, height: FloatArray, rest: BoolArray, tip: float, missed: Feet) -> tuple[Part, ...]:
    """Places that are wide along and across, stand off on one side, steeply, and do so unevenly or deep.

    Args:
        blocks: of the trace.
        height: (B,) what remains of their heights, m.
        rest: (B,) True for blocks that a smooth surface joins.
        tip: radius, m.
        missed: places of the model where the finger was sent and felt nothing: there the body lies deeper.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    quiet = height[rest] if rest.any() else height
    sd = max(MAD_TO_SD * float(np.median(np.abs(quiet - np.median(quiet)))), blocks.noise)
    off = np.abs(height) > departure(sd, tip)
    deep = height < -DEEP * tip
    counts = deep | _in_wide_runs(blocks, height, off, tip)
    index = np.flatnonzero(counts)
    points = np.concatenate([blocks.points[index], missed.points])
    if not len(points):
        return ()
    normals = np.concatenate([blocks.normals[index], missed.normals])
    heights = np.concatenate([height[index], np.full(len(missed.points), -DEEP * tip)])
    sure = np.concatenate([deep[index], np.ones(len(missed.points), dtype=bool)])
    joined = np.concatenate([rest[index], np.zeros(len(missed.points), dtype=bool)])
    pairs = cKDTree(points).query_pairs(PART_REACH * tip, output_type="ndarray")
    pairs = pairs[heights[pairs[:, 0]] * heights[pairs[:, 1]] > 0]
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    label = connected_components(graph, directed=False)[1]
    found = []
    for number in range(label.max() + 1):
        own = label == number
        level = np.std(heights[own]) <= LEVEL * abs(np.mean(heights[own]))
        size = np.abs(heights) * own
        if np.mean(joined[size > 0.5 * size.max()]) > JOINED or (level and np.mean(sure[own]) < MOSTLY):
            continue
        empty = missed.points[own[len(index) :]]
        # what the ball stands off beside what stands out is no width of it, along sweeps or across them
        top = max(float(heights[own].max()), 0.0)
        upper = own & (heights >= 0.5 * top) if top else own
        narrower = 2.0 * float(beside(np.array(0.5 * top), tip))
        if _spans(empty, MISSED_SPAN * tip) or _is_wide(points[upper], normals[upper], narrower, blocks, off, tip):
            here = height[index[own[: len(index)]]]
            largest = here[np.abs(here).argmax()] if len(here) else np.nan
            path = int((own[: len(index)]).sum()) * blocks.step
            found.append(Part(points[own], AROUND_PART * tip, float(largest), path))
    return tuple(found)


def departure(sd: float, tip: float) -> float:
    """The least height, m, that neither noise of a standard deviation (m) nor a smooth remainder explains."""
    return max(STANDS_OFF * sd, LEAST_PART * tip)


def _spans(points: FloatArray, length: float) -> bool:
    """True if two of the places (N, 3) are so far apart, m."""
    return len(points) > 1 and bool(np.linalg.norm(points - points[0], axis=1).max() >= length)


def _in_wide_runs(blocks: Blocks, height: FloatArray, off: BoolArray, tip: float) -> BoolArray:
    """(B,) True for blocks of stretches that stand off to one side all along, and are wide: hollows as a whole, what
    stands out at half its height."""
    state = np.where(off, np.sign(height), 0.0)
    new = np.flatnonzero((np.diff(state, prepend=np.nan) != 0) | (np.diff(blocks.piece, prepend=-1) != 0))
    lengths = np.diff(np.append(new, len(blocks)))
    if not len(new):
        return off
    top = np.maximum.reduceat(height, new)
    upper = np.add.reduceat((height >= 0.5 * np.repeat(top, lengths)).astype(np.int64), new)
    wide = (
        np.where(top > 0, upper * blocks.step - 2.0 * beside(0.5 * top, tip), lengths * blocks.step) >= WIDE_PART * tip
    )
    return np.asarray(np.repeat(wide, lengths) & off)


def _is_wide(
    points: FloatArray, normals: FloatArray, narrower: float, blocks: Blocks, off: BoolArray, tip: float
) -> bool:
    """True for places (N, 3) that are wide in both directions and filled.

    Args:
        narrower: what the ball stands off beside them, and is no width of theirs, m.
    """
    middle = points.mean(axis=0)
    if len(points) < 3:
        return False
    across = np.linalg.svd(points - middle, full_matrices=False)[2][1]
    width = float(np.ptp((points - middle) @ across)) - narrower  # or wider, by less than a block
    if width < WIDE_PART * tip:
        return False
    near = np.linalg.norm(blocks.points - middle, axis=1) < 0.5 * width
    near &= (blocks.normals * normals.mean(axis=0)).sum(axis=1) > 0.0
    return not near.any() or bool(off[near].mean() >= FILLED_SHARE)
