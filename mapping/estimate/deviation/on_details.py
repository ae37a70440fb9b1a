"""On details: whether what stands off a model may be details on it, or needs another model."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, IntArray
from mapping.estimate.deviation.blocks import SIDES_APART, Blocks

# A stretch of a sweep that stands off over so many tip radii is wide: the ball goes into it, or onto it, as a whole,
# which it does with no fine feature
WIDE_PART = 2.0
# Body and model agree where they do over a tip radius: flanks of details, and a body that crosses its model, pass any
# level sooner
AGREEING_STRETCH = 1.0


def beside(height: FloatArray, tip: float) -> FloatArray:
    """(N,) how far a ball stands off to either side of what is so high (N,), m: sqrt(2 r t - t^2), none of hollows."""
    t = np.clip(height, 0.0, tip)
    return np.asarray(np.sqrt(2.0 * tip * t - t**2))


def unexplained(blocks: Blocks, height: FloatArray, within: float, tip: float) -> float:
    """Share of the felt surface that neither agrees with the model nor can lie on a detail that stands on it.

    A detail is narrow, of whatever shape: along a sweep it begins and ends, or it lies nearer to a place where body
    and model agree than half of what is wide, and what the ball stands off beside it. How much of a path lies on
    details says nothing of the model: a finger that explores goes where they are.

    Args:
        blocks: of the trace.
        height: (B,) over the model, m.
        within: two heights that differ by no more agree, m.
        tip: radius, m.
    """
    from scipy.spatial import cKDTree

    if not len(blocks):
        return 0.0
    side = np.where(np.abs(height) <= within, 0.0, np.sign(height))
    starts, counts = _stretches(blocks, side)
    # a sweep beside the top of a detail stands off as far as the top makes it, however low it runs itself; what the
    # sweep's end cuts off is as wide as it was felt
    one, other = cKDTree(blocks.points).query_pairs(WIDE_PART * tip, output_type="ndarray").T
    tallest = height.copy()
    np.maximum.at(tallest, one, height[other])
    np.maximum.at(tallest, other, height[one])
    lengths, top = counts * blocks.step, np.maximum.reduceat(tallest, starts)
    off = side[starts] != 0.0
    wide = lengths >= np.where(off, WIDE_PART * tip + 2.0 * beside(top, tip), AGREEING_STRETCH * tip)
    wide = np.repeat(wide, counts)
    agreeing, apart = wide & (side == 0.0), wide & (side != 0.0)
    if agreeing.any() and apart.any():
        places = np.column_stack([blocks.points, SIDES_APART * tip * blocks.normals])
        distance = cKDTree(places[agreeing]).query(places)[0]
        apart &= distance > 0.5 * WIDE_PART * tip + beside(height, tip)
    return float(np.average(apart, weights=blocks.weight))


def _stretches(blocks: Blocks, state: FloatArray) -> tuple[IntArray, IntArray]:
    """First blocks and counts of the unbroken stretches over which a state (B,) is the same."""
    new = np.flatnonzero((np.diff(state, prepend=np.nan) != 0) | (np.diff(blocks.piece, prepend=-1) != 0))
    return new, np.diff(np.append(new, len(blocks)))
