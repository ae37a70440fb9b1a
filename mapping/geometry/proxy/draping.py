"""Draping: hollows, bars, swells and steps as triangles that follow a base."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapping import BoolArray, FloatArray, IntArray
from mapping.geometry.mesh import NearestPoint, arclengths, directions, distances
from mapping.geometry.proxy.parts import Bar, Bell, Swell, Terrace, Trench

# By how much chords of an outline, and facets of a floor, may miss the curve that they stand for, m: less than a third
# of the smallest edge that people feel (0.85 um, LaMotte and Whitehouse 1986)
CHORD_ERROR = 2.5e-7
# A mitre is no longer than this part of the half-width
LONGEST_MITRE = 2.0
# Legs that chords are halved into on a bent base, at most
MOST_HALVINGS = 7
# Arcs of a pit's rim. On a saddle or a cylinder the rim rises and falls twice, by a in all; an arc through three of its
# points misses it by at most a (2 pi / RIM_ARCS)^3 / (36 sqrt 3): 0.0003 of it, 0.1 um where a rim bends by 0.35 mm
RIM_ARCS = 24
# Rows of a floor from side to side, at most
MOST_FLOOR_ROWS = 33
# The ramps at the far sides of a step fall by one in so many: 1.1 degrees, below what people call a slope in a crossing
RAMP = 50.0
# A bell ends where it is hardly higher than the base: this share of its height, 0.1 um of a millimetre
BELL_END = 1e-4
# Nor does a swell go further than so many of its scales: farther out a bent base is no longer beside it. What is left
# of its height there, 1 % of the paper's bump and 7 % of the slowest taper, 2, is taken off along the flank
SWELL_REACH = 10.0

Mesh = tuple[FloatArray, IntArray]


def trench_meshes(trench: Trench, base: NearestPoint, others: Sequence[Trench] = ()) -> tuple[Mesh, Mesh]:
    """(floor, walls) of a trench, m; the mouth is left open, and so are the walls where another trench takes them away.

    The floor is whole, its faces turned outwards.
    """
    half, axis = 0.5 * trench.width, trench.axis
    if len(axis) == 1:
        turn = np.linspace(0.0, 2.0 * np.pi, _chords(half) + 1)[:-1]
        across, along = _plane(trench.normals[0])
        ring = half / np.cos(np.pi / len(turn)) * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * along)
        ring = np.vstack([ring, ring[:1]])
        shares = _shares(draped(axis + ring, base)[0].mean(axis=0) - axis[0])
        rows = [draped(axis + share * ring, base) for share in shares[::-1]]
        rims = [rows[0][0]]
    else:
        reach = half * _mitres(axis)[:, None] * _laterals(axis, trench.normals)
        sag = 0.5 * (draped(axis + reach, base)[0] + draped(axis - reach, base)[0]) - axis
        rows = [draped(axis + (2.0 * share - 1.0) * reach, base) for share in _shares(sag)]
        rims = [rows[0][0], rows[-1][0]]
        if not is_closed(axis):
            rims += [np.array([points[end] for points, _ in rows]) for end in (0, -1)]
    floor = _strips([points - trench.depth * normals for points, normals in rows])
    return floor, joined([_walls(rim, trench.depth, base, others) for rim in rims])


def _walls(rim: FloatArray, depth: float, base: NearestPoint, others: Sequence[Trench]) -> Mesh:
    """Upright walls below a rim (K, 3), but for what lies in other trenches, and not below their floors."""
    for other in others:
        rim = crossed(rim, other)
    points, normals = draped(rim, base)
    middles = 0.5 * (rim[1:] + rim[:-1])
    inside = [within(middles, other) for other in others]
    levels = sorted({0.0, *(other.depth for other in others if other.depth < depth)})
    walls = []
    for upper, lower in zip(levels, [*levels[1:], depth], strict=True):
        taken = [there for there, other in zip(inside, others, strict=True) if other.depth > upper]
        vertices, faces = _strips([points - upper * normals, points - lower * normals])
        walls.append((vertices, faces[np.tile(~np.any(taken, axis=0), 2)] if taken else faces))
    return joined(walls)


def rim_arcs(
    pit: Trench, base: NearestPoint, others: Sequence[Trench] = ()
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """First, middle and last points (M, 3) of the arcs of a pit's rim, m, but for those that other trenches take away.

    The walls are a polygon about the rim, so that a ball in the mouth touches the arcs: from chord to chord its normal
    would turn by degrees.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, 2 * RIM_ARCS + 1)
    across, along = _plane(pit.normals[0])
    rim, _ = draped(pit.axis + 0.5 * pit.width * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * along), base)
    first, middle, last = rim[:-1:2], rim[1::2], rim[2::2]
    whole = np.ones(RIM_ARCS, dtype=bool)
    for other in others:
        whole &= ~(within(first, other) | within(middle, other) | within(last, other))
    return first[whole], middle[whole], last[whole]


