"""Facets: a mesh whose flat triangles stand for something round, made as round as what was felt says.

A drawing of a shaft comes as a mesh of flats whose corners lie on the shaft. Between them a ball that runs round it is
off the mesh by up to R (1 - cos(pi / n)), 24 um of 20 mm in 64 flats, and every flat would be a ridge. A cast prism has
the same mesh. Which of both it is what was felt decides, for each patch of the mesh on its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Surface, Trace
from mapping.base import Base, LaidTrace
from mapping.estimate.deviation.evidence import LEAST_GAIN, ROUNDING
from mapping.estimate.deviation.reshaped import MOST_REFINED_FACES
from mapping.geometry.mesh import CREASE_ANGLE, side_bulges, unit_vectors
from mapping.instrument import FEATURE_RESIDUAL_SDS, robust_sd

# Samples that are asked, from the middles of the sweeps, and the fewest of each: as many as tell the noise, which are
# laid on the base anyway
MOST_ASKED, FEWEST_ASKED = 40_000, 64
# Neighbours belong to one patch if neither bulges more than so many times as the other would. On balls, cylinders and
# tori as drawings have them all neighbours are within 1.2, on three scanned or cast bodies 95 % within 2 to 4; a flat
# of 40 mm beside a fillet of 2 to 20 mm in 4 to 16 facets, whose corners' normals lean to both, would bulge 2.6 to 100
# times as much as these. What hangs together wrongly is judged together
ALIKE_BULGES = 3.0
# Heights over flats, and over what is round, are alike where the largest bulge is less than this share of their
# scatter, to which it adds half a per cent
NOT_SEEN = 0.1
# Blocks of samples to a facet: a bulge is told by its rise and its fall
BLOCKS_PER_FACET = 4
# A finer mesh is left as flat as this share of the scatter, to which that adds half a per cent, and of the bulge where
# nothing scatters
LEFT_FLAT, LEFT_OF_BULGE = 0.1, 1e-4

# Places on a side of a facet have a coordinate below this
OVER_A_SIDE = 1e-9


@dataclass(frozen=True, eq=False)
class RoundedOut:
    """A base whose facets stood for something round.

    Args:
        base: the base with finer facets, which lie on it.
        bulge: the largest height of the body over a facet of the mesh before, m.
        gain: logarithm of how much more probable the heights are.
    """

    base: Base
    bulge: float
    gain: float


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles with the normals of the body at their corners.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3).
        normals: (F, 3, 3) of the body at each corner.
        origin: (F,) face of the mesh that each is a piece of.
    """

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray
    origin: IntArray

    @classmethod
    def of(cls, base: Base, face: IntArray) -> Facets:
        """Some faces of a mesh (F,)."""
        return cls(base.surface.vertices, base.surface.faces[face], base.nearest.corner_normals(face), face)

    def bulges(self) -> FloatArray:
        """(F, 3) height of the body over the middle of the side from each corner to the next, m; negative: below."""
        return side_bulges(self.vertices[self.faces], self.normals)

    def distance(self, centers: FloatArray, face: IntArray, feet: FloatArray) -> FloatArray:
        """(N,) signed distance of places from the body over the facets that they are nearest to, m.

        Over a facet the body is a quadratic, B = sum of 4 b_i b_j bulge_ij for coordinates b, and so beyond its sides:
        its foot is one Newton step of the squared distance away from the facet's. Over a side the direction to a place
        leans from the body's normal no more than the facets there do, unless it is an edge of the body: there it stays.

        Args:
            centers: (N, 3) m.
            face: (N,) nearest facet of each.
            feet: (N, 3) coordinates of its place there.
        """
        corners, normals = self.vertices[self.faces[face]], self.normals[face]
        bulge = side_bulges(corners, normals)
        one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        flat = unit_vectors(np.cross(one, other))
        up = centers - np.einsum("nc,ncx->nx", feet, corners)
        height = np.einsum("nx,nx->n", up, flat)
        left = height - _over(feet, bulge)
        slope = 4.0 * (feet[:, [1, 2, 0]] * bulge + (feet * bulge)[:, [2, 0, 1]])  # of B, by each coordinate
        steep = slope[:, 1:] - slope[:, :1]
        sides = np.stack([one, other], axis=1)
        downhill = np.einsum("nkx,nx->nk", sides, up - height[:, None] * flat) + left[:, None] * steep
        first, second, third = bulge.T
        bend = np.array([[-2.0 * first, second - first - third], [second - first - third, -2.0 * third]])
        curved = np.einsum("nkx,nlx->nkl", sides, sides) + steep[:, :, None] * steep[:, None]
        curved -= 4.0 * left[:, None, None] * bend.transpose(2, 0, 1)
        (a, b), d = curved[:, 0].T, curved[:, 1, 1]
        determinant = a * d - b * b
        safe = np.where(determinant > 0.0, determinant, np.inf)
        step = np.stack([d * downhill[:, 0] - b * downhill[:, 1], a * downhill[:, 1] - b * downhill[:, 0]]) / safe
        step = np.column_stack([-step[0] - step[1], step[0], step[1]])
        smooth = unit_vectors(np.einsum("nc,ncx->nx", feet, normals))
        # 1 - cos, which goes with the square of what they lean
        leans, own = (1.0 - np.abs(np.einsum("nx,nx->n", smooth, each)) for each in (unit_vectors(up), flat))
        stays = (feet.min(axis=1) <= OVER_A_SIDE) & (leans > ALIKE_BULGES**2 * own)
        # where the body is as hollow as the ball is round, its foot may be anywhere
        stays |= (np.abs(step) > 1.0).any(axis=1)
        there = feet + np.where(stays[:, None], 0.0, step)
        smooth = unit_vectors(np.einsum("nc,ncx->nx", there, normals))
        on_body = np.einsum("nc,ncx->nx", there, corners) + _over(there, bulge)[:, None] * smooth
        return np.asarray(np.where(left < 0.0, -1.0, 1.0) * np.linalg.norm(centers - on_body, axis=1))

    def halved(self, bulges: FloatArray, tolerance: float) -> Facets | None:
        """Each side that the body stands off by more than a tolerance (m) cut in two at the body; None if none does.

        A side is cut alike for both of its faces, where the one that bulges more says: no gap opens.
        """
        ahead = [1, 2, 0]
        sides = np.sort(np.stack([self.faces, self.faces[:, ahead]], axis=2), axis=2).reshape(-1, 2)
        _, first, number = np.unique(
            sides[:, 0] * len(self.vertices) + sides[:, 1], return_index=True, return_inverse=True
        )
        flat = np.abs(bulges).ravel()
        order = np.lexsort((-flat, number))
        teller = order[np.searchsorted(number[order], np.arange(len(first)))]  # the side that bulges most
        cut = flat[teller] > tolerance
        if not cut.any():
            return None
        face, corner = np.divmod(teller[cut], 3)
        following = (corner + 1) % 3
        between = unit_vectors(self.normals[face, corner] + self.normals[face, following])
        middle = 0.5 * (self.vertices[self.faces[face, corner]] + self.vertices[self.faces[face, following]])
        vertices = np.concatenate([self.vertices, middle + bulges[face, corner][:, None] * between])
        new = np.full(len(first), -1)
        new[cut] = len(self.vertices) + np.arange(int(cut.sum()))
        amid = new[number].reshape(-1, 3)
        return self._pieces(vertices, amid)

    def _pieces(self, vertices: FloatArray, amid: IntArray) -> Facets:
        """The faces cut at the new vertices amid their sides (F, 3), -1 where there is none."""
        count = (amid >= 0).sum(axis=1)
        # turned so that of one cut side it is the first, and of two the first two
        turn = np.where(count == 1, (amid >= 0).argmax(axis=1), np.where(count == 2, (amid < 0).argmax(axis=1) + 1, 0))
        index = (np.arange(3) + turn[:, None]) % 3
        rows = np.arange(len(amid))[:, None]
        corners, cuts, normals = self.faces[rows, index], amid[rows, index], self.normals[rows, index]
        told = np.concatenate([normals, unit_vectors(normals + normals[:, [1, 2, 0]])], axis=1)
        names = np.concatenate([corners, cuts], axis=1)
        # corners a, b, c are 0, 1, 2; the middles of ab, bc, ca are 3, 4, 5
        patterns = {
            0: [(0, 1, 2)],
            1: [(0, 3, 2), (3, 1, 2)],
            2: [(3, 1, 4), (0, 3, 4), (0, 4, 2)],
            3: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
        }
        faces, kept, origin = [], [], []
        for cuts_of, pieces in patterns.items():
            own = count == cuts_of
            for piece in pieces:
                faces.append(names[own][:, piece])
                kept.append(told[own][:, piece])
                origin.append(self.origin[own])
        return Facets(vertices, np.concatenate(faces), np.concatenate(kept), np.concatenate(origin))

    def rounded(self, round_: BoolArray, tolerance: float) -> Facets:
        """With the pieces of the mesh's faces that are round (F,) cut until they lie on the body to a tolerance, m."""
        now = self
        while len(now.faces) <= MOST_REFINED_FACES // 4:
            bulges = np.where(round_[now.origin][:, None], now.bulges(), 0.0)
            finer = now.halved(bulges, tolerance)
            if finer is None:
                break
            now = finer
        return now


