"""ProxyBody: a base with its fine features' closed forms, laid out for the proxy's kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapping import BoolArray, ContactError, FloatArray, IntArray, Surface
from mapping.geometry.mesh import NearestPoint, TriangleTree, arclengths, distances
from mapping.geometry.proxy.draping import (
    bar_mesh,
    followed,
    is_closed,
    joined,
    meridian,
    rim_arcs,
    swell_mesh,
    terrace_mesh,
    trench_meshes,
)
from mapping.geometry.proxy.parts import Bar, Bell, Chain, Part, Swell, Terrace, Trench

# Legs of a chain, and rings of a bell, that share a bounding sphere
LEGS_PER_GROUP = 16
# A low cap is part of a large sphere, which on a bent base comes out again elsewhere: it is there up to this many
# half-widths of its own chord, as in `mapping.inference.kinds`
CAP_REACH = 1.5
# A ridge ends where its crest does. Whether it is cut square there (0) or goes on as a half ball (1) a finger often
# cannot tell, and the model's length is the middle of both: so is what is displayed, rounded by half the section's
# radius. Half balls are as square ends 0.05 mm further out (the paper's wire), so displayed ones were found half of
# that too far out: wires 0.05 mm too long (four of them: 0.07 mm)
END_ROUNDING = 0.5
# In place of its depth: a triangle that no trench cuts open
NEVER_OPEN = np.inf


class ProxyBody:
    """What a proxy touches: the union of a base and of what stands on it, without what is cut out of it.

    Args:
        base: the mesh.
        parts: the features.
        radius: of the ball that will touch it, m.

    Raises:
        ContactError: sizes that are not positive and finite, axes of the wrong shape.
    """

    def __init__(self, base: Surface, parts: Sequence[Part], radius: float) -> None:
        if not (np.isfinite(radius) and radius > 0):
            raise ContactError(f"the proxy's radius must be a positive length in metres; found {radius!r}")
        for part in parts:
            _check(part)
        self.base, self.radius = NearestPoint(base), float(radius)
        # the legs of an axis cut corners on a bent base: it is the base that the feature lies on
        parts = [each if isinstance(each, Bell) else self._laid(each) for each in parts]
        self.parts = tuple(parts)
        trenches = [part for part in parts if isinstance(part, Trench)]
        meshes = [(base.vertices, base.faces)]
        depths = [np.where(_touched(*meshes[0], trenches), 0.0, NEVER_OPEN)]
        for trench in trenches:
            others = [each for each in trenches if each is not trench]
            floor, walls = trench_meshes(trench, self.base, others)
            deeper = _touched(*floor, [each for each in others if each.depth > trench.depth])
            meshes += [floor, walls]
            depths += [np.where(deeper, trench.depth, NEVER_OPEN), np.full(len(walls[1]), NEVER_OPEN)]
        meshes += [bar_mesh(each, self.base) for each in parts if isinstance(each, Bar)]
        meshes += [swell_mesh(each, self.base) for each in parts if isinstance(each, Swell)]
        meshes += [terrace_mesh(each, self.base) for each in parts if isinstance(each, Terrace)]
        whole = joined(meshes)
        self._tree = TriangleTree(Surface(*whole), 2.0 * radius)
        depth = np.full(len(whole[1]), NEVER_OPEN)
        depth[: sum(map(len, depths))] = self.scale * np.concatenate(depths)
        rounds, groups = self._rounds(parts)
        legs, hulls = self._legs(trenches)
        tree = self._tree
        self.arrays: tuple[Any, ...] = (
            tree.rows, tree.leaves, tree.boxes, tree.links, np.ascontiguousarray(depth[tree.order]),
            rounds, groups, legs, hulls,
        )  # fmt: skip

    @property
    def top(self) -> float:
        """Height of the highest part over the base, m."""
        return max((part.height for part in self.parts if not isinstance(part, Trench)), default=0.0)

    @property
    def bottom(self) -> float:
        """Depth of the deepest part below the base, m."""
        return max((part.depth for part in self.parts if isinstance(part, Trench)), default=0.0)

    @property
    def scale(self) -> float:
        """Length of one metre in the frame of the kernels."""
        return float(self._tree.scale_in(1.0))

    def into(self, points: FloatArray) -> FloatArray:
        """Points (N, 3), m, in the frame of the kernels."""
        return self._tree.into(points)

    def out(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) of the frame of the kernels, m."""
        return self._tree.out(points)

    def gaps(self, centers: FloatArray, reach: float) -> FloatArray:
        """(N,) gap between balls at centres (N, 3), m, and the body, m; `reach` where it is larger."""
        from mapping.geometry.proxy import proxy_kernels

        out = np.empty(len(centers))
        scale = self.scale
        proxy_kernels.least_gaps(self.arrays, scale * self.radius, self.into(centers), scale * reach, out)
        return out / scale

    def _laid(self, part: Chain | Bar | Swell | Trench | Terrace) -> Chain | Bar | Swell | Trench | Terrace:
        axis, normals = followed(part.axis, part.normals, self.base)
        return replace(part, axis=axis, normals=normals)

    def _rounds(self, parts: Sequence[Part]) -> tuple[FloatArray, FloatArray]:
        trenches = [part for part in parts if isinstance(part, Trench)]
        rows = [self._capsules(part) for part in parts if isinstance(part, Chain)]
        bells = [part for part in parts if isinstance(part, Bell)]
        bells += [bell for part in parts if isinstance(part, Swell) for bell in _ends_of(part)]
        rows += [self._rings(bell) for bell in bells]
        rows += [self._arcs(part, [each for each in trenches if each is not part])
                 for part in trenches if len(part.axis) == 1]  # fmt: skip
        groups: list[tuple[FloatArray, float, int, int]] = []
        first = 0
        for block in rows:
            for start in range(0, len(block), LEGS_PER_GROUP):
                some = block[start : start + LEGS_PER_GROUP]
                low, high = _ends(some)
                ends = np.concatenate([low, high])
                center = 0.5 * (ends.min(axis=0) + ends.max(axis=0))
                reach = float((np.linalg.norm(ends - center, axis=1) + np.tile(_widths(some), 2)).max())
                groups.append((center, reach, first + start, first + start + len(some)))
            first += len(block)
        table = [np.concatenate([center, [reach, start, stop]]) for center, reach, start, stop in groups]
        return _rows(rows, 15), _rows([np.array(table)] if table else [], 6)

    def _capsules(self, chain: Chain) -> FloatArray:
        """(K - 1, 15) or, of a bump, (1, 15), and one for each end: ends, radius, normal, least cosine to it, kind."""
        axis, normals = chain.axis, chain.normals
        if len(axis) == 1 or is_closed(axis):
            return self._legs_of(chain, axis, normals, chain.radius)
        rounded = END_ROUNDING * chain.radius
        s = arclengths(axis)
        back = min(chain.radius - rounded, 0.25 * s[-1])
        places = np.concatenate([[back], s[(s > back) & (s < s[-1] - back)], [s[-1] - back]])
        middle, up = (np.column_stack([np.interp(places, s, each[:, k]) for k in range(3)]) for each in (axis, normals))
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        rows = [self._legs_of(chain, middle, up, chain.radius)]
        for end in (0, -1):
            foot, way = np.array([axis[end], middle[end]]), np.array([normals[end], up[end]])
            rows.append(self._legs_of(chain, foot, way, rounded))
        return np.concatenate(rows)

    def _legs_of(self, chain: Chain, axis: FloatArray, normals: FloatArray, radius: float) -> FloatArray:
        """(K - 1, 15) or (1, 15) capsules of a radius, m, whose crest is as high as the chain's over an axis (K, 3)."""
        line = self.into(axis + (chain.height - radius) * normals)
        legs = max(len(line) - 1, 1)
        rows = np.zeros((legs, 15))
        rows[:, 0:3], rows[:, 3:6] = line[:legs], line[-legs:]
        rows[:, 6] = self.scale * radius
        up = normals[:legs] + normals[-legs:]
        rows[:, 7:10] = up / np.linalg.norm(up, axis=1, keepdims=True)
        rows[:, 10] = -2.0
        if chain.height < radius:
            share = 1.0 - chain.height / radius
            sine = CAP_REACH * np.sqrt((1.0 - share) * (1.0 + share))
            rows[:, 10] = np.sqrt(1.0 - sine**2) if sine < 1.0 else -2.0
        return rows

    def _rings(self, bell: Bell) -> FloatArray:
        """(M, 15): foot, axis, (distance from axis, height) of both circles of each ring, kind, the bell's sizes."""
        u = meridian(bell)
        z = bell.height * (1.0 + (u / bell.scale) ** 2 / bell.exponent) ** -bell.exponent
        rows = np.zeros((len(u) - 1, 15))
        rows[:, 0:3] = self.into(bell.point[None])
        rows[:, 3:6] = bell.normal
        rows[:, 6:10] = self.scale * np.column_stack([u[:-1], z[:-1], u[1:], z[1:]])
        rows[:, 11] = 1.0
        rows[:, 12:15] = self.scale * bell.height, self.scale * bell.scale, bell.exponent
        return rows

    def _arcs(self, pit: Trench, others: Sequence[Trench]) -> FloatArray:
        """(M, 15) arcs of a rim: centre, axis, radius, middle as a direction, cosine of half the angle, kind."""
        first, middle, last = (self.into(each) for each in rim_arcs(pit, self.base, others))
        rows = np.zeros((len(first), 15))
        chord, sag = 0.5 * (last - first), middle - 0.5 * (first + last)
        sag -= np.einsum("ij,ij->i", sag, chord)[:, None] / (chord**2).sum(axis=1)[:, None] * chord
        half, rise = np.linalg.norm(chord, axis=1), np.linalg.norm(sag, axis=1)
        out = sag / rise[:, None]
        radius = 0.5 * (half**2 / rise + rise)
        axis = np.cross(out, chord)
        rows[:, 0:3] = 0.5 * (first + last) + (rise - radius)[:, None] * out
        rows[:, 3:6] = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        rows[:, 6], rows[:, 7:10] = radius, out
        rows[:, 10], rows[:, 11] = (radius - rise) / radius, 2.0
        return rows

    def _legs(self, trenches: Sequence[Trench]) -> tuple[FloatArray, FloatArray]:
        rows, hulls, first = [], [], 0
        for trench in trenches:
            axis = self.into(trench.axis)
            legs, half = max(len(axis) - 1, 1), 0.5 * self.scale * trench.width
            up = trench.normals[:legs] + trench.normals[-legs:]
            block = np.zeros((legs, 11))
            block[:, 0:3], block[:, 3:6], block[:, 9] = axis[:legs], axis[-legs:], half
            block[:, 6:9] = up / np.linalg.norm(up, axis=1, keepdims=True)
            if len(axis) > 1 and not is_closed(axis):
                block[0, 10] += 1.0
                block[-1, 10] += 2.0
            center = 0.5 * (axis.min(axis=0) + axis.max(axis=0))
            reach = np.linalg.norm(axis - center, axis=1).max() + half
            hulls.append(np.concatenate([center, [reach, first, first + legs, self.scale * trench.depth]]))
            rows.append(block)
            first += legs
        return _rows(rows, 11), _rows([np.array(hulls)] if hulls else [], 7)