def bar_mesh(bar: Bar, base: NearestPoint) -> Mesh:
    """(vertices, faces) of the flanks, the top and the square ends of a bar, m; the foot is left open.

    About a point it is turned round the normal there.
    """
    if len(bar.axis) == 1:
        return _turned_mesh(bar, base)
    laterals = _mitres(bar.axis)[:, None] * _laterals(bar.axis, bar.normals)
    offsets, rises = _outline(bar, base, laterals)
    offsets, rises = np.append(-offsets[:0:-1], offsets), np.append(rises[:0:-1], rises)
    feet = [draped(bar.axis + away * laterals, base) for away in offsets]
    rows = [points + rise * bar.height * normals for (points, normals), rise in zip(feet, rises, strict=True)]
    mesh = _strips(rows)
    if is_closed(bar.axis):
        return mesh
    caps = [_strips([np.array([points[end] for points, _ in feet]), np.array([row[end] for row in rows])])
            for end in (0, -1)]  # fmt: skip
    return joined([mesh, *caps])


def _turned_mesh(bar: Bar, base: NearestPoint) -> Mesh:
    """(vertices, faces) of a section turned about the normal of its point."""
    across, along = _plane(bar.normals[0])
    offsets, rises = _outline(bar, base, across[None])
    turn = np.linspace(0.0, 2.0 * np.pi, _chords(max(float(offsets[-1]), CHORD_ERROR)) + 1)
    # half of what the chords miss lies to either side
    ring = (
        2.0 / (1.0 + np.cos(np.pi / (len(turn) - 1))) * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * along)
    )
    rows = []
    for away, rise in zip(offsets, rises, strict=True):
        points, normals = draped(bar.axis + away * ring, base)
        rows.append(points + rise * bar.height * normals)
    vertices, faces = _strips(rows)
    return vertices, faces[len(turn) - 1 :]  # its middle is a point: the first half of the first strip is nothing


