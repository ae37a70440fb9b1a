"""Coverage: which share of each face sweeps inspected, and how small a feature on it they would have found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Surface, lengths
from mapping.geometry.mesh import NEAREST_COST, BoxedPoints, by_shares

# Samples of faces looked at, at most
MOST_FACE_SAMPLES = 2_000_000
# And of which is asked at once which ball is nearest, and how far they miss it: some 150 bytes each on the way, 10 MB
PLACES_AT_ONCE = 2**16
# Subdivisions of a side, at most: a face of so many already has 40 000 samples
MOST_PARTS = 200
# Square of the longest side over the area above which a face is thin, less high than a third of its length: cells of
# its own shape would lie as close across it as there are many along it. The triangles of a machined part as CAD draws
# it are: a flange with bolt holes had 50 times as many samples as its area asks for
THIN = 6.0
# Of the wanted spacing, the width of the columns across thin faces: a place is half of it away along a face, and half
# of it across, as far as 0.55 of the spacing, as in the cells of others
COLUMN_WIDTH = 0.775


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
    samples, count = face_samples(surface, reach / 3.0), len(surface.faces)
    near = np.zeros(len(samples.points), dtype=bool)
    if len(touched):
        near = np.isfinite(BoxedPoints(touched).nearest(samples.points, reach)[0])
    share = np.asarray(np.bincount(samples.owner, samples.share * near, count), dtype=np.float64)
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
        if places.all():  # as nearly always: no copy of up to 2 million
            return self
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
    # two samples for the square of a step
    step = max(0.06 * tip_radius, float(np.sqrt(2.0 * surface.face_areas.sum() / MOST_FACE_SAMPLES)))
    # a spacing that leaves each face one sample, or two, cannot be made coarser
    while len((samples := face_samples(surface, step)).owner) > max(MOST_FACE_SAMPLES, 2 * len(surface.faces)):
        step *= 1.5
    normals = surface.face_normals[samples.owner]
    lost = lost_heights(samples.points, normals, touched, up, tip_radius)
    worst = np.zeros(len(surface.faces))
    for part in _parts(len(lost)):
        low = np.minimum(lost[part], tip_radius)
        further = np.sqrt(low * (2.0 * tip_radius - low)) + samples.gap[part]
        np.maximum.at(worst, samples.owner[part], _lost_on_a_plane(further, tip_radius))
    area = surface.face_areas[samples.owner]
    area *= samples.share
    lost += limit
    return FoundHeights(limit + worst, lost, area, samples.points, normals)


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

    for part in _parts(len(points)):
        # the ball that would rest on a place tells on which side of a thin wall it is
        index = by_shares(nearest, points[part] + tip_radius * normals[part], NEAREST_COST)
        passed = index < len(centres)
        away = centres[index[passed]] - points[part][passed]
        lost[part][passed] = _lost(away, normals[part][passed], tip_radius)
    return lost


def _parts(count: int) -> Iterator[slice]:
    """Runs of so many places, of which there may be 2 million: what is between their numbers is held of one run."""
    return (slice(first, first + PLACES_AT_ONCE) for first in range(0, count, PLACES_AT_ONCE))


def _lost(away: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) m: height along the normals (N, 3) at which the ball is touched whose centre lies so far away (N, 3), m."""
    distance = lengths(away)
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


@dataclass(frozen=True, eq=False)
class FaceSamples:
    """Points spread evenly over every face.

    Args:
        points: (N, 3) m.
        owner: (N,) the face of each.
        share: (N,) of that face's area which each stands for.
        gap: (N,) as far as a place of the face may lie from the nearest of them, m.
    """

    points: FloatArray
    owner: IntArray
    share: FloatArray
    gap: FloatArray


def face_samples(surface: Surface, spacing: float) -> FaceSamples:
    """Points all over a mesh, at most about `spacing` apart (m)."""
    corners, faces = surface.vertices[surface.faces], np.arange(len(surface.faces))
    longest = _sides(corners).max(axis=1)
    thin = longest**2 > THIN * surface.face_areas
    parts = [_of_cells(corners[~thin], faces[~thin], longest[~thin], spacing)]
    if not thin.any():
        return parts[0]
    parts.append(_of_columns(corners[thin], faces[thin], spacing))
    columns = ([getattr(part, each.name) for part in parts] for each in fields(FaceSamples))
    return FaceSamples(*(np.concatenate(column) for column in columns))