def _ends_of(swell: Swell) -> list[Bell]:
    """The bells that an open swell ends as; their other halves lie within it."""
    ends = () if is_closed(swell.axis) else (0, -1)
    section = swell.height, swell.scale, swell.exponent
    return [Bell(swell.axis[end], swell.normals[end], *section) for end in ends]


def _ends(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ends of the skeleton of capsules, of rings, or of arcs, (M, 3) each."""
    if rows[0, 11] == 0.0:
        return rows[:, 0:3], rows[:, 3:6]
    if rows[0, 11] == 2.0:
        cosine = rows[:, 10:11]
        near = rows[:, 0:3] + rows[:, 6:7] * cosine * rows[:, 7:10]
        chord = rows[:, 6:7] * np.sqrt(1.0 - cosine**2) * np.cross(rows[:, 3:6], rows[:, 7:10])
        return near - chord, near + chord
    return rows[:, 0:3] + rows[:, 7:8] * rows[:, 3:6], rows[:, 0:3] + rows[:, 9:10] * rows[:, 3:6]


def _widths(rows: FloatArray) -> FloatArray:
    """Distance of the surface from the skeleton, at most."""
    if rows[0, 11] == 2.0:
        return np.asarray(rows[:, 6] * (1.0 - rows[:, 10]))
    return np.asarray(rows[:, 6] if rows[0, 11] == 0.0 else rows[:, 8])


def _rows(blocks: Sequence[FloatArray], width: int) -> FloatArray:
    return np.ascontiguousarray(np.concatenate(blocks)) if blocks else np.zeros((0, width))


def _touched(vertices: FloatArray, faces: IntArray, trenches: Sequence[Trench]) -> BoolArray:
    """(F,) True of faces that a trench may open."""
    corners = vertices[faces]
    middle = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    touched = np.zeros(len(middle), dtype=bool)
    for trench in trenches:
        touched |= distances(middle, trench.axis) <= reach + 0.5 * trench.width
    return touched


def _check(part: Part) -> None:
    """Raises ContactError for sizes that no part can have."""
    if isinstance(part, Bar):
        for name, size in (("top", part.top), ("run", part.run), ("shoulder", part.shoulder)):
            if not (np.isfinite(size) and size >= 0.0):
                raise ContactError(f"a bar's {name} must be finite and at least 0; found {size!r}")
        if part.top + part.run + part.shoulder == 0.0:
            raise ContactError("a bar needs a top or flanks that run; found both 0")
    p = part.exponent if isinstance(part, Bell | Swell) else 1.0
    if not (np.isfinite(p) and (p > 0.0 or p < -1.0)):
        raise ContactError(f"a bell's exponent must be positive, or below -1, and finite; found {p!r}")
    for name in ("height", "radius", "scale", "width", "depth"):
        size = getattr(part, name, 1.0)
        if not (np.isfinite(size) and size > 0.0):
            raise ContactError(f"a {type(part).__name__.lower()}'s {name} must be positive and finite; found {size!r}")
    axis = part.point[None] if isinstance(part, Bell) else part.axis
    normals = part.normal[None] if isinstance(part, Bell) else part.normals
    if axis.ndim != 2 or axis.shape[1] != 3 or axis.shape != normals.shape or not np.isfinite(axis).all():
        raise ContactError(
            f"an axis and its normals must be finite and of one shape (K, 3); found {axis.shape} and {normals.shape}"
        )
    if isinstance(part, Swell) and len(axis) < 2:
        raise ContactError("a swell runs along an axis of two points at least; found one")
    if isinstance(part, Terrace) and (len(axis) < 2 or is_closed(axis)):
        raise ContactError("a step's edge needs two ends; a closed one, or a single point, says no higher side")