def round_out(trace: Trace, base: Base) -> RoundedOut | None:
    """The base as round as what was felt says that its facets are meant; None if they are flats, or nobody can tell.

    Args:
        trace: sweeps over the body; a LaidTrace on `base` spares laying it down again.
        base: a mesh.
    """
    heights = _Heights.of(LaidTrace.of(trace, base))
    felt = np.unique(heights.face)
    if not len(felt):
        return None
    scatter = heights.scatter(heights.height, trace.tip_radius)
    if np.abs(Facets.of(base, felt).bulges()).max() < NOT_SEEN * scatter:
        return None
    patch, facets = _patches(base.surface, Facets.of(base, np.arange(len(base.surface.faces))))
    most = np.abs(facets.bulges()).max(axis=1)
    over = heights.over(facets, trace.tip_radius, base.offset)
    scatter = min(scatter, heights.scatter(over, trace.tip_radius))
    gains = heights.gains(over, scatter, patch)
    told = np.array([number for number, gain in gains.items() if gain > LEAST_GAIN], dtype=np.int64)
    if not len(told):
        return None
    chosen = np.isin(patch, told)
    bulge = float(most[felt][chosen[felt]].max())
    rounded = facets.rounded(chosen, max(LEFT_FLAT * scatter, LEFT_OF_BULGE * bulge))
    finer = replace(base, surface=Surface(rounded.vertices, rounded.faces))
    return RoundedOut(finer, bulge, float(sum(gains[int(number)] for number in told)))


