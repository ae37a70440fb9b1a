"""Rested on: the places of crests that all balls beside them leave room for.

Over a crest of height h a ball of radius r stands h - d^2 / 2 r high at a distance d: what a ball was felt at bounds
the crests about it, and what all of them leave is the closing of the trace by the ball. The trace is flat on a crest's
top, and merges with that of a stroke beside or behind a bend, where single sweeps then show something wide; the closing
falls off either side of the crest as steeply as the trace itself meets the base there, as (1 - x / w)^2 for a half
width w of the disturbance.

Reference: Serra, Image Analysis and Mathematical Morphology, 1982; the estimated surface of the paper.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from mapping import FloatArray, IntArray
from mapping.assembly.linking.inspection import Inspection

# Of the rules' lines over a building seed of S 3 mm, spiral, star and A, which are 1, 1, 10 and 3 within 0.38 mm of the
# truth, another value leaves: a share of 0.85 an A of one line, of 0.8 a star of 7 as well, 0.95 a star of 11.
#
# Share of what a ball was felt at near by that the closing leaves of a crest's place: as (1 - x / w)^2 at 0.05
# half-widths aside of a straight one
HELD_SHARE = 0.9
# Places are tried so many half-widths apart (0.2: an A of one line and places 0.63 mm off; 0.05: an A of 4, in twice
# the time), up to so far aside of a sweep (0.2 and 0.5: the same lines)
TRIED_APART, TRIED_ASIDE = 0.1, 0.35
# Places within so many half-widths are one point of a course (0.4: an A of one line, an S of one and two spots; 0.15:
# an A of 4, and a star 0.85 mm off)
ONE_PLACE = 0.25


def rested_on(places: IntArray, inspection: Inspection, tip_radius: float, half_width: float) -> FloatArray:
    """(K, 3) places along the crests about some inspected places, ONE_PLACE half-widths or more apart, m.

    What is less than half as high as the crest is another's.

    Args:
        places: (M,) indices, ascending: where crests are sought.
        inspection: heights of all sweeps over the base.
        tip_radius: m.
        half_width: of the disturbance of a crest, m.
    """
    from scipy.spatial import cKDTree

    tried = _beside(places, inspection, half_width)
    near: Any = cKDTree(inspection.points).query_ball_point(tried, half_width, return_sorted=False)
    counts = np.array([len(balls) for balls in near], dtype=np.int64)
    balls = np.fromiter(itertools.chain.from_iterable(near), np.int64, int(counts.sum()))
    tried, counts = tried[counts > 0], counts[counts > 0]
    if not len(tried):
        return tried
    begin = np.cumsum(counts) - counts
    felt, away = inspection.height[balls], inspection.points[balls] - np.repeat(tried, counts, axis=0)
    top = np.maximum.reduceat(felt, begin)
    held = np.minimum.reduceat(felt + (away**2).sum(axis=1) / (2.0 * tip_radius), begin)
    high = top > 0.5 * half_width**2 / (2.0 * tip_radius)
    left = np.minimum(held[high] / top[high], 1.0)
    tried, left = tried[high][left > HELD_SHARE], left[left > HELD_SHARE]
    return _thinned(tried, left - HELD_SHARE, ONE_PLACE * half_width)


def _beside(places: IntArray, inspection: Inspection, half_width: float) -> FloatArray:
    """(N, 3) places on and beside the sweeps' own."""
    points, step = inspection.points, TRIED_APART * half_width
    ways = np.zeros((len(places), 3))
    for axis in range(3):
        ways[:, axis] = points[np.minimum(places + 1, len(points) - 1), axis] - points[np.maximum(places - 1, 0), axis]
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), np.finfo(float).tiny)
    across = np.cross(inspection.normals[places], ways)
    on = np.arange(0.0, inspection.spacing, step)
    aside = step * np.arange(-int(TRIED_ASIDE / TRIED_APART), int(TRIED_ASIDE / TRIED_APART) + 1)
    return np.concatenate([points[places] + s * ways + x * across for s in on for x in aside])


def _thinned(points: FloatArray, weights: FloatArray, apart: float) -> FloatArray:
    """(K, 3) weighted means of the points (N, 3) nearest to each of those that stand out most, `apart` m or more."""
    from scipy.spatial import cKDTree

    if not len(points):
        return points
    tree, open_to, chosen = cKDTree(points), np.ones(len(points), dtype=bool), list[int]()
    for k in np.argsort(-weights, kind="stable"):
        if open_to[k]:
            chosen.append(int(k))
            open_to[tree.query_ball_point(points[k], apart)] = False
    own, square = cKDTree(points[chosen]).query(points)[1], weights**2
    total = np.bincount(own, square)
    return np.column_stack([np.bincount(own, square * points[:, i]) / total for i in range(3)])
