"""Maps in colours over the object: curvature of the estimated surface, departure of the body from its model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from explore3d.pictures.chart import FONT_SIZE, drawing, image, pixels_png, text_at
from explore3d.pictures.object import SUPERSAMPLING, cameras_for, pictured, shifted, view_directions
from explore3d.pictures.render import Body, render
from mapping import BoolArray, Feature, FloatArray, IntArray, Surface, length_unit
from mapping.geometry.mesh import NearestPoint

if TYPE_CHECKING:
    from mapping.geometry.curvature import Curvature

NOT_VALID = np.array([0.75, 0.75, 0.75])
# ColorBrewer's RdBu from blue over white to red, evenly spaced: red and blue of equal weight, told apart by everybody
# (Brewer, Hatchard and Harrower, ColorBrewer in print, 2003)
BLUE_TO_RED = (
    "053061", "2166ac", "4393c3", "92c5de", "d1e5f0", "f7f7f7", "fddbc7", "f4a582", "d6604d", "b2182b", "67001f",
)  # fmt: skip
BAR = (16.0, 220.0)  # width and height of the scale of colours, px
BAR_ROOM = 90.0  # px
CURVATURE_TITLE = 28.0  # px
# Views of the object that curvatures are drawn in, two pictures each
MOST_ROWS = 2
# An edge of 2 r that spans a body of radius 5 r or more stays nearer to it than this share of r: (2 r)^2 / (8 * 5 r)
LID_SAGITTA = 0.1
# Places on the scale that bear a number
MARKS = (-1.0, -0.5, 0.0, 0.5, 1.0)


def curvature_picture(
    surface: Surface, curvature: Curvature, tip_radius: float, base: Surface, features: Sequence[Feature]
) -> bytes:
    """SVG of k1 and k2 in units of 1/r: red bulges out, blue bends in; the paler, the less sure
    it is which of both, grey where no value is valid.

    A row for each view of the object's own picture; what merely closes an opening of the object is not drawn, and a
    tear of the mesh that the ball does not pass is closed in the colour of its rim.

    Args:
        surface: the estimated surface.
        curvature: at its vertices.
        tip_radius: r, m.
        base: the global model.
        features: that were found: they are turned to the front.
    """
    areas = surface.face_areas[:, None]
    directions = view_directions(surface.face_normals * areas / areas.mean(), features, base)[:MOST_ROWS]
    highest = max((max(abs(each.height.low), abs(each.height.high)) for each in features), default=0.0)
    near = NearestPoint(base)
    surface = _without_spikes(_without_lids(surface, near, tip_radius), near, highest + LID_SAGITTA * tip_radius)
    closed, rims = _without_tears(surface, tip_radius)
    scaled, sd = [np.asarray(values) * tip_radius for values in (curvature.k1, curvature.k2)], curvature.sd * tip_radius
    top = _span(scaled, curvature.valid)
    content, down, right = "", CURVATURE_TITLE, 0.0
    for direction in directions:
        camera = cameras_for(surface.vertices, [direction, direction])[0]
        width, height = camera.width / SUPERSAMPLING, camera.height / SUPERSAMPLING
        for left, values, name in zip((0.0, width), scaled, ("larger, k₁", "smaller, k₂"), strict=True):
            colours = coloured(0.5 + 0.5 * faded(values / top, sd / top))
            colours[~curvature.valid] = NOT_VALID
            if not right:
                content += text_at(left + 4.0, 18.0, f"Principal curvature, {name}", size=1.1 * FONT_SIZE, bold=True)
            colours = np.vstack([colours, *(colours[rim].mean(axis=0) for rim in rims)])
            content += shifted(pictured(render([Body(closed, colours)], camera, rims=False)), left, down)
        down, right = down + height, max(right, 2.0 * width)
    bar = min(BAR[1], down - CURVATURE_TITLE)
    marks = [f"{share * top:.2g}" for share in MARKS]
    middle = 0.5 * (CURVATURE_TITLE + down - bar)
    content += shifted(_bar(marks, "curvature × tip radius", bar), right + 14.0, middle)
    return drawing(right + BAR_ROOM, down + 10.0, content)


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


def _without_lids(surface: Surface, near: NearestPoint, tip_radius: float) -> Surface:
    """The faces that a ball can rest on: one wider than the ball whose longest edge leaves the base closes a hole."""
    corners = surface.vertices[surface.faces]
    others = np.roll(corners, 1, axis=1)
    edges = np.linalg.norm(corners - others, axis=2)
    wide, longest = np.flatnonzero(edges.max(axis=1) > 2.0 * tip_radius), edges.argmax(axis=1)
    middles = 0.5 * (corners + others)[wide, longest[wide]]
    off = near.query(middles).distance > LID_SAGITTA * tip_radius
    return Surface(surface.vertices, np.delete(surface.faces, wide[off], axis=0))


def _without_spikes(surface: Surface, near: NearestPoint, allowed: float) -> Surface:
    """The faces none of whose corners is further off the base than any feature: where sweeps end, balls far apart meet
    beside the body."""
    off = near.query(surface.vertices).distance > allowed
    kept = ~off[surface.faces].any(axis=1)
    return Surface(surface.vertices, surface.faces[kept]) if kept.any() else surface


def _without_tears(surface: Surface, tip_radius: float) -> tuple[Surface, list[IntArray]]:
    """A fan over each hole whose rim is shorter than the ball's girth, which the ball does not pass.

    Returns:
        The surface, with one more vertex for each hole, and the vertices of their rims.
    """
    sides = np.concatenate([surface.faces, np.roll(surface.faces, -1, axis=1)]).reshape(2, -1).T
    _, which, times = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True)
    vertices, faces = [surface.vertices], [surface.faces]
    rims: list[IntArray] = []
    for rim in _rims(sides[times[which.ravel()] == 1]):
        ends = surface.vertices[rim]
        if np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() < 2.0 * np.pi * tip_radius:
            faces.append(np.column_stack([rim[:, ::-1], np.full(len(rim), len(surface.vertices) + len(rims))]))
            vertices.append(ends[:, 0].mean(axis=0, keepdims=True))
            rims.append(rim[:, 0])
    return Surface(np.concatenate(vertices), np.concatenate(faces)), rims


def _rims(sides: IntArray) -> list[IntArray]:
    """The closed ones among directed sides (N, 2) that have a face to one hand only, each in its order.

    None passes a place twice: where two holes, or a hole and the border, meet in a corner they are two.
    """
    after: dict[int, list[int]] = {}
    for begin, end in sides.tolist():
        after.setdefault(begin, []).append(end)
    rims = []
    for first in list(after):
        while after[first]:
            path, place = [first], first
            while after.get(place):
                place = after[place].pop()
                if place in path:
                    loop = path[path.index(place) :]
                    rims.append(np.column_stack([loop, np.roll(loop, -1)]))
                    del path[path.index(place) + 1 :]
                else:
                    path.append(place)
    return rims


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