@dataclass(frozen=True, eq=False)
class _Heights:
    """Mean heights of some samples over the mesh in blocks of a quarter of a facet.

    Args:
        centers: (N, 3) of the samples, m.
        under: (N,) face of the mesh under each.
        barycentric: (N, 3) where on that.
        size: samples in a block.
        height: (B,) m.
        face: (B,) of the mesh under their middles.
        follows: (B - 1,) True where the next block is of the same sweep.
    """

    centers: FloatArray
    under: IntArray
    barycentric: FloatArray
    size: int
    height: FloatArray
    face: IntArray
    follows: BoolArray

    @classmethod
    def of(cls, laid: LaidTrace) -> _Heights:
        share = max(FEWEST_ASKED, MOST_ASKED // max(len(laid.laid_sweeps), 1))
        begins = [max(0, len(sweep.trace) - share) // 2 for sweep in laid.laid_sweeps]
        parts = [slice(begin, begin + share) for begin in begins]
        feet = [sweep.feet(part) for sweep, part in zip(laid.laid_sweeps, parts, strict=True)]
        changes = sum(int((np.diff(one.face) != 0).sum()) + 1 for one in feet)
        size = max(1, sum(len(one.face) for one in feet) // (BLOCKS_PER_FACET * max(changes, 1)))
        whole = [len(one.face) // size * size for one in feet]
        height = [one.height[:n].reshape(-1, size).mean(axis=1) for one, n in zip(feet, whole, strict=True)]
        face = [one.face[:n].reshape(-1, size)[:, size // 2] for one, n in zip(feet, whole, strict=True)]
        number = np.repeat(np.arange(len(feet)), [len(each) for each in height])
        each = zip(laid.laid_sweeps, parts, whole, strict=True)
        centers = [sweep.trace.centers[part][:n] for sweep, part, n in each]
        under, barycentric = (
            np.concatenate([getattr(one, name)[:n] for one, n in zip(feet, whole, strict=True)])
            for name in ("face", "barycentric")
        )
        return cls(
            np.concatenate(centers),
            under,
            barycentric,
            size,
            np.concatenate(height),
            np.concatenate(face),
            np.diff(number) == 0,
        )

    def over(self, facets: Facets, tip_radius: float, offset: float) -> FloatArray:
        """(B,) over the body that the facets stand for, m.

        Args:
            offset: of the base, m.
        """
        distance = facets.distance(self.centers, self.under, self.barycentric)
        return np.asarray((distance - tip_radius - offset).reshape(-1, self.size).mean(axis=1))

    def scatter(self, height: FloatArray, tip_radius: float) -> float:
        """Of the differences of neighbouring blocks' heights (B,), m."""
        steps = np.diff(height)[self.follows]
        return max(robust_sd(steps) if len(steps) else 0.0, ROUNDING * tip_radius)

    def gains(self, over: FloatArray, scatter: float, patch: IntArray) -> dict[int, float]:
        """For each patch that was felt by how much more probable heights over it (B,) are than those over the mesh.

        Of the differences of neighbouring blocks, which no offset, pose or slow bend changes; each block is in two of
        them, so they count half. What stands on the body counts no more than FEATURE_RESIDUAL_SDS.
        """
        own = patch[self.face]
        same = self.follows & (own[1:] == own[:-1])
        flat, round_ = (np.minimum((np.diff(h) / scatter) ** 2, FEATURE_RESIDUAL_SDS**2) for h in (self.height, over))
        gain = 0.25 * np.where(same, flat - round_, 0.0)
        numbers, index = np.unique(own[:-1], return_inverse=True)
        return dict(zip(numbers.tolist(), np.bincount(index, gain).tolist(), strict=True))


def _over(places: FloatArray, bulges: FloatArray) -> FloatArray:
    """(N,) height of a body over facets at coordinates (N, 3), m, by its bulges over their sides (N, 3)."""
    return 4.0 * np.asarray(np.einsum("nc,nc,nc->n", places, places[:, [1, 2, 0]], bulges))


def _patches(surface: Surface, facets: Facets) -> tuple[IntArray, Facets]:
    """(F,) number of the patch of each face, and the facets with the normals that the body has at the patches' borders.

    Neighbours belong together that bulge alike without a crease between them. At a border the mean of the faces leans
    to the flat on its other side; the body's normal leans from a facet's as far there as at the facet's other corners,
    to the other side.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, other = surface.neighbours
    flat, bulge = surface.face_normals, np.abs(facets.bulges()).max(axis=1)
    smooth = np.einsum("ij,ij->i", flat[one], flat[other]) > np.cos(CREASE_ANGLE)
    one, other = one[smooth], other[smooth]
    alike = np.maximum(bulge[one], bulge[other]) <= ALIKE_BULGES * np.minimum(bulge[one], bulge[other])
    graph = coo_array((np.ones(int(alike.sum())), (one[alike], other[alike])), shape=(len(bulge), len(bulge)))
    patch = np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
    parted = patch[one] != patch[other]
    border = np.zeros(len(surface.vertices), dtype=bool)
    for a in surface.faces[one[parted]].T:
        border[a[(surface.faces[other[parted]] == a[:, None]).any(axis=1)]] = True
    at_border = border[surface.faces]
    own = np.where(at_border[:, :, None], 0.0, facets.normals).sum(axis=1)
    across = 2.0 * np.einsum("ij,ij->i", flat, own)[:, None] * flat - own
    turned = at_border & ~at_border.all(axis=1, keepdims=True)
    normals = np.where(turned[:, :, None], unit_vectors(across)[:, None], facets.normals)
    return patch, replace(facets, normals=normals)
