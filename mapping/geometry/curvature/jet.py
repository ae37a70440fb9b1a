"""Curvature by local jets that weigh every degree and neighbourhood by the error that the noise lets it expect."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapping import BoolArray, CurvatureError, FloatArray, IntArray, Surface
from mapping.geometry.curvature.curvature import Curvature, from_operators
from mapping.geometry.curvature.neighbours import Neighbours
from mapping.geometry.mesh import NEAREST_COST, BoxedPoints, by_shares, cores

# Neighbourhoods from which points choose. Regular grids are symmetric in 25, 37, 49, 69 and 97 neighbours, which
# cancels odd errors; 33 are the fewest that a jet of degree 6 needs with some to spare.
NEIGHBOURHOOD_SIZES = (13, 19, 25, 33, 37, 49, 69, 97, 137, 193, 274, 387, 547)
DEGREE = 6
# Sizes whose residuals tell the noise.
SMALL = (37, 49)
# So many of the nearest points, spread evenly over those up to each of the reaches, tell the bias of neighbourhoods
# from that size on. With the first reach alone 90 % intervals held 54 to 61 % of the curvatures of a paraboloid of 2500
# points (k 1/2 to a side of 2, noise 1e-3), with these 68 to 77 %.
POOL, POOL_REACHES = 15, (60, 193, 547)
BIAS_ALLOWANCE_SDS = 3.5
# Weights fall with this power of the squared error: 1 averages most, large powers choose.
WEIGHT_EXPONENT = 0.75
SAMPLE = 3000
# Ordinates are bent by what was found over planes on so many points, and then once more by what was found so on the
# sample. On spheres with noise the second time halves the errors of the bend, and with them those of the widest fits; a
# third changes nothing. With 300 and 3000 first ones medians of four cells (building seed) are within 1 % of these.
FIRST_BENDS = 1000
# Without noise a bend is as exact as the fits that it is found with: as long as the last made the stated errors smaller
# by this factor, another one follows. Noise and what no bend straightens let the second make them smaller by 4 at most.
WORTH_ANOTHER = 10.0
# Of so many the share of the weight that falls to some sizes is known to 1.6 % (of shares between 0 and 1 the standard
# deviation is half at most): a sixth of what may be lost
WEIGHED_SAMPLE = 1000
# Share of the weight that may be lost at either end.
LOST_WEIGHT_SHARE = 0.1
# Meshes above this size try only the neighbourhoods that a sample of their points chooses.
LARGE_MESH_POINTS = 20_000
# Noise over the body's size that takes no less of the digits than squares do. A fit by moments errs by rounding times
# the condition of R, 1e5 at most, in units of the heights: by 2e-5 of what this noise does.
LEAST_NOISE = 1e-6
# Neighbours held at once by one thread: 8 MB
CHUNK_VALUES = 1_000_000
SMOOTHING = 24
# Rings of faces whose area vectors tell where outside is: as many as those nearest points. With one ring 2.4 %, with
# two 0.03 % and with three none of 10,000 vertices of a torus with noise of half an edge had normals that led astray.
PATCH_RINGS = 3
# Cosine of the angle by which the normals of a side of the body turn at most. Those that are told, by the ball that
# touched, show a sharp edge: within the radius of curvature a side turns by a radian. Those of noisy triangles may not.
TOLD_SIDE, GUESSED_SIDE = float(np.cos(1.0)), 0.0
# Share of the residual that counts as noise even where all of it seems to be the polynomial's misfit.
NOISE_FLOOR = 1e-3
# Of the reaches the one over which the squared bias of the means is pooled. Over the first, 90 % intervals held 79 to
# 83 % of the curvatures of a paraboloid of 2500 points (as above), over this one 87 to 92 %.
ERROR_POOL = 1
# Least share of the next size's residual that a jet with hardly more points than terms is credited with.
LUCK = 1.0


def jets_and_noise(
    body: Surface | FloatArray,
    normals: FloatArray | None,
    noise: float | None = None,
    neighbours: int | None = None,
    degree: int = DEGREE,
) -> tuple[Curvature, float]:
    """Curvature and noise (sd, m), from polynomials of degree 2, 4 and 6 over neighbourhoods of 13 to 547 points.

    Each candidate's variance follows from the noise, its bias from how much it disagrees around the point with
    narrower and higher ones; the weights of the mean fall with a power of their sum. Ordinates are bent by the larger
    curvature, found on a sample beforehand, so that wide neighbourhoods of tubes and balls are as good as flat ones.

    Args:
        body: mesh or points (N, 3), m.
        normals: (N, 3) outward normals, or None. Neighbours whose normals turn by more than a radian, a right angle
            if none are given, lie on another side of the body, round a sharp edge or behind a thin wall.
        noise: standard deviation of the points along the normal, m, or None: estimated.
        neighbours: use this neighbourhood and `degree` alone instead of choosing.
        degree: 2, 4 or 6; the highest to choose from.

    Raises:
        CurvatureError: an odd degree, one beyond 6, or fewer neighbours than the degree needs.
    """
    _check(neighbours, degree)
    points, rough, used = oriented(body, normals)
    index = np.flatnonzero(used)
    if len(index) < 8:
        return _nothing(len(points)), noise or 0.0
    place = points[index] - points[index].mean(axis=0)
    size = float(np.abs(place).max()) or 1.0
    jets = _Jets(place / size, rough[index], degree, least_alike(normals))
    sizes = np.array(
        [s for s in NEIGHBOURHOOD_SIZES if s <= max(len(index), NEIGHBOURHOOD_SIZES[0])]
        if neighbours is None
        else [neighbours]
    )
    known = None if noise is None else noise / size
    level = jets.noise() if known is None else known
    if neighbours is None:
        level = jets.bend_all(sizes, level, known)
    if len(index) > LARGE_MESH_POINTS:
        sizes = jets.worthwhile(sizes, level)
    operators, slopes, error = jets.weighed(sizes, level, fixed=neighbours is not None)
    return _spread(len(points), index, operators / size, jets.bases(slopes), error / size), level * size


def _check(neighbours: int | None, degree: int) -> None:
    if degree not in (2, 4, 6):
        raise CurvatureError(f"jets have degree 2, 4 or 6; found {degree}")
    least = (degree + 1) * (degree + 2) // 2 + (2 if degree == 2 else 4)
    if neighbours is not None and neighbours < least:
        raise CurvatureError(f"a jet of degree {degree} needs at least {least} neighbours; found {neighbours}")


def _nothing(count: int) -> Curvature:
    return _spread(count, np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 2, 3)), np.zeros(0))


def _spread(count: int, index: IntArray, operators: FloatArray, bases: FloatArray, error: FloatArray) -> Curvature:
    """Curvature at all points from that of the indexed ones."""
    every, frames, spread = np.full((count, 3), np.nan), np.full((count, 2, 3), np.nan), np.full(count, np.nan)
    every[index], frames[index], spread[index] = operators, bases, error
    return from_operators(every, frames, spread, np.isfinite(every).all(axis=1))


@dataclass(eq=False)
class _Candidates:
    """Fits of `fit_jets` for M points, S sizes and D degrees."""

    operators: FloatArray
    factors: FloatArray
    rests: FloatArray
    slopes: FloatArray

    def deviations(self, noise: float) -> FloatArray:
        """(M, S, D) standard deviations by the noise; the highest degree of a size is trusted no better than what it
        leaves over, unless the highest of all is known one size wider: that judges it."""
        level = np.full(self.factors.shape, noise)
        known = np.isfinite(self.factors)
        judged = np.concatenate([known[:, 1:, -1], known[:, -1:, -1]], axis=1)
        judged[:, -1] = False
        for degree in range(known.shape[-1]):
            rests = self.rests[..., degree]
            # with few points to spare a small residual may be luck: that of the next size tells
            bound = LUCK * np.concatenate([rests[:, 1:], rests[:, -1:]], axis=1)
            highest = known[..., degree] & ~known[..., degree + 1 :].any(axis=2)
            if degree < known.shape[-1] - 1:
                highest &= ~judged
            level[..., degree] = np.where(highest, np.fmax(noise, np.fmax(rests, bound)), noise)
        return self._times(level)

    def part(self, chosen: slice) -> _Candidates:
        """The candidates of a run of points."""
        return _Candidates(self.operators[chosen], self.factors[chosen], self.rests[chosen], self.slopes[chosen])

    def misfits(self, noise: float) -> FloatArray:
        """(M, S, D) standard deviations if all that a fit leaves over were noise."""
        return self._times(np.fmax(noise, self.rests))

    def _times(self, level: FloatArray) -> FloatArray:
        known = np.isfinite(self.factors) & np.isfinite(level)
        return np.asarray(np.multiply(level, self.factors, where=known, out=np.full(level.shape, np.inf)))


class _Jets:
    """Points (N, 3) of about unit size with their neighbourhoods and mean normals; those of a side are `alike`."""

    def __init__(self, place: FloatArray, rough: FloatArray, degree: int, alike: float):
        self.place, self.degree, self.alike = place, degree, alike
        self.tree = Neighbours(place)
        self.normals = _smoothed_normals(place, rough, self.tree, alike)
        self.bends = np.zeros(len(place))

    def fit(self, chosen: IntArray, sizes: IntArray, noise: float, near: IntArray | None = None) -> _Candidates:
        """Every candidate at the chosen points, in no more digits than the noise (0: unknown) leaves; `near` as of the
        method, if it is known."""
        from mapping.geometry.curvature.jet_kernels import fit_jets

        near = self.near(chosen, int(sizes[-1])) if near is None else near
        bends, noisy = self.bends[chosen], noise > LEAST_NOISE
        return _Candidates(
            *fit_jets(self.place, self.normals, near, chosen, bends, self.alike, sizes, self.degree, noisy)
        )

    def near(self, chosen: IntArray, count: int) -> IntArray:
        """(M, count) nearest points, nearest first; N where there are no more."""
        return self.tree.query(self.place[chosen], count)

    def sample(self, count: int = SAMPLE) -> IntArray:
        """Indices of points that speak for all."""
        return np.linspace(0, len(self.place) - 1, min(count, len(self.place))).astype(np.int64)

    def noise(self) -> float:
        """Noise level from residuals of the highest fits over two small neighbourhoods.

        Noise leaves the same residual in both; what the polynomial cannot follow grows with the power of the radius
        that is one above its degree. The median ignores the few points where the surface is not smooth.
        """
        rests = self.fit(self.sample(), np.array(SMALL), 0.0).rests[..., -1]
        rests = rests[np.isfinite(rests).all(axis=1)]
        if len(rests) == 0:
            return 0.0
        free = np.array(SMALL) - (self.degree + 1) * (self.degree + 2) // 2
        # median of chi-square over its degrees of freedom (Wilson and Hilferty)
        first, second = np.median(rests, axis=0) ** 2 / (1 - 2 / (9 * free)) ** 3
        growth = (SMALL[1] / SMALL[0]) ** (self.degree + 1)
        return float(np.sqrt(max((growth * first - second) / (growth - 1), NOISE_FLOOR**2 * first)))

    def bend_all(self, sizes: IntArray, level: float, known: float | None) -> float:
        """Bend all ordinates until that helps no more; the noise, told anew each time unless it is known."""
        told = self.bend(sizes, level, FIRST_BENDS)
        while True:
            # over a plane what is steep in a thin neighbourhood looks like noise
            level = self.noise() if known is None else known
            before, told = told, self.bend(sizes, level, SAMPLE)
            if not WORTH_ANOTHER * told < before:
                return self.noise() if known is None else known

    def bend(self, sizes: IntArray, noise: float, count: int) -> float:
        """Bend all ordinates by the larger curvature at the nearest point of a sample, found with the present bend.

        Returns:
            median of the stated errors of what they are bent by, 0 if there is none.
        """
        from scipy.spatial import cKDTree

        sample = self.sample(count)
        found, tree = self.fit(sample, sizes, noise), cKDTree(self.place[sample])
        pools = tree.query(self.place[sample], k=min(POOL, len(sample)))[1].reshape(len(sample), 1, -1)
        every, own = np.arange(len(sample)), found.deviations(noise)
        weights = self._weights(found, own, every, pools, sizes)
        error = np.sqrt(_judged(weights, found, noise, sizes)[:, 0])
        a, b, c = np.einsum("msd,msdk->km", weights, np.nan_to_num(found.operators))
        # noise drives the two curvatures apart, and the larger of them too far: ordinates that are bent more than the
        # surface bias the widest fits. What it adds to half2 is exponential with the mean error^2 / 4, and beyond three
        # of these in 5 % alone
        mean, half2 = 0.5 * (a + c), 0.25 * (a - c) ** 2 + b**2
        half = np.sqrt(np.maximum(half2 - 0.75 * error**2, 0.0))
        larger = np.nan_to_num(np.where(mean < 0, mean - half, mean + half))
        # on a sphere z + k z^2 / (2 cos t) is quadratic where the axis of z leans from the normal by t
        larger *= np.sqrt(1.0 + (np.einsum("msd,msdk->km", np.nan_to_num(weights), found.slopes) ** 2).sum(axis=0))
        boxed = BoxedPoints(self.place[sample])
        self.bends = larger[by_shares(lambda place: boxed.nearest(place)[1], self.place, NEAREST_COST)]
        known = np.isfinite(error)
        return float(np.median(error[known])) if known.any() else 0.0

    def worthwhile(self, sizes: IntArray, noise: float) -> IntArray:
        """The sizes that points of a sample give most weight to, with those that judge them."""
        sample = self.sample(WEIGHED_SAMPLE)
        found = self.fit(sample, sizes, noise)
        own, all_of_it = found.deviations(noise), np.arange(len(sample))
        weights = self._weights(found, own, all_of_it, all_of_it[:, None, None], sizes).sum(axis=2)
        reach = np.cumsum(weights[np.isfinite(weights).all(axis=1)].mean(axis=0))
        last = min(int(np.searchsorted(reach, 1 - LOST_WEIGHT_SHARE)), len(sizes) - 1)
        first = min(max(int(np.searchsorted(reach, LOST_WEIGHT_SHARE)) - 2, 0), last)
        return sizes[first : last + 1]

    def weighed(self, sizes: IntArray, noise: float, fixed: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(N, 3) operators, (N, 2) slopes and (N,) errors (Frobenius) of the weighed mean at every point."""
        count = len(self.place)
        shape = (count, len(sizes), self.degree // 2)
        every = _Candidates(np.empty((*shape, 3)), np.empty(shape), np.empty(shape), np.empty((*shape, 2)))
        pools = np.empty((count, len(POOL_REACHES), POOL), dtype=np.int64)
        parts = np.array_split(np.arange(count), max(4, count * int(sizes[-1]) // CHUNK_VALUES))

        def fill(part: IntArray) -> None:
            near = self.near(part, max(int(sizes[-1]), POOL_REACHES[0]))
            found = self.fit(part, sizes, noise, near)
            every.operators[part], every.factors[part] = found.operators, found.factors
            every.rests[part], every.slopes[part] = found.rests, found.slopes
            for k, reach in enumerate(POOL_REACHES):
                spread = np.arange(POOL) * min(reach, near.shape[1]) // POOL
                pools[part, k] = np.minimum(near[:, spread], count - 1)

        def mean(part: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            fits = every.part(slice(part[0], part[-1] + 1))  # not copied
            weights = self._weights(every, own, part, pools[part], sizes)
            return (
                np.einsum("msd,msdk->mk", weights, np.nan_to_num(fits.operators)),
                np.einsum("msd,msdk->mk", weights, fits.slopes),
                _judged(weights, fits, noise, sizes),
            )

        _in_threads(fill, parts)
        if fixed:
            return every.operators[:, 0, -1], every.slopes[:, 0, -1], every.misfits(noise)[:, 0, -1]
        own = every.deviations(noise)
        results = _in_threads(mean, parts)
        operators, slopes, judged = (np.concatenate(values) for values in zip(*results, strict=True))
        return operators, slopes, _errors(judged, pools[:, ERROR_POOL])

    def _weights(
        self, every: _Candidates, own: FloatArray, part: IntArray, pools: IntArray, sizes: IntArray
    ) -> FloatArray:
        """(M, S, D) weights, NaN where no candidate has a value."""
        from mapping.geometry.curvature.jet_kernels import pooled_bias

        bias = np.empty((len(part), *own.shape[1:]))
        reaches = np.array(POOL_REACHES[: pools.shape[1]])
        pooled_bias(every.operators, own, pools, reaches, sizes, BIAS_ALLOWANCE_SDS, bias)
        # where all agree to rounding, none is better than another
        trust = np.maximum(own[part] ** 2 + bias, np.finfo(float).tiny ** 0.25) ** -WEIGHT_EXPONENT
        total = trust.sum(axis=(1, 2))
        return np.asarray(trust / np.where(total > 0, total, np.nan)[:, None, None])

    def bases(self, slopes: FloatArray) -> FloatArray:
        """(N, 2, 3) orthonormal bases of the tangent planes with the given slopes in the normals' frames."""
        n = self.normals
        axis = np.eye(3)[np.abs(n).argmin(axis=1)]
        e1 = axis - (axis * n).sum(axis=1, keepdims=True) * n
        e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
        e2 = np.cross(n, e1)
        t1, t2 = e1 + slopes[:, :1] * n, e2 + slopes[:, 1:] * n
        t1 /= np.linalg.norm(t1, axis=1, keepdims=True)
        t2 -= (t2 * t1).sum(axis=1, keepdims=True) * t1
        return np.stack([t1, t2 / np.linalg.norm(t2, axis=1, keepdims=True)], axis=1)


def _judged(weights: FloatArray, fits: _Candidates, noise: float, sizes: IntArray) -> FloatArray:
    """(M, 3) of `judged_means`, NaN where there is no mean."""
    from mapping.geometry.curvature.jet_kernels import judged_means

    out = np.empty((len(weights), 3))
    judged_means(np.nan_to_num(weights), fits.operators, fits.factors, fits.rests, noise, sizes, out)
    out[np.isnan(weights).any(axis=(1, 2))] = np.nan
    return out


def _errors(judged: FloatArray, pools: IntArray) -> FloatArray:
    """(N,) errors of the means, of which `judged` (N, 3) is known, by the points (N, P) around each.

    The bias of a mean is no more than one number at a place: its square is known from many. It grows with what the fits
    leave over, and is pooled in proportion to that.
    """
    noise, excess, scale = judged.T
    ratio = np.divide(excess, scale, out=np.full(len(scale), np.nan), where=scale > 0)[pools]
    known = np.isfinite(ratio)
    mean = np.where(known, ratio, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    return np.asarray(np.sqrt(noise + np.maximum(mean, 0.0) * scale))


def _in_threads(work: Callable[[IntArray], Any], parts: list[IntArray]) -> list[Any]:
    with ThreadPoolExecutor(cores()) as threads:
        return list(threads.map(work, parts))


def oriented(body: Surface | FloatArray, normals: FloatArray | None) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Points, outward normals, and which points belong to a body at all."""
    if isinstance(body, Surface):
        points = body.vertices
        rough = _patch_normals(body) if normals is None else normals
    else:
        points = body
        rough = points - points.mean(axis=0) if normals is None else normals
    length = np.linalg.norm(rough, axis=1)
    used = length > 0
    return points, np.divide(rough, length[:, None], out=np.zeros_like(rough), where=used[:, None]), used


def _patch_normals(surface: Surface) -> FloatArray:
    """(N, 3) outward area vectors of the patches of three rings around the vertices, weighted less towards their rims.

    The area vector of a patch is that of its rim (Stokes): noise of the vertices within cancels. The faces around one
    vertex alone point inward at one vertex of a hundred already where the noise is half an edge long.
    """
    from scipy.sparse import csr_array

    count = len(surface.faces)
    faces_around = csr_array(
        (np.ones(3 * count), (surface.faces.ravel(), np.repeat(np.arange(count), 3))),
        shape=(len(surface.vertices), count),
    )
    total = faces_around @ (surface.face_normals * surface.face_areas[:, None])
    for _ in range(PATCH_RINGS - 1):
        total = faces_around @ (faces_around.T @ total)
    return np.asarray(total)


def least_alike(normals: FloatArray | None) -> float:
    """Cosine of the angle by which the normals (N, 3) of one side of the body turn at most."""
    return GUESSED_SIDE if normals is None else TOLD_SIDE


def _smoothed_normals(place: FloatArray, rough: FloatArray, tree: Neighbours, alike: float) -> FloatArray:
    """Mean normals over the nearest points of the same side: noise tilts single triangles."""
    smooth = np.empty_like(rough)
    for part in np.array_split(np.arange(len(place)), max(1, len(place) * SMOOTHING // CHUNK_VALUES)):
        near = by_shares(lambda at: tree.query(at, min(SMOOTHING, len(place))), place[part], SMOOTHING)
        same = np.einsum("ijk,ik->ij", rough[near], rough[part]) > alike
        smooth[part] = np.einsum("ijk,ij->ik", rough[near], same.astype(np.float64))
    length = np.linalg.norm(smooth, axis=1, keepdims=True)
    return np.where(length > 0, smooth / np.where(length > 0, length, 1.0), rough)