def _outline(bar: Bar, base: NearestPoint, laterals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances (J,) from the middle of a section outwards, m, and heights there as shares of the whole."""
    half = 0.5 * bar.top
    offsets, rises = np.zeros(1), np.ones(1)
    for inner, outer, falls in ((0.0, half, False), (half, half + bar.run, True)):
        ends = [draped(bar.axis + side * away * laterals, base)[0] for side in (-1, 1) for away in (inner, outer)]
        middles = [draped(bar.axis + side * 0.5 * (inner + outer) * laterals, base)[0] for side in (-1, 1)]
        sag = np.concatenate([middles[0] - 0.5 * (ends[0] + ends[1]), middles[1] - 0.5 * (ends[2] + ends[3])])
        shares = _shares(sag)[1:]
        if outer > inner or falls:
            offsets = np.append(offsets, inner + shares * (outer - inner))
            rises = np.append(rises, 1.0 - shares if falls else np.ones(len(shares)))
    if bar.shoulder > 0.0:  # before the wall, which a run of nothing is
        a = bar.shoulder
        least = max(1.0 - bar.height / a, 0.0)
        turn = np.linspace(0.0, np.arccos(least), 2 + int(_chords(a) * np.arccos(least) / (2.0 * np.pi)))[1:]
        wall = [half + a] if a < bar.height else []
        offsets = np.concatenate([offsets[:-1], half + a * np.sin(turn), wall])
        rises = np.concatenate([rises[:-1], 1.0 - a * (1.0 - np.cos(turn)) / bar.height, np.zeros(len(wall))])
    return offsets, rises


def swell_mesh(swell: Swell, base: NearestPoint) -> Mesh:
    """(vertices, faces) of the flanks of a swell, m; the foot and the ends are left open."""
    laterals = _mitres(swell.axis)[:, None] * _laterals(swell.axis, swell.normals)
    away = meridian(swell)
    away = away[away <= SWELL_REACH * swell.scale]
    share = (1.0 + (away / swell.scale) ** 2 / swell.exponent) ** -swell.exponent
    share -= share[-1] * away / away[-1]
    sides, rises = np.append(-away[:0:-1], away), np.append(share[:0:-1], share)
    rows = []
    for side, rise in zip(sides, rises, strict=True):
        points, normals = draped(swell.axis + side * laterals, base)
        rows.append(points + rise * swell.height * normals)
    return _strips(rows)


def meridian(bell: Bell | Swell) -> FloatArray:
    """(M,) distances from the axis between which chords of a bell miss it by CHORD_ERROR at most, m."""
    p, w = bell.exponent, bell.scale
    end = w * np.sqrt(p * np.expm1(-np.log(BELL_END) / p))
    fine = w * np.sinh(np.linspace(0.0, np.arcsinh(end / w), 4001))
    base = 1.0 + (fine / w) ** 2 / p
    z = bell.height * base**-p
    slope = np.gradient(z, fine)
    bend = np.abs(np.gradient(slope, fine)) / (1.0 + slope**2) ** 1.5
    speed = np.sqrt(1.0 + slope**2)
    # a chord of length l misses a curve of curvature k by k l^2 / 8
    density = speed * np.sqrt(bend / (8.0 * CHORD_ERROR))
    parts = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(fine))])
    return np.asarray(np.interp(np.linspace(0.0, parts[-1], 2 + int(parts[-1])), parts, fine))


def terrace_mesh(terrace: Terrace, base: NearestPoint) -> Mesh:
    """(vertices, faces) of the wall, the higher level and the ramps that end it, m."""
    axis, normals = terrace.axis, terrace.normals
    s = arclengths(axis)
    ramp = RAMP * terrace.height
    tangents = directions(axis)
    axis = np.vstack([axis[:1] - ramp * tangents[:1], axis, axis[-1:] + ramp * tangents[-1:]])
    normals = np.vstack([normals[:1], normals, normals[-1:]])
    laterals = terrace.high_side * np.cross(normals, directions(axis))
    laterals /= np.linalg.norm(laterals, axis=1, keepdims=True)
    up = np.ones(len(axis))
    up[0] = up[-1] = 0.0
    far = base.query(axis + s[-1] * laterals).points
    half_way = base.query(axis + 0.5 * s[-1] * laterals).points
    shares = _shares(half_way - 0.5 * (axis + far))
    aside = [*(s[-1] * shares), s[-1] + ramp]
    level = [1.0] * len(shares) + [0.0]
    there = [base.query(axis + away * laterals) for away in aside]  # where the base ends, the terrace does
    rows = [(near.points, near.normals) for near in there]
    tops = [
        points + (share * terrace.height * up)[:, None] * outward
        for (points, outward), share in zip(rows, level, strict=True)
    ]
    return joined([_strips([rows[0][0], tops[0]]), _strips(tops)])


def draped(points: FloatArray, base: NearestPoint) -> tuple[FloatArray, FloatArray]:
    """(points, normals) of the base nearest to points (N, 3), m; beside an open base the points stay where they are."""
    near = base.query(points)
    beside = near.distance > 1e-9 * base.surface.size
    off = points - near.points
    lateral = np.abs(np.einsum("ij,ij->i", off, near.normals)) < 0.5 * near.distance
    keep = (beside & lateral)[:, None]
    return np.where(keep, points, near.points), near.normals


def joined(meshes: list[Mesh]) -> Mesh:
    """One mesh of several."""
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + first for (_, faces), first in zip(meshes, firsts, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def _strips(rows: list[FloatArray]) -> Mesh:
    """Triangles between rows of as many points each."""
    count, corner = len(rows[0]), np.arange(len(rows[0]) - 1)
    faces = []
    for row in range(len(rows) - 1):
        here, there = row * count + corner, (row + 1) * count + corner
        faces += [np.column_stack([here, here + 1, there + 1]), np.column_stack([here, there + 1, there])]
    return np.concatenate(rows), np.concatenate(faces)


def _chords(radius: float) -> int:
    """Chords of a full circle that miss it by CHORD_ERROR to either side at most; an even number."""
    return 2 * max(8, int(np.ceil(np.pi / np.arccos(max(1.0 - 2.0 * CHORD_ERROR / radius, 0.9)) / 2.0)))


def _shares(sag: FloatArray) -> FloatArray:
    """Even places from 0 to 1 between which a floor that sags so far (..., 3) in all is flat to CHORD_ERROR."""
    most = float(np.linalg.norm(np.atleast_2d(sag), axis=1).max())
    return np.linspace(0.0, 1.0, min(MOST_FLOOR_ROWS, 2 + int(np.sqrt(most / CHORD_ERROR))))


def _plane(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors at right angles to a normal and to each other."""
    wish = np.eye(3)[int(np.abs(normal).argmin())]
    first = wish - (wish @ normal) * normal
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


def _laterals(axis: FloatArray, normals: FloatArray) -> FloatArray:
    """(K, 3) unit vectors across an axis: normal x tangent."""
    laterals = np.cross(normals, directions(axis))
    return np.asarray(laterals / np.linalg.norm(laterals, axis=1, keepdims=True))


def _mitres(axis: FloatArray) -> FloatArray:
    """(K,) by how much an offset grows at each corner of an axis."""
    closed = is_closed(axis)
    legs = np.diff(axis, axis=0)
    legs /= np.linalg.norm(legs, axis=1, keepdims=True)
    before, after = (
        np.vstack([legs[-1:] if closed else legs[:1], legs]),
        np.vstack([legs, legs[:1] if closed else legs[-1:]]),
    )
    cosine = np.sqrt(np.clip(0.5 * (1.0 + np.einsum("ij,ij->i", before, after)), LONGEST_MITRE**-2, 1.0))
    return np.asarray(1.0 / cosine)


def is_closed(axis: FloatArray) -> bool:
    """True of a ring: its first point is its last."""
    return len(axis) > 1 and np.array_equal(axis[0], axis[-1])


def within(points: FloatArray, trench: Trench) -> BoolArray:
    """(N,) True of points (N, 3) of the base that lie over a trench, m: what `is_cut_away` asks of single ones."""
    half, axis = 0.5 * trench.width, trench.axis
    if len(axis) == 1:
        return np.asarray(np.linalg.norm(points - axis[0], axis=1) < half)
    legs = np.diff(axis, axis=0)
    squares = (legs**2).sum(axis=1)
    from_first = points[:, None] - axis[:-1]
    along = (from_first * legs).sum(axis=2)
    off = from_first - np.clip(along / squares, 0.0, 1.0)[..., None] * legs
    there = (off**2).sum(axis=2) < half**2
    if not is_closed(axis):
        there[:, 0] &= along[:, 0] >= 0.0
        there[:, -1] &= along[:, -1] <= squares[-1]
    return np.asarray(there.any(axis=1))


def crossed(line: FloatArray, trench: Trench) -> FloatArray:
    """A line (K, 3) with further points where it crosses the outline of a trench, m."""
    half, axis = 0.5 * trench.width, trench.axis
    starts, ways = line[:-1, None], np.diff(line, axis=0)[:, None]
    # the outline is made of spheres about the axis' points, of cylinders about its legs, and of planes at its ends
    rounds = [(starts - axis, np.broadcast_to(ways, (len(ways), len(axis), 3)))]
    cuts = []
    if len(axis) > 1:
        legs = np.diff(axis, axis=0)
        legs /= np.linalg.norm(legs, axis=1, keepdims=True)
        from_first = starts - axis[:-1]
        rounds.append(tuple(each - (each * legs).sum(axis=2, keepdims=True) * legs for each in (from_first, ways)))
        if not is_closed(axis):
            with np.errstate(divide="ignore", invalid="ignore"):
                cuts = [-((starts[:, 0] - axis[end]) @ legs[end]) / (ways[:, 0] @ legs[end]) for end in (0, -1)]
    for off, way in rounds:
        square, half_b, rest = ((a * b).sum(axis=2) for a, b in ((way, way), (off, way), (off, off)))
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(half_b**2 - square * (rest - half**2))
            cuts += [((-half_b + sign * root) / square)[:, k] for sign in (-1, 1) for k in range(square.shape[1])]
    which, number = np.nonzero([(each > 0.0) & (each < 1.0) for each in cuts])
    share = np.array(cuts)[which, number]
    places = line[number] + share[:, None] * np.diff(line, axis=0)[number]
    on = distances(places, axis) < half * (1.0 + 1e-9)  # the outline itself, not its parts drawn further
    number, share, places = number[on], share[on], places[on]
    order = np.lexsort((share, number))
    return np.asarray(np.insert(line, number[order] + 1, places[order], axis=0))


def followed(axis: FloatArray, normals: FloatArray, base: NearestPoint) -> tuple[FloatArray, FloatArray]:
    """The axis and its normals, the legs halved until their middles lie on the base; a point stays one."""
    if len(axis) == 1:
        return axis, normals
    keep = np.append(True, np.linalg.norm(np.diff(axis, axis=0), axis=1) > 0.0)
    axis, normals = axis[keep], normals[keep]
    for _ in range(MOST_HALVINGS):
        middles = 0.5 * (axis[1:] + axis[:-1])
        there, outward = draped(middles, base)
        bent = np.linalg.norm(there - middles, axis=1) > CHORD_ERROR
        if not bent.any():
            break
        place = np.flatnonzero(bent) + 1
        axis, normals = np.insert(axis, place, there[bent], axis=0), np.insert(normals, place, outward[bent], axis=0)
    return axis, normals