def _of_cells(corners: FloatArray, faces: IntArray, longest: FloatArray, spacing: float) -> FaceSamples:
    """Two points in each of the cells of triangles (F, 3, 3)."""
    parts = np.clip(np.ceil(longest / spacing), 1, MOST_PARTS).astype(np.int64)
    points, of = in_cells(corners, parts)
    return FaceSamples(points, faces[of], (1.0 / parts**2)[of], (0.55 * longest / parts)[of])


def in_cells(corners: FloatArray, parts: IntArray) -> tuple[FloatArray, IntArray]:
    """Two points in each of the cells that lines parallel to two sides of a triangle make.

    What is drawn on bodies at places of chance follows from the order of the points, the example bodies among it.

    Args:
        corners: (F, 3, 3) of triangles, m.
        parts: (F,) that a side of each is cut into.

    Returns:
        Points (N, 3), m, and the numbers (N,) of their triangles; those with fewer parts come first.
    """
    points, owner = [np.zeros((0, 3))], [np.zeros(0, dtype=np.int64)]
    for n in np.unique(parts):
        alike = np.flatnonzero(parts == n)
        i, j = np.divmod(np.arange(n * n), n)
        flip = i + j >= n
        u = np.where(flip, n - i - 1 / 3, i + 1 / 3) / n
        v = np.where(flip, n - j - 1 / 3, j + 1 / 3) / n
        weights = np.column_stack([1 - u - v, u, v])
        points.append(np.einsum("sk,fkx->fsx", weights, corners[alike]).reshape(-1, 3))
        owner.append(np.repeat(alike, n * n))
    return np.concatenate(points), np.concatenate(owner)


def _of_columns(corners: FloatArray, faces: IntArray, spacing: float) -> FaceSamples:
    """Points in columns across triangles (F, 3, 3): each is cut at its altitude, and both parts along their longer
    leg, so that no column's end is steeper than 45 degrees."""
    sides = _sides(corners)
    turned = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(corners, turned[:, :, None], axis=1), 1, 0)
    along, longest = b - a, sides.max(axis=1)
    square = np.maximum(longest**2, np.finfo(float).tiny)
    split = np.clip(np.einsum("ij,ij->i", c - a, along) / square, 0.0, 1.0)
    foot = a + split[:, None] * along
    # the two parts: from the altitude's foot to either end, and up to the apex
    legs = np.stack([np.concatenate([a, b]) - np.tile(foot, (2, 1)), np.tile(c - foot, (2, 1))], axis=1)
    lengths = np.linalg.norm(legs, axis=2)
    order = np.argsort(-lengths, axis=1, kind="stable")
    (long, short), (p, q) = (
        np.moveaxis(np.take_along_axis(of, at, axis=1), 1, 0)
        for of, at in ((legs, order[:, :, None]), (lengths, order))
    )
    width = COLUMN_WIDTH * np.maximum(spacing, np.tile(longest, 2) / MOST_PARTS)
    count = np.maximum(np.ceil(p / width), 1).astype(np.int64)
    part = np.repeat(np.arange(len(count)), count)
    i = np.arange(len(part)) - np.repeat(np.cumsum(count) - count, count)
    n = count[part]
    x = (i + 0.5) / n
    across = np.maximum(np.ceil((1.0 - i / n) * (q / width)[part]), 1).astype(np.int64)
    column = np.repeat(np.arange(len(part)), across)
    j = np.arange(len(column)) - np.repeat(np.cumsum(across) - across, across)
    of, x, m = part[column], x[column], across[column]
    y = (j + 0.5) / m * (1.0 - x)
    share = np.concatenate([split, 1.0 - split])[of] * (2.0 / n[column]) * (1.0 - x) / m
    del j, m, column  # of up to 2 million points; so these are summed in place, too
    points = np.tile(foot, (2, 1))[of]
    points += _steps(long, of, x)
    points += _steps(short, of, y)
    half = 0.5 * np.minimum(p / count, width)
    upwards = half * q / np.maximum(p, np.finfo(float).tiny) + 0.5 * np.minimum(q, width)
    gap = np.hypot(half, upwards).reshape(2, -1).max(axis=0)
    return FaceSamples(points, np.tile(faces, 2)[of], share, np.tile(gap, 2)[of])


def _steps(legs: FloatArray, of: IntArray, shares: FloatArray) -> FloatArray:
    """(N, 3) shares (N,) of those legs (P, 3), m."""
    steps = legs[of]
    steps *= shares[:, None]
    return steps


def _sides(corners: FloatArray) -> FloatArray:
    """(P, 3) lengths of the sides of triangles (P, 3, 3), each from one corner to the next, m."""
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2))
