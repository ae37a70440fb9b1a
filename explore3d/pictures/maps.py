"""Maps in colours over the object: curvature of the estimated surface, departure of the body from its model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from explore3d.pictures.camera import Camera
from explore3d.pictures.chart import FONT_SIZE, drawing, image, pixels_png, text_at
from explore3d.pictures.object import SUPERSAMPLING, cameras_for, pictured, shifted, view_directions
from explore3d.pictures.render import Body, Picture, render
from mapping import BoolArray, Feature, FloatArray, IntArray, Surface, length_unit, lengths
from mapping.geometry.curvature import TOLD_SIDE, Neighbours
from mapping.geometry.mesh import arclengths, directions, resample
from mapping.model import feature_mesh

if TYPE_CHECKING:
    from mapping.estimate.envelope import Estimate
    from mapping.geometry.curvature import Curvature

NOT_VALID = np.array([0.75, 0.75, 0.75])
# ColorBrewer's RdBu from blue over white to red, evenly spaced: red and blue of equal weight, told apart by everybody
# (Brewer, Hatchard and Harrower, ColorBrewer in print, 2003)
BLUE_TO_RED = (
    "053061", "2166ac", "4393c3", "92c5de", "d1e5f0", "f7f7f7", "fddbc7", "f4a582", "d6604d", "b2182b", "67001f",
)  # fmt: skip
BAR = (16.0, 220.0)  # width and height of the scale of colours, px
BAR_ROOM = 90.0  # px
# Two views side by side are shown on the page at half of their size: their letters and scale are drawn twice as large
SIDE_BY_SIDE = 2.0
CURVATURE_TITLE = 28.0 * SIDE_BY_SIDE  # px
# A map is read once for so many pixels of the drawing each way: its values change over several samples
MAP_PIXELS = 2
# Points that a value is read from: those of a ring about the nearest in a mesh of triangles, and of the ring about it
# (6 and 12), less those that weigh nothing
READ_FROM = 12
# Places that are read at once: all 125,000 of a large picture took 120 MB, the most of a whole run
READ_AT_ONCE = 16_384
# A line's own values hold up to its reach, and fade to nothing at so many times it: the fits of curvature take in
# neighbours from as far again
ZONE = 2.0
# Places of a line's axis: on a picture some 800 px wide they lie two pixels apart at most
LINE_PLACES = 400
# Sweeps that cross a line before a map reads between them, and the share of the gaps between them that it spans
LEAST_CROSSINGS, SPANNED = 3, 0.9
# Places on the scale that bear a number
MARKS = (-1.0, -0.5, 0.0, 0.5, 1.0)


def curvature_picture(
    estimate: Estimate, curvature: Curvature, tip_radius: float, base: Surface, features: Sequence[Feature]
) -> bytes:
    """SVG of k1 and k2 in units of 1/r, on the object as it was found: red bulges out, blue bends in; the paler, the
    less sure it is which of both; grey is further than the tip's radius from every place that was felt.

    The views are those of the object's own picture. What is drawn is the base with its features, not the mesh of the
    estimate: between sweeps that lie apart that mesh is folded as the triangles happen to fall.

    Args:
        estimate: of the surface, with a mesh.
        curvature: at its points.
        tip_radius: r, m.
        base: the global model.
        features: that were found: they are turned to the front.
    """
    assert estimate.surface is not None
    areas = estimate.surface.face_areas[:, None]
    outward = estimate.surface.face_normals * areas / areas.mean()
    directions = view_directions(outward, features, base)
    own_sd = np.nan_to_num(curvature.sd)
    scaled = np.column_stack([curvature.k1, curvature.k2, own_sd, own_sd]) * tip_radius
    top = _span([scaled[:, 0], scaled[:, 1]], curvature.valid)
    known = np.flatnonzero(curvature.valid & np.isfinite(scaled).all(axis=1))
    felt = Felt(estimate.points[known], estimate.normals[known], estimate.sweep[known], scaled[known])
    lines = [line for each in features if (line := Line.of(each, felt, tip_radius)) is not None]
    scaled[:, 2:] = np.hypot(scaled[:, 2:], _contradicted(estimate.surface.faces, estimate.sweep, scaled[:, :2]))
    felt = replace(felt, values=scaled[known])
    bodies = [Body(each, np.ones(3)) for each in (base, *map(feature_mesh, features))]
    sides = np.concatenate([base.face_normals, *(_sides(*each) for each in zip(bodies[1:], features, strict=True))])
    content, down, right = "", CURVATURE_TITLE, 0.0
    for camera in cameras_for(base.vertices[np.unique(base.faces)], directions):
        width, height = camera.width / SUPERSAMPLING, camera.height / SUPERSAMPLING
        maps = _maps_seen(bodies, sides, camera, felt, lines, tip_radius, top)
        for left, png, name in zip((0.0, width), maps, ("larger, k₁", "smaller, k₂"), strict=True):
            if not right:
                title, size = f"Principal curvature, {name}", 1.1 * FONT_SIZE * SIDE_BY_SIDE
                content += text_at(left + 4.0, 18.0 * SIDE_BY_SIDE, title, size=size, bold=True)
            content += shifted(image(png, 0.0, 0.0, width, height), left, down)
        down, right = down + height, max(right, 2.0 * width)
    bar = min(BAR[1], (down - CURVATURE_TITLE) / SIDE_BY_SIDE)
    marks = [f"{share * top:.2g}" for share in MARKS]
    middle = 0.5 * (CURVATURE_TITLE + down - SIDE_BY_SIDE * bar)
    scale = f'<g transform="scale({SIDE_BY_SIDE:g})">{_bar(marks, "curvature × tip radius", bar)}</g>'
    content += shifted(scale, right + 14.0, middle)
    return drawing(right + SIDE_BY_SIDE * BAR_ROOM, down + 10.0, content)


@dataclass(frozen=True, eq=False)
class Felt:
    """Places (N, 3) of an estimate, m, outward normals (N, 3), sweeps (N,), and values (N, 4): k1, k2 and their sds."""

    places: FloatArray
    normals: FloatArray
    sweep: IntArray
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Line:
    """A feature along a curve as a map reads it: between the sweeps that cross it, along its axis.

    A sweep meets it where the next one does not, so a mesh joins its crest to its flank or to the plate. What lies as
    far along it as sweeps lie apart is as near as what lies one sample aside.

    Args:
        axis, normals, ways: (K, 3) places of its axis, m, outward normals, unit directions along.
        reach: the ball leaves the base at this distance from its axis, m.
        scale: (2,) distance between crossings along the axis and between samples across it, m.
        beside: (M, 2) places of the felt beside it, along and across, in units of the scale.
        values: (M, 4) theirs.
    """

    axis: FloatArray
    normals: FloatArray
    ways: FloatArray
    reach: float
    scale: FloatArray
    beside: FloatArray
    values: FloatArray

    @classmethod
    def of(cls, feature: Feature, felt: Felt, tip_radius: float) -> Line | None:
        """None of a feature without a length, or that too few sweeps cross to read between them."""
        if len(feature.axis) < 2:
            return None
        axis = resample(feature.axis, LINE_PLACES)
        share, own = np.linspace(0.0, 1.0, LINE_PLACES), arclengths(feature.axis)
        normals = np.column_stack([np.interp(share, own / own[-1], feature.normals[:, i]) for i in range(3)])
        height = min(abs(feature.height.median), tip_radius)
        reach = float(np.sqrt(2.0 * tip_radius * height) + 0.5 * max(feature.width.median, 0.0))
        line = cls(axis, normals, directions(axis), reach, np.ones(2), np.zeros((0, 2)), np.zeros((0, 4)))
        near, beside = line.zone(felt.places, felt.normals)
        crossed = near[np.abs(beside[:, 1]) < 0.5 * reach]
        if len(sweeps := np.unique(felt.sweep[crossed])) < LEAST_CROSSINGS:
            return None
        along = beside[np.abs(beside[:, 1]) < 0.5 * reach, 0]
        met = np.sort([along[felt.sweep[crossed] == each].mean() for each in sweeps])
        own_way = np.flatnonzero(np.diff(felt.sweep[near]) == 0)
        steps = np.linalg.norm(np.diff(felt.places[near], axis=0)[own_way], axis=1)
        step = float(np.median(steps)) if len(steps) else reach
        scale = np.array([max(float(np.quantile(np.diff(met), SPANNED)), step), step])
        return replace(line, scale=scale, beside=beside / scale, values=felt.values[near])

    def zone(self, places: FloatArray, normals: FloatArray) -> tuple[IntArray, FloatArray]:
        """Which of the places (N, 3) lie beside the line, on its side of the body; (M, 2) how far along and across."""
        from scipy.spatial import cKDTree

        apart, foot = cKDTree(self.axis).query(places, distance_upper_bound=ZONE * self.reach)
        near, foot = np.flatnonzero(np.isfinite(apart)), np.asarray(foot)
        near = near[np.einsum("ij,ij->i", normals[near], self.normals[foot[near]]) > 0.0]
        foot = foot[near]
        off, way = places[near] - self.axis[foot], self.ways[foot]
        along = arclengths(self.axis)[foot] + np.einsum("ij,ij->i", off, way)
        across = np.einsum("ij,ij->i", off, np.cross(self.normals[foot], way))
        return near, np.column_stack([along, across])

    def share(self, beside: FloatArray) -> FloatArray:
        """(M,) 1 where places (M, 2) along and across are the line's own, 0 where they are no longer."""
        length = float(arclengths(self.axis)[-1])
        beyond = np.maximum(np.maximum(-beside[:, 0], beside[:, 0] - length), 0.0)
        return np.clip((ZONE - np.hypot(beside[:, 1], beyond) / self.reach) / (ZONE - 1.0), 0.0, 1.0)


