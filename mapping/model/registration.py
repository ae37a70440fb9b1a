"""Registration: the rigid motion from the frame of one scan to that of another, from the features that both show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import Feature, FloatArray
from mapping.geometry.mesh import arclengths, middle, nearest_on

# A rotation of this many radians is a standard deviation of what is expected beforehand: a part put back by hand
TURN_SD = 0.02
# Features of one scan count as those of the other while they lie so many standard deviations apart (Cauchy's loss
# keeps 95 % of its efficiency for normal residuals at this constant: Holland and Welsch, 1977)
CAUCHY = 2.385
REGISTRATION_STEPS = 30
# A shift is believed if it brings this many more features together than none does: two could be chance
FEWEST_MORE = 2.0


@dataclass(frozen=True, eq=False)
class Registration:
    """The motion that brings a second scan onto a first: x -> rotation (x - centre) + centre + shift.

    Args:
        shift: (3,) m.
        rotation: (3, 3).
        centre: (3,) m.
        covariance: (6, 6) of the shift (m) and of the turn (rad).
        pairs: features that it rests on; 0: there were none, and the frames are taken as they are.
    """

    shift: FloatArray
    rotation: FloatArray
    centre: FloatArray
    covariance: FloatArray
    pairs: int

    def moved(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) of the second scan, in the frame of the first."""
        return (np.asarray(points) - self.centre) @ self.rotation.T + self.centre + self.shift

    def applied(self, feature: Feature) -> Feature:
        """A feature of the second scan in the frame of the first; its place carries the doubt of the motion."""
        rows = _rows(_middle(feature) - self.centre)
        sd = float(np.sqrt(np.trace(rows @ self.covariance @ rows.T) / 3.0))
        return replace(
            feature,
            axis=self.moved(feature.axis),
            normals=feature.normals @ self.rotation.T,
            position_sd=float(np.hypot(feature.position_sd, sd)),
        )

    @property
    def angle(self) -> float:
        """Of the turn, rad."""
        return float(np.arccos(np.clip(0.5 * (np.trace(self.rotation) - 1.0), -1.0, 1.0)))


def register(first: Sequence[Feature], second: Sequence[Feature], most_shift: float) -> Registration:
    """The motion from the second scan's frame to the first's.

    The shift that brings most features onto one of the same sign is found by votes of all pairs; then shift and turn
    follow by robust least squares (Cauchy's loss) with what is expected beforehand as a prior, so that what the
    features do not tell (a turn about a lone line) stays as it is. Lines count across themselves alone.

    Args:
        first, second: features of the two scans.
        most_shift: the largest shift that is looked for, m.
    """
    centre = np.mean([_middle(each) for each in second], axis=0) if second else np.zeros(3)
    none = Registration(np.zeros(3), np.eye(3), centre, np.zeros((6, 6)), 0)
    if not first or not second:
        return none
    from scipy.spatial.transform import Rotation

    shift = _voted(first, second, most_shift)
    prior = np.diag([*[1.0 / most_shift**2] * 3, *[1.0 / TURN_SD**2] * 3])
    found = replace(none, shift=shift, covariance=np.zeros((6, 6)))
    for _ in range(REGISTRATION_STEPS):
        pairs = _pairs(first, [replace(each, axis=found.moved(each.axis)) for each in second])
        if not pairs:
            return none
        normal, right = prior.copy(), np.zeros(6)
        for (a, b), weight in zip(pairs, _weights(pairs), strict=True):
            across, off = separation(a, b)
            rows = across @ _rows(_middle(b) - centre - found.shift)
            normal += weight * rows.T @ rows
            right -= weight * rows.T @ (across @ off)
        step = np.linalg.solve(normal, right)
        found = replace(
            found,
            shift=found.shift + step[:3],
            rotation=Rotation.from_rotvec(step[3:]).as_matrix() @ found.rotation,
            covariance=np.linalg.inv(normal),
            pairs=len(pairs),
        )
        if np.abs(step[:3]).max() < 1e-9 * most_shift and np.abs(step[3:]).max() < 1e-12:
            break
    return found


def _middle(feature: Feature) -> FloatArray:
    return middle(feature.axis)[0]


def _rows(lever: FloatArray) -> FloatArray:
    """(3, 6) derivative of a place by shift and turn."""
    x, y, z = lever
    return np.column_stack([np.eye(3), np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])])


