"""Coverage: which share of each face sweeps inspected, and how small a feature on it they would have found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Surface
from mapping.geometry.mesh import NEAREST_COST, BoxedPoints, by_shares

# Samples of faces looked at, at most
MOST_FACE_SAMPLES = 2_000_000


@dataclass(frozen=True, eq=False)
class Coverage:
    """How much of a mesh was inspected.

    Args:
        share: (F,) inspected share of each face, 0 to 1.
        fraction: inspected share of the area of all faces.
        reach: distance from a sweep up to which a feature is seen, m.
    """

    share: FloatArray
    fraction: float
    reach: float


def coverage(surface: Surface, touched: FloatArray, reach: float) -> Coverage:
    """Coverage of a mesh by the points (N, 3) that sweeps touched.

    Every face is sampled three times as finely as `reach`; a sample is inspected if a touched point lies within
    `reach` of it in space.
    """
    points, owner = face_samples(surface, reach / 3.0)
    near = np.zeros(len(points), dtype=bool)
    if len(touched):
        near = np.isfinite(BoxedPoints(touched).nearest(points, reach)[0])
    count = len(surface.faces)
    share = np.bincount(owner, weights=near, minlength=count) / np.bincount(owner, minlength=count)
    areas = surface.face_areas
    total = float(areas.sum())
    return Coverage(share, float((share * areas).sum() / total) if total > 0 else 0.0, reach)


@dataclass(frozen=True, eq=False)
class FoundHeights:
    """From which height on a crest would have been found; infinity where it might not have been.

    Args:
        face: (F,) anywhere on each face, m.
        place: (N,) at each of many places all over the surface, m.
        area: (N,) that each place stands for, m^2.
        points: (N, 3) the places, m.
        normals: (N, 3) outward unit normals there.
    """

    face: FloatArray
    place: FloatArray
    area: FloatArray
    points: FloatArray
    normals: FloatArray

    def at(self, places: BoolArray) -> FoundHeights:
        """Those of some places (N,) alone, and all faces."""
        return FoundHeights(self.face, self.place[places], self.area[places], self.points[places], self.normals[places])


def found_heights(
    surface: Surface, touched: FloatArray, up: FloatArray, tip_radius: float, limit: float = 0.0
) -> FoundHeights:
    """The height from which on a crest would have been found, by face and by place; without a limit, what is lost.

    A crest of height D lifts the ball by D less what is lost (`lost_heights`); it is found, with the probability that
    `limit` is stated for, if that is at least the detection limit. Taken is the nearest sweep alone, so the true
    probability is higher where two sweeps pass near.

    Args:
        touched: (N, 3) places of the base that sweeps touched, closer together than the answer is wanted, m.
        up: (N, 3) unit directions from there to the ball's centre.
        tip_radius: r, m.
        limit: height of the smallest crest found where a sweep crosses it, m.

    Reference: theory sections 4 and 6.
    """
    if not len(touched):
        nowhere, middle = np.full(len(surface.faces), np.inf), surface.vertices[surface.faces].mean(axis=1)
        return FoundHeights(nowhere, nowhere, surface.face_areas, middle, surface.face_normals)
    step = 0.06 * tip_radius
    while _sample_count(surface, step) > MOST_FACE_SAMPLES:
        step *= 1.5
    points, owner = face_samples(surface, step)
    normals = surface.face_normals[owner]
    lost = lost_heights(points, normals, touched, up, tip_radius)
    # as far as a place of the face may lie from the nearest sample
    parts = _parts(surface, step)
    low = np.minimum(lost, tip_radius)
    further = np.sqrt(low * (2.0 * tip_radius - low)) + 0.55 * (_longest_sides(surface) / parts)[owner]
    worst = np.zeros(len(surface.faces))
    np.maximum.at(worst, owner, _lost_on_a_plane(further, tip_radius))
    return FoundHeights(limit + worst, limit + lost, (surface.face_areas / parts**2)[owner], points, normals)


def lost_heights(
    points: FloatArray, normals: FloatArray, touched: FloatArray, up: FloatArray, tip_radius: float
) -> FloatArray:
    """(N,) m: height at which a crest on each place just touches the nearest ball; infinity from a tip radius on.

    A crest that stands on a place along its normal n touches the ball whose centre is c, for d = c - place, from
    h = (d^2 - r^2) / (d n + sqrt((d n)^2 - d^2 + r^2)) on: r - sqrt(r^2 - y^2) at the distance y over a plane, more on
    an outward bend, less on an inward one.

    Args:
        points, normals: (N, 3) places, m, and the outward unit normals there.
        touched, up: (M, 3) places of the base that sweeps touched, m, and unit directions from there to the ball.
        tip_radius: r, m.

    Reference: theory section 4.
    """
    lost = np.full(len(points), np.inf)
    if not len(touched):
        return lost
    centres = touched + tip_radius * up
    boxed = BoxedPoints(centres)

    def nearest(at: FloatArray) -> IntArray:
        return boxed.nearest(at, tip_radius)[1]

    # the ball that would rest on a place tells on which side of a thin wall it is
    index = by_shares(nearest, points + tip_radius * normals, NEAREST_COST)
    passed = np.flatnonzero(index < len(centres))
    lost[passed] = _lost(centres[index[passed]] - points[passed], normals[passed], tip_radius)
    return lost


def _lost(away: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) m: height along the normals (N, 3) at which the ball is touched whose centre lies so far away (N, 3), m."""
    distance = np.linalg.norm(away, axis=1)
    along = np.einsum("ni,ni->n", away, normals)
    outside = (distance - tip_radius) * (distance + tip_radius)
    root = along**2 - outside
    touches = (root >= 0.0) & (along > 0.0)
    lost = outside / np.where(touches, along + np.sqrt(np.maximum(root, 0.0)), 1.0)
    return np.where(touches, np.maximum(lost, 0.0), np.inf)