def _sides(body: Body, feature: Feature) -> FloatArray:
    """(F, 3) of a feature's body: the base's normal under each face. What was felt on a steep flank leans less."""
    middles = body.surface.vertices[body.surface.faces].mean(axis=1)
    nearest = np.linalg.norm(middles[:, None] - feature.axis[None], axis=2).argmin(axis=1)
    return np.asarray(feature.normals[nearest])


def _contradicted(faces: IntArray, sweep: IntArray, values: FloatArray) -> FloatArray:
    """(N, 2) root mean square difference of values (N, 2) to those that other sweeps gave beside them; 0 for none.

    A detail that lies between two sweeps is one thing to the one and another to the other: what only one of them says
    is not known of the surface between them.
    """
    sides = np.concatenate([faces, np.roll(faces, -1, axis=1)]).reshape(2, -1).T
    sides = sides[sweep[sides[:, 0]] != sweep[sides[:, 1]]]
    squares = np.nan_to_num((values[sides[:, 0]] - values[sides[:, 1]]) ** 2)
    ends, twice = sides.T.ravel(), np.concatenate([squares, squares])
    count = np.maximum(np.bincount(ends, minlength=len(values)), 1)
    return np.sqrt(np.column_stack([np.bincount(ends, twice[:, i], len(values)) / count for i in (0, 1)]))


