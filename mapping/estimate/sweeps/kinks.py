"""Interference points of a sweep: kinks of the traced surface, where the ball rests on two places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray, lengths
from mapping.estimate.sweeps.tangents import STENCIL, chord_lengths, lagrange, unit

# The concave turn at a kink must exceed the turns beside it by this factor.
KINK_TURN_RATIO = 3.0


@dataclass(frozen=True, eq=False)
class Kinks:
    """Concave kinks of one sweep.

    Args:
        cuts: (K,) each kink lies between samples cut - 1 and cut.
        centers: (K, 3) where the smooth pieces on both sides meet, m: the ball there touches twice.
        before, after: (K, 3) unit tangents of the two pieces at that place.
    """

    cuts: IntArray
    centers: FloatArray
    before: FloatArray
    after: FloatArray


NO_KINKS = Kinks(np.zeros(0, dtype=np.int64), *(np.zeros((0, 3)) for _ in range(3)))


def find_kinks(points: FloatArray, outward: FloatArray) -> Kinks:
    """Kinks of a sweep (N, 3) that turn towards `outward` (N, 3).

    A smooth trace turns by about the same angle at neighbouring samples, whatever its curvature; at a
    kink the whole jump falls on one gap. The place is where the pieces, continued, meet: it is found far
    more finely than the spacing.
    """
    cuts = _outstanding_turns(points, outward)
    centers, before, after = _meet(points, cuts)
    return Kinks(cuts, centers, before, after)


def _outstanding_turns(points: FloatArray, outward: FloatArray) -> IntArray:
    if len(points) < 4:
        return np.zeros(0, dtype=np.int64)
    steps = np.diff(points, axis=0)
    length = lengths(steps)
    directions = unit(steps)
    bend = np.diff(directions, axis=0)
    side = np.sign(np.einsum("ij,ij->i", bend, outward[1:-1]))
    turn = np.zeros(len(points) + 2)  # turn[i + 1] belongs to sample i; borders turn by nothing
    turn[2:-2] = side * 2 * np.arcsin(np.clip(lengths(bend) / 2, 0, 1))
    here = turn[1:-2] + turn[2:-1]  # both ends of gap i
    beside = np.abs(turn[:-3]) + np.abs(turn[3:])
    rounding = 16 * np.finfo(float).eps * np.abs(points).max() / np.maximum(length, np.finfo(float).tiny)
    candidate = np.where(here > KINK_TURN_RATIO * beside + rounding, here, 0.0)
    padded = np.r_[0.0, candidate, 0.0]
    peak = (candidate > 0) & (candidate >= padded[:-2]) & (candidate > padded[2:])
    return np.flatnonzero(peak) + 1


def _meet(points: FloatArray, cuts: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where the pieces before and after each cut meet, and their unit tangents there."""
    middle = 0.5 * (points[cuts - 1] + points[cuts])
    centers = middle.copy()
    before, after = np.zeros_like(middle), np.zeros_like(middle)
    room_before, room_after = np.diff(np.r_[0, cuts]), np.diff(np.r_[cuts, len(points)])
    size = np.clip(np.minimum(room_before, room_after), 1, STENCIL)
    s = chord_lengths(points)
    for m in range(1, STENCIL + 1):
        chosen = np.flatnonzero(size == m)
        if len(chosen) == 0:
            continue
        left = cuts[chosen][:, None] + np.arange(-max(m, 2), 0)
        right = cuts[chosen][:, None] + np.arange(max(m, 2))
        left, right = np.clip(left, 0, None), np.clip(right, None, len(points) - 1)
        if m == 1:
            before[chosen] = after[chosen] = unit(points[cuts[chosen]] - points[cuts[chosen] - 1])
            continue
        centers[chosen], before[chosen], after[chosen] = _intersect(points, s, left, right, middle[chosen])
    return centers, before, after


def _intersect(
    points: FloatArray, s: FloatArray, left: IntArray, right: IntArray, middle: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Newton's method for two interpolating curves in space; the middle of the gap where it fails."""
    start, stop = s[left[:, -1]], s[right[:, 0]]
    gap = stop - start
    at = np.column_stack([start + gap / 2, stop - gap / 2])
    for _ in range(12):
        (p, dp), (q, dq) = _curve(points, s, left, at[:, 0]), _curve(points, s, right, at[:, 1])
        a, b, c = (np.einsum("ij,ij->i", x, y) for x, y in ((dp, dp), (dp, dq), (dq, dq)))
        u, v = (np.einsum("ij,ij->i", x, q - p) for x in (dp, dq))
        det = a * c - b * b
        safe = np.where(det > 0, det, 1.0)
        step = np.column_stack([c * u - b * v, b * u - a * v]) / safe[:, None]
        at += np.where((det > 0)[:, None], np.clip(step, -gap[:, None], gap[:, None]), 0.0)
    (p, dp), (q, dq) = _curve(points, s, left, at[:, 0]), _curve(points, s, right, at[:, 1])
    slack = 0.25 * gap[:, None]
    inside = ((at > start[:, None] - slack) & (at < stop[:, None] + slack)).all(axis=1)
    met = inside & (np.linalg.norm(p - q, axis=1) < 0.1 * gap)
    ends = (_curve(points, s, left, start)[1], _curve(points, s, right, stop)[1])
    pick = met[:, None]
    return np.where(pick, 0.5 * (p + q), middle), unit(np.where(pick, dp, ends[0])), unit(np.where(pick, dq, ends[1]))


def _curve(points: FloatArray, s: FloatArray, index: IntArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Value and derivative (K, 3) at `at` (K,) of the polynomials through points[index] (K, m)."""
    value, slope = lagrange(s[index] - s[index[:, :1]], at - s[index[:, 0]])
    anchor = points[index[:, :1]]
    local = points[index] - anchor
    return np.einsum("km,kmc->kc", value, local) + anchor[:, 0], np.einsum("km,kmc->kc", slope, local)