def _voted(first: Sequence[Feature], second: Sequence[Feature], most: float) -> FloatArray:
    """The shift that most features agree on; none unless it is better than no shift by FEWEST_MORE features."""
    signs = [np.sign(each.height.median) for each in first], [np.sign(each.height.median) for each in second]
    a, b = (np.array([_middle(each) for each in scan]) for scan in (first, second))
    offsets = a[:, None] - b[None, :]
    like = np.equal.outer(*signs) & (np.linalg.norm(offsets, axis=2) <= most)
    candidates = np.concatenate([np.zeros((1, 3)), offsets[like]])
    # half the distance within a scan: two features that close are told apart
    scale = 0.25 * _spacing(a) if len(a) > 1 else most
    votes = np.zeros(len(candidates))
    for k, shift in enumerate(candidates):
        square = np.where(like, ((offsets - shift) ** 2).sum(axis=2), np.inf)
        votes[k] = np.exp(-0.5 * square.min(axis=0) / scale**2).sum()
    best = int(votes.argmax())
    believed = votes[best] >= votes[0] + FEWEST_MORE or len(b) < 3
    return np.asarray(candidates[best if believed else 0], dtype=np.float64)


def _spacing(points: FloatArray) -> float:
    """Median distance of a point from its nearest neighbour, m."""
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(gaps, np.inf)
    return float(np.median(gaps.min(axis=1)))


def matched(first: Sequence[Feature], second: Sequence[Feature]) -> list[tuple[int, int]]:
    """Which feature of the first scan is which of the second: of one sign, nearest in all, within half a spacing.

    Args:
        first, second: features in one frame.
    """
    from scipy.optimize import linear_sum_assignment

    if not first or not second:
        return []
    gaps = np.linalg.norm(
        np.array([_middle(each) for each in first])[:, None] - np.array([_middle(each) for each in second])[None],
        axis=2,
    )
    for i, j in ((i, j) for i, a in enumerate(first) for j, b in enumerate(second) if len(a.axis) + len(b.axis) > 2):
        gaps[i, j] = np.linalg.norm(separation(first[i], second[j])[1])
    unlike = np.multiply.outer([a.height.median for a in first], [b.height.median for b in second]) < 0.0
    places = np.array([_middle(each) for each in first])
    reach = 0.5 * _spacing(places) if len(first) > 1 else max(first[0].width.median, first[0].position_sd)
    cost = np.where(unlike | (gaps > reach), 10.0 * len(gaps) * reach + 1.0, gaps)
    rows, columns = linear_sum_assignment(cost)
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if gaps[i, j] <= reach and not unlike[i, j]]


def _pairs(first: Sequence[Feature], second: Sequence[Feature]) -> list[tuple[Feature, Feature]]:
    return [(first[i], second[j]) for i, j in matched(first, second)]


def separation(a: Feature, b: Feature) -> tuple[FloatArray, FloatArray]:
    """What of two features' distance counts (3, 3), a line's across itself alone; and the distance (3,), m."""
    if len(a.axis) == 1 or len(b.axis) == 1:
        return np.eye(3), _middle(b) - (_middle(a) if len(a.axis) == 1 else nearest_on(_middle(b)[None], a.axis)[0][0])
    line, other = (a, b) if arclengths(a.axis)[-1] >= arclengths(b.axis)[-1] else (b, a)
    foot = nearest_on(_middle(other)[None], line.axis)[0][0]
    along = line.axis[-1] - line.axis[0]
    along = along / max(float(np.linalg.norm(along)), np.finfo(float).tiny)
    off = _middle(other) - foot
    return np.eye(3) - np.outer(along, along), off if other is b else -off


def _weights(pairs: Sequence[tuple[Feature, Feature]]) -> FloatArray:
    """Of robust least squares: 1/variance, less for what lies many standard deviations off."""
    gaps = np.array([float(np.linalg.norm(np.matmul(*separation(a, b)))) for a, b in pairs])
    sds = np.array([float(np.hypot(a.position_sd, b.position_sd)) for a, b in pairs])
    # the scatter of the pairs themselves, where it is larger than their sds say
    sds = np.maximum(sds, 1.4826 * np.median(gaps) / np.sqrt(2.0))
    sds = np.maximum(sds, np.finfo(np.float32).eps * max(float(gaps.max()), 1e-9))
    return np.asarray(1.0 / (sds**2 * (1.0 + (gaps / (CAUCHY * sds)) ** 2)))
