"""Curvature by the method that expects the smaller error at each vertex: local jets, or libigl's quadratic fits.

The jets state their standard deviation. That of libigl's fits has two parts (theory section 9): the noise that a
quadratic fit over so many points lets through, and the bias, which grows with the square of the neighbourhood's size
and so is known from the disagreement of two sizes. libigl is asked where the jets are in doubt, and in a few
patches elsewhere, so that the two methods can be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Surface
from mapping.geometry.curvature.cloud_mesh import meshed
from mapping.geometry.curvature.curvature import Curvature, principal_sd
from mapping.geometry.curvature.jet import LARGE_MESH_POINTS, jets_and_noise, least_alike, oriented
from mapping.geometry.curvature.libigl_fits import SMALLEST_COMPONENT, libigl_curvatures
from mapping.geometry.curvature.neighbours import Neighbours

# Rings of libigl's fits; each is judged by the next, the last only judges.
RADII = (2, 3, 4, 6)
# Half-width of a 90 % interval in standard deviations.
INTERVAL = 1.645
# Points of two rings on a regular mesh (1 + 3 r (r + 1)): the smallest neighbourhood that a curvature is taken from.
TWO_RINGS = 19
# The nearest points of which a vertex must be one, so that a single one that stands out is seen.
NEAREST_POINTS = 10
# Standard deviations of the noise beyond which they certainly bend otherwise (one in two million by chance).
CERTAIN_SDS = 5.0
# Share of a squared column that may be left of it before the pseudoinverse decides what is rounding: half of its digits
SINGULAR = 1e-8
# Jets are in doubt where their interval is wider than this share of all curvatures that the sampling can carry.
DOUBTFUL_SHARE = 0.1
# Of several radii the one of the smallest expected error is taken, and of these the vertices where it is smaller than
# the jets'. What is so chosen errs by this factor more than a radius fixed beforehand (1.4 to 1.9 on the cells of
# `explore3d bench curvature`, with the seeds for tuning).
CHOICE_FACTOR = 1.5
# Meshes up to this size are asked as a whole: cutting patches out would save nothing.
WHOLE = 2000
# Elsewhere so many patches of so many vertices tell how far the methods are apart.
PATCHES, PATCH = 8, 60


def auto_curvature(body: Surface | FloatArray, normals: FloatArray | None, noise: float | None = None) -> Curvature:
    """Curvature by jets or by libigl, vertex by vertex whichever expects the smaller error.

    A value is valid if the sampling carries it: over the smallest neighbourhood, of radius R, no curvature beyond 1/R
    is seen, so a value whose 90 % interval is wider than 1/R to either side excludes nothing. The same holds where the
    nearest points bend away from the value by as much, and by half of it: what is there is finer than the sampling.

    Args:
        body: mesh or points (N, 3), m. A cloud is meshed first; where it cannot be, the jets answer alone.
        normals: (N, 3) outward normals, or None.
        noise: standard deviation of the points along the normal, m, or None: estimated.
    """
    jets, level = jets_and_noise(body, normals, noise)
    points = body.vertices if isinstance(body, Surface) else body
    near = _nearest(points)
    reach = _reach(points, near)
    remarks = tuple[str, ...]()
    mesh = body if isinstance(body, Surface) else meshed(body, normals)
    if mesh is None:
        remarks = ("the points could not be meshed: libigl was not asked",)
    elif len(points) < SMALLEST_COMPONENT:
        remarks = (f"libigl was not asked about fewer than {SMALLEST_COMPONENT} vertices",)
    else:
        found = _ask(mesh, _asked(jets, reach, points))
        remarks = tuple(dict.fromkeys(remark for one in found for remark in one.remarks))
        jets = _the_better(jets, found, mesh.faces, level, reach)
    outward = oriented(body, normals)[1]
    hidden = _hidden(
        points, outward, _of_one_side(near, outward, least_alike(normals)), 0.5 * (jets.k1 + jets.k2), level
    )
    return _where_carried(jets, hidden, reach, remarks)


def _nearest(points: FloatArray) -> IntArray:
    """(N, 19) indices of the nearest points, or of all if there are fewer; each point itself comes first."""
    return Neighbours(points).query(points, min(TWO_RINGS, len(points)))


def _of_one_side(near: IntArray, normals: FloatArray, alike: float) -> IntArray:
    """The neighbours (N, K), with the point itself in place of each that lies on another side of the body."""
    facing = np.einsum("nc,nkc->nk", normals, normals[near])
    return np.where(facing < alike, near[:, :1], near)


def _reach(points: FloatArray, near: IntArray) -> FloatArray:
    """(N,) radius of the smallest neighbourhood that a curvature is taken from, m."""
    return np.asarray(np.linalg.norm(points[near[:, -1]] - points, axis=1))


def _hidden(points: FloatArray, normals: FloatArray, near: IntArray, mean: FloatArray, noise: float) -> FloatArray:
    """(N,) by how much the nearest points are bent otherwise than by the mean curvature (N,), beyond noise, 1/m.

    They are fitted by a tilted paraboloid of revolution, which has four numbers and needs no wider neighbourhood.
    """
    found = np.zeros(len(points))
    if near.shape[1] < NEAREST_POINTS:
        return found
    for part in np.array_split(np.arange(len(points)), max(1, len(points) // LARGE_MESH_POINTS)):
        away = points[near[part, :NEAREST_POINTS]] - points[part, None]
        n = normals[part]
        up = np.einsum("mkc,mc->mk", away, n)
        flat = away - up[:, :, None] * n[:, None]
        scale = np.sqrt((flat**2).sum(axis=(1, 2)) / NEAREST_POINTS)
        flat = np.divide(flat, scale[:, None, None], out=np.zeros_like(flat), where=scale[:, None, None] > 0)
        inverse = _bend_weights(flat, n)
        bent = -(inverse * up).sum(axis=1)
        doubt = noise * np.linalg.norm(inverse, axis=1)
        size2 = np.where(scale > 0, scale, np.inf) ** 2
        found[part] = np.maximum(np.abs(bent / size2 - mean[part]) - CERTAIN_SDS * doubt / size2, 0.0)
    return found


def _bend_weights(flat: FloatArray, normals: FloatArray) -> FloatArray:
    """(M, K) weights of K heights in the bend of the tilted paraboloid of revolution that fits them best.

    What the others leave of the column of half the squared distances tells it alone: a constant and the two
    directions in the plane are taken off it in closed form, at a sixth of the time that pseudoinverses of all take.

    Args:
        flat: (M, K, 3) places in the planes with the unit normals (M, 3).
    """
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    x, y = (np.einsum("mkc,mc->mk", flat, way) for way in (first, np.cross(normals, first)))
    column = 0.5 * (x**2 + y**2)
    x, y, column = (values - values.mean(axis=1, keepdims=True) for values in (x, y, column))
    xx, xy, yy, xc, yc = (np.einsum("mk,mk->m", a, b) for a, b in ((x, x), (x, y), (y, y), (x, column), (y, column)))
    area = xx * yy - xy**2
    with np.errstate(divide="ignore", invalid="ignore"):  # points on one line, which the pseudoinverse does not mind
        left = column - ((yy * xc - xy * yc) / area)[:, None] * x - ((xx * yc - xy * xc) / area)[:, None] * y
        square = np.einsum("mk,mk->m", left, left)
        weights = left / square[:, None]
        plain = (area > SINGULAR * (xx + yy) ** 2) & (square > SINGULAR * np.einsum("mk,mk->m", column, column))
    rest = np.flatnonzero(~plain)
    if len(rest):
        # three columns of the tangential part, of rank two: the least squares of least norm does not mind
        part = flat[rest]
        columns = np.concatenate([np.ones((*part.shape[:2], 1)), part, 0.5 * (part**2).sum(axis=2)[:, :, None]], axis=2)
        weights[rest] = np.linalg.pinv(columns, rcond=1e-6)[:, -1]
    return np.asarray(weights)


def _asked(jets: Curvature, reach: FloatArray, points: FloatArray) -> BoolArray:
    """(N,) where libigl is asked: where the jets are in doubt, and in a few patches."""
    from scipy.spatial import cKDTree

    if len(points) <= WHOLE:
        return np.ones(len(points), dtype=bool)
    asked = ~(INTERVAL * jets.sd * reach < DOUBTFUL_SHARE)
    middles = points[np.linspace(0, len(points) - 1, PATCHES).astype(np.int64)]
    asked[cKDTree(points).query(middles, k=PATCH)[1].ravel()] = True
    return np.asarray(asked)


def _ask(mesh: Surface, asked: BoolArray) -> tuple[Curvature, ...]:
    """libigl's fits at every radius where they are asked for; NaN elsewhere."""
    near = asked.copy()
    for _ in range(RADII[-1] + 1):
        near[mesh.faces[near[mesh.faces].any(axis=1)]] = True
    faces = mesh.faces[near[mesh.faces].all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    if len(used) == 0:
        return ()
    # by a power of two, so that the same mesh in other units has the same digits
    place = mesh.vertices[used] - mesh.vertices[used].mean(axis=0)
    scale = 2.0 ** np.frexp(np.abs(place).max() or 1.0)[1]
    found = libigl_curvatures(Surface(place / scale, faces.reshape(-1, 3)), RADII)
    return tuple(_laid_back(one, used, asked, scale) for one in found)


def _laid_back(one: Curvature, used: IntArray, asked: BoolArray, scale: float) -> Curvature:
    """The curvature of a scaled part of a mesh at the vertices of the whole that were asked about."""
    count, kept = len(asked), asked[used]
    k1, k2, none = (np.full(count, np.nan) for _ in range(3))
    d1, d2 = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    where = used[kept]
    k1[where], k2[where] = one.k1[kept] / scale, one.k2[kept] / scale
    d1[where], d2[where] = one.d1[kept], one.d2[kept]
    return Curvature(k1, k2, d1, d2, none, np.isfinite(k1), remarks=one.remarks)


def _the_better(
    jets: Curvature, found: Sequence[Curvature], faces: IntArray, noise: float, reach: FloatArray
) -> Curvature:
    """The jets, with libigl's answer where its expected error is smaller, and how far the two are apart."""
    count = len(jets.k1)
    answered = np.where(jets.valid, "jet", "").astype("<U6")
    if not found:
        return replace(jets, answered_by=answered, apart=np.full(count, np.nan))
    errors = np.array([_expected(*pair, faces, noise, reach) for pair in pairwise(_sizes(found))])
    best = errors.argmin(axis=0)
    error, every = CHOICE_FACTOR * errors.min(axis=0), np.arange(count)
    k1, k2, d1, d2 = (np.array([getattr(one, name) for one in found])[best, every] for name in ("k1", "k2", "d1", "d2"))
    sd = principal_sd(0.5 * (k1 - k2), error)
    apart = np.maximum(np.abs(k1 - jets.k1), np.abs(k2 - jets.k2))
    # what the narrow fits of the jets cannot follow, libigl's rings smooth over: no better for that
    better = np.isfinite(sd) & ~(jets.sd <= sd) & ~(jets.valid & (INTERVAL * jets.sd * reach >= 1.0))
    answered[better] = "libigl"
    plain = better & ~(0.5 * (k1 - k2) > np.sqrt(0.5) * error)
    d1[plain], d2[plain] = np.nan, np.nan
    return Curvature(
        np.where(better, k1, jets.k1),
        np.where(better, k2, jets.k2),
        np.where(better[:, None], d1, jets.d1),
        np.where(better[:, None], d2, jets.d2),
        np.where(better, sd, jets.sd),
        jets.valid | better,
        answered,
        apart,
    )


def _sizes(found: Sequence[Curvature]) -> list[tuple[Curvature, int]]:
    """Each radius' curvature with the number of points of its rings on a regular mesh."""
    return [(one, 1 + 3 * radius * (radius + 1)) for one, radius in zip(found, RADII, strict=True)]


def _expected(
    own: tuple[Curvature, int], wider: tuple[Curvature, int], faces: IntArray, noise: float, reach: FloatArray
) -> FloatArray:
    """(N,) expected error (Frobenius norm) of libigl's curvature tensors over n points, judged by those over m > n.

    A quadratic fit to n points over a disc of the radius R has tensors with the root mean square error
    noise sqrt(192 / n) / R^2 (theory equation 9.5). Its bias grows as R^2, that is as n: of the fits' difference,
    n / (m - n) is the bias of the narrower one. The difference is the mean over the faces around a vertex, since at a
    single vertex both may happen to agree.
    """
    (narrow, n), (wide, m) = own, wider
    # the disc of n points in units of that of two rings
    radius2 = n / TWO_RINGS * reach**2
    variance = 192.0 / n * np.divide(noise, radius2, out=np.full(len(reach), np.inf), where=radius2 > 0) ** 2
    gap = ((_tensors(narrow) - _tensors(wide)) ** 2).sum(axis=(1, 2))
    known = np.isfinite(gap)[faces].all(axis=1)
    total, times = np.zeros(len(gap)), np.zeros(len(gap))
    for corner in range(3):
        np.add.at(total, faces[known, corner], gap[faces[known]].mean(axis=1))
        np.add.at(times, faces[known, corner], 1.0)
    mean = np.divide(total, times, out=np.full(len(gap), np.inf), where=(times > 0) & np.isfinite(gap))
    return np.asarray(np.sqrt(variance + (n / (m - n)) ** 2 * mean))


def _tensors(curvature: Curvature) -> FloatArray:
    """(N, 3, 3) curvature tensors in space: they differ without regard to which direction is the first."""
    tensors = np.zeros((len(curvature.k1), 3, 3))
    for k, d in ((curvature.k1, curvature.d1), (curvature.k2, curvature.d2)):
        tensors += k[:, None, None] * d[:, :, None] * d[:, None, :]
    return tensors


def _where_carried(curvature: Curvature, hidden: FloatArray, reach: FloatArray, remarks: tuple[str, ...]) -> Curvature:
    """The curvature where its interval is narrower than all that the sampling can carry, and NaN elsewhere."""
    # a value that the nearest points bear out by half is no blind one, however sharp
    seen = hidden < np.fmax(1.0 / np.fmax(reach, np.finfo(float).tiny), 0.5 * np.abs(curvature.largest))
    valid = curvature.valid & (INTERVAL * curvature.sd * reach < 1.0) & seen
    answered = curvature.answered_by if len(curvature.answered_by) else np.full(len(valid), "jet", dtype="<U6")
    apart = curvature.apart if len(curvature.apart) else np.full(len(valid), np.nan)
    k1, k2, sd = (np.where(valid, values, np.nan) for values in (curvature.k1, curvature.k2, curvature.sd))
    d1, d2 = (np.where(valid[:, None], values, np.nan) for values in (curvature.d1, curvature.d2))
    return Curvature(k1, k2, d1, d2, sd, valid, np.where(valid, answered, ""), apart, remarks)
