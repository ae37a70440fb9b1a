"""Rival courses: are several sweeps that each show something wide a wide line, or did they run along finer ones?

A sweep that runs at a slant over a crest shows it as wide as it likes: where a ring's sweeps pass beside its top, or
one passes over two strokes of a letter at once. What the sweeps that cross it squarely show decides. Neither account
needs a family for that: whatever the section is, a height is one function of the distance from the course, falling
from the crest outwards, and the account under whose courses such a function leaves less over is the likelier one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapping import Feature, FloatArray
from mapping.assembly.free.section import CORE
from mapping.assembly.linking import Inspection
from mapping.geometry.mesh import distances, nearest_on, resample
from mapping.inference.joint import felt_together, gaps
from mapping.inference.kinds import kind_of, sizes_of

# Numbers that say where a feature is: a spot's two; a line's two ends, and one for how it bends between them
PLACED_BY_SPOT, PLACED_BY_LINE = 2, 5


def outweighed(
    wide: Sequence[Feature], beside: Sequence[Feature], rivals: Sequence[Feature], inspection: Inspection, tip: float
) -> list[bool]:
    """Of each wide feature whether the rivals that are felt where it is have other courses, and likelier ones.

    Args:
        wide: what sections are of.
        beside: what else was detected, if these are right.
        rivals: all that was detected, if they are not.
        inspection: heights of all sweeps.
        tip: radius, m.
    """
    features, lost = [*wide, *beside], [False] * len(wide)
    both = [*features, *rivals]
    for group in felt_together(gaps(both, [sizes_of(feature, tip).half_width for feature in both])):
        asked = [k for k in group if k < len(wide)]
        ours = [features[k] for k in group if k < len(features)]
        theirs = [rivals[k - len(features)] for k in group if k >= len(features)]
        if not asked or not theirs:
            continue
        width = max(wide[k].width.median for k in asked)
        if not _alike(ours, theirs, width, inspection.pitch) and _log_ratio(theirs, ours, inspection, tip) > 0.0:
            for k in asked:
                lost[k] = True
    return lost


def _alike(features: Sequence[Feature], rivals: Sequence[Feature], width: float, pitch: float) -> bool:
    """True of the same courses, each within the core of what is so wide (m), and ending where the next sweep may tell
    it: how wide that is, its sections say."""
    pairs = ((features, rivals), (rivals, features))
    return all(_runs_along(each, others, CORE * width, 0.5 * width + pitch) for some, others in pairs for each in some)


def _runs_along(feature: Feature, others: Sequence[Feature], aside: float, beyond: float) -> bool:
    """True of a course all of which lies within a distance aside of one of some others, or so far beyond its end, m."""
    length = float(np.linalg.norm(np.diff(feature.axis, axis=0), axis=1).sum())
    places = resample(feature.axis, int(length / aside) + 2) if length > 0.0 else feature.axis[:1]
    near = np.zeros(len(places), dtype=bool)
    for other in others:
        nearest = nearest_on(places, other.axis)[0]
        away = np.linalg.norm(places - nearest, axis=1)
        ends = other.axis[[0, -1]] if len(other.axis) > 1 else np.zeros((0, 3))
        ended = (nearest[:, None] == ends[None]).all(axis=2).any(axis=1)
        near |= away < np.where(ended, beyond, aside)
    return bool(near.all())


def _log_ratio(rivals: Sequence[Feature], features: Sequence[Feature], inspection: Inspection, tip: float) -> float:
    """Log of how much likelier the rivals are than the features, by the heights about all of them.

    What a free section leaves over along one sweep goes together: each sweep is one look (Schwarz's approximation,
    Annals of Statistics 6, 1978, with as many looks).
    """
    apart = [distances(inspection.points, each.axis) for each in (*features, *rivals)]
    reach = [sizes_of(each, tip).half_width for each in (*features, *rivals)]
    near = np.any([away < far for away, far in zip(apart, reach, strict=True)], axis=0) & (inspection.samples > 0)
    looks = len(np.unique(inspection.sweep[near]))
    if looks < 2:
        return 0.0
    split = len(features)
    left = [
        _left_over(some, np.array(away)[:, near], inspection.height[near], inspection.samples[near].astype(float))
        for some, away in ((features, apart[:split]), (rivals, apart[split:]))
    ]
    more = _placed_by(rivals) - _placed_by(features)
    return 0.5 * looks * float(np.log(left[0] / left[1])) - 0.5 * more * float(np.log(looks))


def _placed_by(features: Sequence[Feature]) -> int:
    return sum(PLACED_BY_LINE if kind_of(feature).line else PLACED_BY_SPOT for feature in features)


def _left_over(features: Sequence[Feature], apart: FloatArray, heights: FloatArray, weights: FloatArray) -> float:
    """Weighted squares of heights (M,) that no falling function of the distance from the nearest course explains.

    Args:
        features: the account.
        apart: (F, M) distances from their axes, m.
        heights, weights: (M,) m, and samples behind each.
    """
    from scipy.optimize import isotonic_regression

    nearest, sum_of_squares = apart.argmin(axis=0), 0.0
    for sign in (1.0, -1.0):
        own = np.flatnonzero(np.array([np.sign(each.height.median) == sign for each in features])[nearest])
        if len(own):
            order = own[np.argsort(apart[:, own].min(axis=0), kind="stable")]
            told = isotonic_regression(sign * heights[order], weights=weights[order], increasing=False).x
            sum_of_squares += float(weights[order] @ (sign * heights[order] - told) ** 2)
    return max(sum_of_squares, np.finfo(float).tiny)