def _lost_on_a_plane(distance: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) m: the same at distances (N,) m from a sweep over a plane; infinity from a tip radius on."""
    inside = np.sqrt(np.maximum(tip_radius**2 - distance**2, 0.0))
    return np.where(distance < tip_radius, np.minimum(distance, tip_radius) ** 2 / (tip_radius + inside), np.inf)


def found_probability(
    distance: FloatArray, height: float, tip_radius: float, limit: float, threshold: float, at_limit: float = 0.95
) -> FloatArray:
    """(N,) probability that a sweep which passes a sharp crest at the distances (N,) m finds it.

    The signal-to-noise ratio grows as the 5/4th power of the height that the sweep sees (white noise: height times
    the square root of the width), and is such that a crest of the detection limit is found with `at_limit`.

    Args:
        height: of the crest, m.
        limit, threshold: of the detection: m, and in standard deviations.

    Reference: theory section 6: P = Phi(d' - u).
    """
    from scipy.special import ndtr, ndtri

    y = np.minimum(np.abs(distance), tip_radius)
    seen = np.clip(height - y**2 / (tip_radius + np.sqrt(tip_radius**2 - y**2)), 0.0, None)
    signal = (threshold + ndtri(at_limit)) * (seen / limit) ** 1.25
    return np.where(seen > 0, ndtr(signal - threshold), 0.0)


def _parts(surface: Surface, spacing: float) -> IntArray:
    """(F,) subdivisions of each face's sides."""
    longest = _longest_sides(surface)
    # a face of 200 subdivisions already has 40 000 samples
    return np.asarray(np.clip(np.ceil(longest / spacing), 1, 200).astype(np.int64))


def _longest_sides(surface: Surface) -> FloatArray:
    """(F,) m."""
    corners = surface.vertices[surface.faces]
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1))


def _sample_count(surface: Surface, spacing: float) -> int:
    parts = _parts(surface, spacing)
    # a spacing that leaves each face one sample cannot be made coarser
    return int((parts**2).sum()) if parts.max(initial=1) > 1 else 0


def face_samples(surface: Surface, spacing: float) -> tuple[FloatArray, IntArray]:
    """Points (N, 3) spread evenly over every face, at most about `spacing` apart, and the face of each."""
    corners, parts = surface.vertices[surface.faces], _parts(surface, spacing)
    points, owner = [], []
    for n in np.unique(parts):
        faces = np.flatnonzero(parts == n)
        i, j = np.divmod(np.arange(n * n), n)
        flip = i + j >= n
        u = np.where(flip, n - i - 1 / 3, i + 1 / 3) / n
        v = np.where(flip, n - j - 1 / 3, j + 1 / 3) / n
        weights = np.column_stack([1 - u - v, u, v])
        points.append(np.einsum("sk,fkx->fsx", weights, corners[faces]).reshape(-1, 3))
        owner.append(np.repeat(faces, n * n))
    return np.concatenate(points), np.concatenate(owner)
