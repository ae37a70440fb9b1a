"""Truth: the features that a simulated object really has, and how far the found ones are from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from mapping import Feature, FloatArray, Interval
from mapping.geometry.mesh import arclengths, directions, nearest_on, resample
from mapping.model import ObjectModel

MATCH_STATUSES = ("found", "missed", "invented")

# Points at which two axes are compared.
AXIS_SAMPLES = 201


@dataclass(frozen=True, eq=False)
class TrueFeature:
    """A feature as the scene's author made it.

    Args:
        kind: as in mapping.KINDS.
        axis: (K, 3) points under the crest, m; K = 1 for a bump or a pit.
        height: signed height over the base, m.
        width: full width, m; None if not given.
        length: length along the axis, m; None takes it from the axis.
    """

    kind: str
    axis: FloatArray
    height: float
    width: float | None = None
    length: float | None = None

    def __init__(
        self, kind: str, axis: ArrayLike, height: float, width: float | None = None, length: float | None = None
    ) -> None:
        points = np.array(axis, dtype=np.float64).reshape(-1, 3)
        points.setflags(write=False)
        object.__setattr__(self, "kind", kind)
        object.__setattr__(self, "axis", points)
        object.__setattr__(self, "height", float(height))
        object.__setattr__(self, "width", None if width is None else float(width))
        object.__setattr__(self, "length", float(arclengths(points)[-1]) if length is None else float(length))


@dataclass(frozen=True, eq=False)
class Comparison:
    """One true feature beside the found one, or either alone.

    Args:
        status: one of MATCH_STATUSES; "invented" was found but is not there.
        true, found: the two features, None where there is none.
        axis_rms, axis_max: distance of the found axis from the true one across it, m; for point features the
            distance between the points.
        end_error: larger of the two distances between corresponding ends, m; NaN for points and rings.
        height_error, width_error, length_error: found minus true, m; NaN where not comparable.
        height_inside, width_inside, length_inside: is the truth within the 90 % interval? None: not comparable.
    """

    status: str
    true: TrueFeature | None = None
    found: Feature | None = None
    axis_rms: float = nan
    axis_max: float = nan
    end_error: float = nan
    height_error: float = nan
    width_error: float = nan
    length_error: float = nan
    height_inside: bool | None = None
    width_inside: bool | None = None
    length_inside: bool | None = None

    @classmethod
    def of(cls, true: TrueFeature, found: Feature) -> Self:
        """The errors of a found feature against its truth."""
        lateral = _lateral(found.axis, true.axis)
        height = _against(found.height, true.height)
        width = _against(found.width, true.width)
        length = _against(found.length, true.length if len(true.axis) > 1 else None)
        return cls(
            "found",
            true,
            found,
            float(np.sqrt(np.mean(lateral**2))),
            float(lateral.max()),
            _end_error(found, true),
            *(height[0], width[0], length[0]),
            *(height[1], width[1], length[1]),
        )


def compare(model: ObjectModel, truth: Sequence[TrueFeature], tip_radius: float) -> tuple[Comparison, ...]:
    """Match found features to true ones: every true feature in its order, then what was invented.

    A pair must have the same sign of height and lie within the strip that the true feature disturbs,
    sqrt(2 r |H|) + half its width (theory section 6); among those the assignment of least total distance,
    measured from either axis to the other so that a fragment does not displace the whole, is taken.
    """
    from scipy.optimize import linear_sum_assignment

    features = model.features
    far = 1e6 * max(model.base.surface.size, tip_radius)
    cost = np.array([[_cost(found, true, tip_radius, far) for found in features] for true in truth])
    cost = cost.reshape(len(truth), len(features))
    rows, columns = linear_sum_assignment(cost)
    partner = {int(i): int(j) for i, j in zip(rows, columns, strict=True) if cost[i, j] < far}
    known = [
        Comparison.of(true, features[partner[i]]) if i in partner else Comparison("missed", true)
        for i, true in enumerate(truth)
    ]
    taken = set(partner.values())
    return (*known, *(Comparison("invented", found=each) for j, each in enumerate(features) if j not in taken))


def _cost(found: Feature, true: TrueFeature, tip_radius: float, far: float) -> float:
    strip = np.sqrt(2.0 * tip_radius * abs(true.height)) + 0.5 * (true.width or 0.0)
    if np.sign(found.height.median) != np.sign(true.height) or _lateral(found.axis, true.axis).mean() > strip:
        return far
    return _mean_distance(found.axis, true.axis) + _mean_distance(true.axis, found.axis)


def _dense(axis: FloatArray) -> FloatArray:
    return resample(axis, AXIS_SAMPLES) if len(axis) > 1 else axis


def _mean_distance(points: FloatArray, axis: FloatArray) -> float:
    dense = _dense(points)
    return float(np.linalg.norm(dense - nearest_on(dense, axis)[0], axis=1).mean())


def _lateral(found: FloatArray, true: FloatArray) -> FloatArray:
    """Distances of the found axis from the true one; running past its end counts as length, not here."""
    dense = _dense(found)
    closest, s = nearest_on(dense, true)
    offset = dense - closest
    if len(true) > 1 and len(found) > 1:
        along = directions(true)[[0, -1]]
        for beyond, tangent in ((s <= 0.0, along[0]), (s >= arclengths(true)[-1], along[1])):
            offset[beyond] -= np.outer(offset[beyond] @ tangent, tangent)
    return np.asarray(np.linalg.norm(offset, axis=1))


def _end_error(found: Feature, true: TrueFeature) -> float:
    ring = len(true.axis) > 2 and np.array_equal(true.axis[0], true.axis[-1])
    if len(true.axis) < 2 or len(found.axis) < 2 or ring or found.closed:
        return nan
    ends, mine = true.axis[[0, -1]], found.axis[[0, -1]]
    return float(min(np.linalg.norm(mine[order] - ends, axis=1).max() for order in ([0, 1], [1, 0])))


def _against(interval: Interval, true: float | None) -> tuple[float, bool | None]:
    """Error of the median, and whether the truth lies in the interval (a bound: on its side of it)."""
    if true is None or not np.isfinite(interval.median):
        return nan, None
    above, below = true >= interval.low, true <= interval.high
    if interval.censored and not interval.bounded:
        return interval.median - true, bool(below if interval.median < 0.0 else above)
    return interval.median - true, bool(above and below)