def _maps_seen(
    bodies: Sequence[Body],
    sides: FloatArray,
    camera: Camera,
    felt: Felt,
    lines: Sequence[Line],
    tip_radius: float,
    top: float,
) -> list[bytes]:
    """PNG of k1 and of k2 as a camera sees them; what is rendered, 20 bytes a sample, is let go of early."""
    picture = replace(render(bodies, camera), flat=sides)
    lit = picture.reduced(SUPERSAMPLING)
    picture.pixels = picture.pixels[:0].copy()
    coarse = _map_colours(picture, felt, lines, tip_radius, top)
    del picture
    return [pixels_png(_lit_map(blocks, lit)) for blocks in coarse]


def _lit_map(blocks: FloatArray, lit: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W, 3) pixels of a map's blocks of colours, shaded as the light (H, W, 3) falls.

    A row of blocks at a time: as floats all of them are 50 MB in four arrays, on top of the most that a run takes.
    """
    drawn = np.empty_like(lit)
    for row, colours in enumerate(blocks):
        part = slice(row * MAP_PIXELS, (row + 1) * MAP_PIXELS)
        shaded = 255.0 * (lit[part] / 255.0) * colours.repeat(MAP_PIXELS, axis=0)[None, : lit.shape[1]]
        drawn[part] = np.rint(shaded, out=shaded)
    return drawn


def _map_colours(
    picture: Picture, felt: Felt, lines: Sequence[Line], tip_radius: float, top: float
) -> list[FloatArray]:
    """(H, W, 3) colours of k1, then of k2, for the blocks of MAP_PIXELS pixels of the drawing each way."""
    places, normals, blocks = _seen(picture, SUPERSAMPLING * MAP_PIXELS)
    front = np.einsum("ij,ij->i", felt.normals, picture.camera.eye - felt.places) > 0.0  # walls are thin
    read, apart = _read(places, felt.places[front], felt.values[front], (normals, felt.normals[front]))
    for line in lines:
        near, beside = line.zone(places, normals)
        if len(near):
            own, _ = _read(beside / line.scale, line.beside, line.values)
            share = line.share(beside)[:, None]
            read[near] = share * own + (1.0 - share) * read[near]
    maps = []
    for number in (0, 1):
        colours = coloured(0.5 + 0.5 * faded(read[:, number] / top, read[:, 2 + number] / top))
        colours[~(apart < tip_radius)] = NOT_VALID
        whole = np.ones((*blocks.shape, 3))
        whole[blocks] = colours
        maps.append(whole)
    return maps


def _seen(picture: Picture, block: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Of each block of pixels that sees the body one place (M, 3) and normal (M, 3), and which blocks (H, W) do."""
    height, width = (-(-each // block) * block for each in picture.depth.shape)
    rows, columns = picture.depth.shape
    depth = np.full((height, width), np.inf, dtype=np.float32)
    depth[:rows, :columns] = picture.depth
    tiles = depth.reshape(height // block, block, width // block, block).swapaxes(1, 2).reshape(-1, block * block)
    best = tiles.argmin(axis=1)
    sees = np.isfinite(tiles[np.arange(len(tiles)), best])
    tile = np.flatnonzero(sees)
    row = block * (tile // (width // block)) + best[sees] // block
    column = block * (tile % (width // block)) + best[sees] % block
    places = picture.camera.eye + picture.depth[row, column][:, None] * picture.camera.rays(row, column)
    return places, picture.normals(row, column), sees.reshape(height // block, width // block)


def _read(
    places: FloatArray, points: FloatArray, values: FloatArray, sides: tuple[FloatArray, FloatArray] | None = None
) -> tuple[FloatArray, FloatArray]:
    """(M, 4) k1, k2 and their standard deviations at places (M, 2 or 3), and (M,) how far the nearest point is.

    Means over the READ_FROM nearest points (N, 2 or 3), weighed down to nothing at the last of them, so that they
    change without a jump; neighbours that contradict each other make a value unsure.

    Args:
        values: (N, 4) k1, k2 and their standard deviations.
        sides: normals of places and points: what faces away does not count. None: all does.
    """
    if len(points) == 0:
        return np.zeros((len(places), 4)), np.full(len(places), np.inf)
    places, points = (np.pad(each, ((0, 0), (0, 3 - each.shape[1]))) for each in (places, points))
    near, read, apart = Neighbours(points), np.empty((len(places), 4)), np.empty(len(places))
    for first in range(0, len(places), READ_AT_ONCE):
        part = slice(first, first + READ_AT_ONCE)
        own = None if sides is None else (sides[0][part], sides[1])
        which = near.query(places[part], min(READ_FROM, len(points)))
        read[part], apart[part] = _read_some(places[part], points, which, values, own)
    return read, apart


def _read_some(
    places: FloatArray,
    points: FloatArray,
    which: IntArray,
    values: FloatArray,
    sides: tuple[FloatArray, FloatArray] | None,
) -> tuple[FloatArray, FloatArray]:
    """`_read` from those points (M, K) that are nearest, nearest first."""
    apart = lengths(points[which] - places[:, None])
    weights = (1.0 - (apart / np.maximum(apart[:, -1:], np.finfo(float).tiny)) ** 2) ** 2 + 1e-9
    nearest = apart[:, 0]
    if sides is not None:
        facing = np.einsum("mj,mkj->mk", sides[0], sides[1][which])
        weights = weights * np.clip(facing, 0.0, 1.0)
        nearest = np.where(facing > TOLD_SIDE, apart, np.inf).min(axis=1)
    weights = weights / np.maximum(weights.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    near = values[which]
    mean = np.einsum("mk,mkj->mj", weights, near)
    spread = np.einsum("mk,mkj->mj", weights, near[..., :2] ** 2) - mean[:, :2] ** 2
    sd = np.sqrt(np.maximum(spread, 0.0) + mean[:, 2:] ** 2)
    return np.column_stack([mean[:, :2], sd]), nearest


def faded(shares: FloatArray, sd: FloatArray) -> FloatArray:
    """(N,) shares of the scale, -1 to 1, drawn towards 0 by how unsure their signs are.

    By the probability of the sign less that of the other one. A limit instead, such as three standard deviations, makes
    flecks: by the wire of wire_on_plate 5 % of the values are beyond three and a half, half from one to two and a half.

    Args:
        shares: (N,) values as shares of the scale's end; beyond it they count as its end.
        sd: (N,) their standard deviations; NaN where nobody knows, whose values are taken for sure.
    """
    from scipy.special import ndtr

    with np.errstate(divide="ignore", invalid="ignore"):
        sure = 2.0 * ndtr(np.abs(shares) / sd) - 1.0
    return np.clip(shares, -1.0, 1.0) * np.where(np.isnan(sure), 1.0, sure)


def coloured(share: FloatArray) -> FloatArray:
    """(N, 3) colours from blue (0) over white to red (1); what is not finite or beyond takes the nearest end."""
    stops = np.array([[int(name[i : i + 2], 16) for i in (0, 2, 4)] for name in BLUE_TO_RED]) / 255.0
    places = np.linspace(0.0, 1.0, len(stops))
    return np.column_stack([np.interp(np.nan_to_num(share, nan=0.5), places, stops[:, i]) for i in range(3)])


def deviation_picture(surface: Surface, deviation: FloatArray) -> bytes:
    """SVG of the body, coloured by its departure from the given model: red stands out of it, blue lies under it.

    Args:
        surface: the corrected model.
        deviation: (V,) at its vertices, m.
    """
    areas = surface.face_areas[:, None]
    directions = view_directions(surface.face_normals * areas / areas.mean(), (), surface)
    cameras = cameras_for(surface.vertices, directions)
    largest = float(np.abs(deviation).max(initial=0.0)) or 1.0
    factor, unit = length_unit(largest)
    colours, left, content = coloured(0.5 + 0.5 * deviation / largest), 0.0, ""
    for camera in cameras:
        content += shifted(pictured(render([Body(surface, colours)], camera)), left)
        left += camera.width / SUPERSAMPLING
    height = max(camera.height for camera in cameras) / SUPERSAMPLING
    bar = min(BAR[1], height)
    marks = [f"{share * largest / factor:.2g}" for share in MARKS]
    content += shifted(_bar(marks, f"body over its model, {unit}", bar), left + 14.0, 0.5 * (height - bar))
    return drawing(left + BAR_ROOM, height, content)


def _bar(marks: list[str], title: str, height: float) -> str:
    """The scale of colours, with its numbers at MARKS."""
    column = np.rint(255 * coloured(np.linspace(1.0, 0.0, 128))).astype(np.uint8)
    parts = [image(pixels_png(column[:, None, :]), 0.0, 0.0, BAR[0], height)]
    for share, mark in zip(MARKS, marks, strict=True):
        words = mark.replace("-", "−")
        parts.append(text_at(BAR[0] + 5.0, 0.5 * height * (1.0 - share) + 4.0, words, size=0.92 * FONT_SIZE))
    parts.append(text_at(BAR[0] + 56.0, 0.5 * height, title, size=FONT_SIZE, anchor="middle", turned=-90.0))
    return "".join(parts)


def _span(values: list[FloatArray], valid: BoolArray) -> float:
    """A range to either side of zero that 99 % of the values fit in, at most twice the tip's own curvature."""
    known = np.concatenate([each[valid] for each in values])
    known = known[np.isfinite(known)]
    top = min(2.0, float(np.quantile(np.abs(known), 0.99))) if len(known) else 1.0
    return max(top, 1e-9)
