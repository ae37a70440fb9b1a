"""Picture of the object: its base, the sweeps over it, and the features found, seen by rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from explore3d.pictures.camera import Camera
from explore3d.pictures.chart import drawing, image, number, pixels_png, stroke, text_at, text_width
from explore3d.pictures.figure import INK
from explore3d.pictures.render import Body, Picture, render
from explore3d.pictures.sweep_paths import SweepPath, densified
from mapping import Feature, FloatArray, Surface, length_text
from mapping.geometry.contact import BallContact
from mapping.geometry.mesh import resample
from mapping.inference.kinds import kind_of
from mapping.model import drawn_at_least, feature_mesh

# Width of a picture of one panel, and of each of two in a row, pixels; and the most that a panel is high for its width.
WIDTHS = {1: 1080, 2: 760}
PANELS_PER_ROW = 2
TALLEST = 0.8
SUPERSAMPLING = 2
PICTURE_BASE_COLOUR = np.array([0.86, 0.88, 0.91])
QUIET = np.array([0.42, 0.52, 0.62])
LOUD = np.array([0.93, 0.55, 0.13])
# Features are drawn at least so many pixels wide, or nobody would see them.
LEAST_FEATURE_PIXELS = 5.0
# Size of the words in a picture, and how high a label is, px
LABEL_SIZE = 13.0
LABEL_HEIGHT = 18.0
# Height of the strip below a view that its scale bar stands in, px
SCALE_STRIP = 24.0
# A label stands at most so many rows above or below its place. What it costs to cover a place of something found, or a
# line that leads to another label, in px that the label would rather be farther away; and another label, which is
# covered only where nothing else is possible
LABEL_ROWS, ON_FOUND, ON_LABEL = 9, 40.0, 1e4
FOUND_AIR = 7.0  # px about a found line that are its own
# Places along a found line, along the line to a label, and about a label, for what covers what
DRAWN_PLACES, LEAD_PLACES = 41, 12
LABEL_PLACES = np.array([[x, y] for x in np.linspace(0.0, 1.0, 9) for y in (0.0, 0.5, 1.0)])
# Views of a closed body: from so many sides, a little from above, steeply from above, from below; at most so many
AZIMUTHS, MOST_VIEWS = 16, 4
VIEW_HEIGHTS = (0.45, 1.3, -0.45)
FIRST_AZIMUTH = -0.25 * np.pi - 0.5
# Two views beside each other count less, by so much of a feature that is seen squarely; one from an unusual height, too
BESIDE_EACH_OTHER, LOWERED = 0.2, 0.3
SEEN_PLACES = 7  # along a line
WELL_SEEN = 0.6  # of as squarely as any view shows a feature, one of those taken shows it at least
# A line of sight is so wide, in sizes of the body; flatter than this cosine nobody makes out a detail
SIGHT_SHARE, LEAST_FACING = 1e-3, 0.25
# A body that leans less than this, 3 degrees, is looked at as a level one: a step of 1 mm leans the estimated surface
# of a plate of 60 mm by 0.017 in the mean, and its maps would be seen from another side than the body
LEANING = 0.05
# A body whose outward directions cancel more than this is round: it needs two views.
ROUND = 0.45


def object_picture(base: Surface, features: Sequence[Feature], sweeps: Sequence[SweepPath]) -> bytes:
    """SVG of the base with sweeps and features; views round a round body until every feature was in sight.

    What the sweeps noticed is drawn in orange.
    """
    normals = np.concatenate([np.zeros((0, 3)), *(path.normals for path in sweeps)])
    shown = _close_up(base, np.concatenate([np.zeros((0, 3)), *(path.points for path in sweeps)]))
    cameras = cameras_for(shown, view_directions(normals, features, base, shown))
    content, right, down = "", 0.0, 0.0
    for first in range(0, len(cameras), PANELS_PER_ROW):
        left, row = 0.0, cameras[first : first + PANELS_PER_ROW]
        for camera in row:
            content += shifted(_drawn(_scene(base, features, camera, sweeps), features), left, down)
            left += camera.width / SUPERSAMPLING
        right, down = max(right, left), down + max(camera.height for camera in row) / SUPERSAMPLING + SCALE_STRIP
    return drawing(right, down, content)


def pixel_size(camera: Camera) -> float:
    """Size of a pixel at the distance of the camera's target, m."""
    return camera.pixel * float(np.linalg.norm(camera.eye - camera.target))


def cameras_for(points: FloatArray, directions: Sequence[FloatArray]) -> list[Camera]:
    """One camera a panel, each against a direction, that show all points (N, 3)."""
    width = WIDTHS[min(len(directions), PANELS_PER_ROW)] * SUPERSAMPLING
    return [Camera.facing(points, each, width, round(TALLEST * width)) for each in directions]


def shifted(content: str, left: float, top: float = 0.0) -> str:
    """A part of a drawing, moved to the right and down, px."""
    return f'<g transform="translate({number(left)} {number(top)})">{content}</g>'


def view_directions(
    normals: FloatArray, features: Sequence[Feature], base: Surface, shown: FloatArray | None = None
) -> list[FloatArray]:
    """Directions towards the camera: one, oblique, over a flat body; two or more round a closed body.

    Args:
        normals: (N, 3) outward, of the parts that are to be seen.
        features: as many views are taken, up to MOST_VIEWS, as it needs for each of them to be well in sight.
        base: what may stand before them.
        shown: (P, 3) what the pictures have room for, m; None: the base.
    """
    mean = normals.mean(axis=0) if len(normals) else np.array([0.0, 0.0, 1.0])
    if np.linalg.norm(mean) > ROUND:
        mean = mean / np.linalg.norm(mean)
        if np.hypot(*mean[:2]) < LEANING:
            mean = np.array([0.0, 0.0, np.sign(mean[2])])
        across = np.cross(np.array([0.0, 0.0, 1.0]), mean)
        across = across / np.linalg.norm(across) if across.any() else np.array([1.0, 0.0, 0.0])
        down = np.cross(mean, across)
        return [np.asarray(mean - 0.75 * down * np.sign(down[2] or 1.0) + 0.35 * across)]
    if not features:
        first = np.array([np.cos(FIRST_AZIMUTH), np.sin(FIRST_AZIMUTH), VIEW_HEIGHTS[0]])
        return [first, first * [-1.0, -1.0, 1.0]]
    azimuths = np.linspace(0.0, 2.0 * np.pi, AZIMUTHS, endpoint=False)
    wishes = np.array([[np.cos(angle), np.sin(angle), height] for height in VIEW_HEIGHTS for angle in azimuths])
    room = base.vertices[np.unique(base.faces)] if shown is None else shown
    facing, whole = _facing(np.array([camera.eye for camera in cameras_for(room, list(wishes))]), features, base)
    # of two views: those that show most of the features, and most of each in one of them, then as squarely as may be,
    # from opposite sides, from above
    both = np.maximum(facing[:, None], facing[None])
    shown = np.maximum(whole[:, None], whole[None]).sum(axis=2)
    beside = wishes[:, :2] @ wishes[:, :2].T
    lower = LOWERED * (wishes[:, 2] != VIEW_HEIGHTS[0])
    merit = len(features) * ((both > 0.0).sum(axis=2) + shown) + both.sum(axis=2) - BESIDE_EACH_OTHER * beside
    chosen = list(np.unravel_index((merit - lower[:, None] - lower[None]).argmax(), merit.shape))
    # more of them while a feature is seen only at a slant, or in part, that another view shows
    squarely = WELL_SEEN * facing.max(axis=0)
    while len(chosen) < MOST_VIEWS and (slanted := facing[chosen].max(axis=0) < squarely).any():
        well = facing[:, slanted] >= squarely[slanted]
        chosen.append(np.lexsort([facing[:, slanted].sum(axis=1), well.sum(axis=1)])[-1])
    return list(wishes[chosen])


def _facing(eyes: FloatArray, features: Sequence[Feature], base: Surface) -> tuple[FloatArray, FloatArray]:
    """(E, F) how squarely features are seen from eyes (E, 3), and what share of each is in sight.

    Eyes, not directions: a picture is taken from some two sizes of the body away, where a near part of it hides what
    would be seen past it from afar, such as a bump in the hole of a ring.

    Cosines, 0 where a feature is out of sight: of a line the mean over places along it; it is out of sight where its
    middle is, which bears its label.
    """
    places = np.concatenate([resample(feature.axis, SEEN_PLACES) for feature in features])
    nearest = [
        np.linalg.norm(feature.axis[:, None] - resample(feature.axis, SEEN_PLACES), axis=2).argmin(axis=0)
        for feature in features
    ]
    normals = np.concatenate([feature.normals[each] for feature, each in zip(features, nearest, strict=True)])
    # a line of sight is the way of a small ball from the place to the camera
    size = SIGHT_SHARE * base.size
    starts = places + 2.0 * size * normals
    ways = eyes[:, None] - starts
    ways = ways / np.linalg.norm(ways, axis=2, keepdims=True)
    found = BallContact(base, size).first_contact(np.tile(starts, (len(eyes), 1)), ways.reshape(-1, 3))
    cosines = np.einsum("epk,pk->ep", ways, normals)
    free = ((found.count == 0) & ~found.overlap).reshape(cosines.shape) & (cosines > LEAST_FACING)
    seen = np.where(free, cosines, 0.0).reshape(len(eyes), len(features), SEEN_PLACES)
    in_sight = seen[:, :, SEEN_PLACES // 2] > 0.0
    return np.where(in_sight, seen.mean(axis=2), 0.0), np.where(in_sight, (seen > 0.0).mean(axis=2), 0.0)


def _close_up(base: Surface, feet: FloatArray) -> FloatArray:
    """What the camera must show: the base, or the explored part if that is much smaller."""
    corners = base.vertices[np.unique(base.faces)]
    explored = np.stack([feet.min(axis=0), feet.max(axis=0)]) if len(feet) else corners
    if np.linalg.norm(np.ptp(explored, axis=0)) > 0.4 * base.size or len(feet) == 0:
        return corners
    middle, reach = explored.mean(axis=0), 0.6 * np.linalg.norm(np.ptp(explored, axis=0))
    return np.asarray(middle + reach * (np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)))


def _scene(base: Surface, features: Sequence[Feature], camera: Camera, sweeps: Sequence[SweepPath]) -> Picture:
    pixel = pixel_size(camera)
    bodies = [Body(base, PICTURE_BASE_COLOUR)]
    for feature in features:
        colour = np.array(kind_of(feature).colour[:3])
        bodies.append(Body(feature_mesh(drawn_at_least(feature, LEAST_FEATURE_PIXELS * SUPERSAMPLING * pixel)), colour))
    picture = render(bodies, camera)
    for path in sweeps:
        line = densified(path.points + 2.0 * pixel * path.normals, 0.5 * pixel)
        picture.splat(line, QUIET, 1.3, 3.0 * pixel)
    for path in sweeps:
        for part in np.split(np.arange(len(path.points)), np.flatnonzero(np.diff(path.noticed)) + 1):
            if path.noticed[part].all():
                line = densified(path.points[part] + 2.0 * pixel * path.normals[part], 0.5 * pixel)
                picture.splat(line, LOUD, 2.4, 3.0 * pixel)
    return picture


def pictured(picture: Picture) -> str:
    """The pixels as a part of a drawing."""
    size = picture.camera.width / SUPERSAMPLING, picture.camera.height / SUPERSAMPLING
    return image(pixels_png(picture.reduced(SUPERSAMPLING)), 0.0, 0.0, *size)


def _drawn(picture: Picture, features: Sequence[Feature]) -> str:
    """The pixels with the features' names beside them, and a scale bar below."""
    content = pictured(picture)
    width, height = picture.camera.width / SUPERSAMPLING, picture.camera.height / SUPERSAMPLING
    crests = [_crest(feature) for feature in features]
    lines = [_in_sight(picture, resample(crest, DRAWN_PLACES)) for crest in crests]
    taken: list[Label] = []
    for feature, crest, line in zip(features, crests, lines, strict=True):
        # a part of a line that is in sight bears its name, the nearest to its middle
        if not len(line):
            continue
        middle = picture.camera.project(crest[len(crest) // 2][None])[0][0] / SUPERSAMPLING
        place = line[np.linalg.norm(line - middle, axis=1).argmin()]
        words = f"{feature.id}  {feature.height.text()[0]}"
        wide = text_width(words, LABEL_SIZE) + 6.0
        label = placed(place, wide, np.concatenate(lines), taken, (width, height))
        taken.append(label)
        content += stroke(
            f"M{number(place[0])} {number(place[1])}L{number(label.foot[0])} {number(label.foot[1])}", INK, 0.8
        )
        content += (
            f'<rect x="{number(label.left)}" y="{number(label.top)}" width="{number(wide)}" height="{LABEL_HEIGHT:g}" '
            'rx="3" fill="#fff" opacity="0.85"/>'
        )
        # words may be narrower than the box: they begin, or end, where the line meets it
        leads_left = label.foot[0] == label.left
        edge = label.left + 3.0 if leads_left else label.left + wide - 3.0
        content += text_at(edge, label.top + 13.0, words, size=LABEL_SIZE, anchor="start" if leads_left else "end")
    return content + _scale_bar(picture.camera)


def _crest(feature: Feature) -> FloatArray:
    """(K, 3) places of the line or spot that stand out, m: a wide bump hides its own foot."""
    reference = feature.axis if len(feature.axis) > 1 or feature.anchor is None else feature.anchor.position[None]
    return np.asarray(reference + max(feature.height.median, 0.0) * feature.normals)


def _in_sight(picture: Picture, places: FloatArray) -> FloatArray:
    """(N, 2) where those of the places (K, 3) that nothing hides are in the picture, px."""
    pixels, depth = picture.camera.project(places)
    column, row = np.rint(pixels).astype(int).T
    inside = (row >= 0) & (row < picture.depth.shape[0]) & (column >= 0) & (column < picture.depth.shape[1])
    before = np.zeros(len(places), dtype=bool)
    before[inside] = depth[inside] <= 1.02 * picture.depth[row[inside], column[inside]]
    return np.asarray(pixels[before] / SUPERSAMPLING)


@dataclass(frozen=True, eq=False)
class Label:
    """Where a label stands, px: its box, and the line that leads to it from its place (2,).

    Args:
        left, top, wide: of the box, which is LABEL_HEIGHT high.
        place: that it names.
    """

    left: float
    top: float
    wide: float
    place: FloatArray

    @property
    def foot(self) -> FloatArray:
        """(2,) where the line meets the box: on the side that is nearer."""
        right = self.left + self.wide
        nearer = self.left if abs(self.place[0] - self.left) < abs(self.place[0] - right) else right
        return np.array([nearer, self.top + 0.5 * LABEL_HEIGHT])

    def lead(self) -> FloatArray:
        """(N, 2) places along the line."""
        return self.place + np.linspace(0.0, 1.0, LEAD_PLACES)[:, None] * (self.foot - self.place)

    def covers(self, places: FloatArray, air: float) -> int:
        """How many of the places (N, 2) lie on the box, or so near to it, px."""
        x, y = places.T - np.array([[self.left], [self.top]])
        return int(((x > -air) & (x < self.wide + air) & (y > -air) & (y < LABEL_HEIGHT + air)).sum())


def placed(
    place: FloatArray, wide: float, lines: FloatArray, taken: Sequence[Label], size: tuple[float, float]
) -> Label:
    """A label for a place (2,): near it, on no other label or its line, on as little as may be of what is found.

    Args:
        wide: of the label, px.
        lines: (N, 2) places of all that was found and is in sight, px.
        taken: labels that stand already.
        size: width and height of the picture, px.
    """
    x, y = place
    lefts = [x + 30.0, x - 30.0 - wide, x + 80.0, x - 80.0 - wide]
    tops = y - 0.5 * LABEL_HEIGHT + LABEL_HEIGHT * np.arange(-LABEL_ROWS, LABEL_ROWS + 1)
    best, least = None, np.inf
    for left in lefts:
        for top in tops:
            inside = min(max(left, 2.0), size[0] - wide - 2.0), min(max(top, 2.0), size[1] - LABEL_HEIGHT - 2.0)
            label = Label(*inside, wide, place)
            lead = label.lead()
            cost = float(np.linalg.norm(label.foot - place)) + ON_FOUND * label.covers(lines, FOUND_AIR)
            for other in taken:
                corners = np.array([[other.left, other.top]]) + LABEL_PLACES * [other.wide, LABEL_HEIGHT]
                on_label = label.covers(corners, 2.0) + other.covers(lead, 1.0)
                on_lead = label.covers(other.lead(), 1.0) + _crossed(lead, other.lead())
                cost += ON_LABEL * on_label + ON_FOUND * on_lead
            if cost < least:
                best, least = label, cost
    assert best is not None  # there are places to try
    return best


def _crossed(one: FloatArray, other: FloatArray) -> bool:
    """True if two straight lines, each of places (N, 2), cross."""
    a, b, c, d = one[0], one[-1], other[0], other[-1]

    def side(p: FloatArray, q: FloatArray, r: FloatArray) -> bool:
        return bool((q[0] - p[0]) * (r[1] - p[1]) > (q[1] - p[1]) * (r[0] - p[0]))

    return side(a, b, c) != side(a, b, d) and side(c, d, a) != side(c, d, b)


def round_length(camera: Camera) -> tuple[float, float]:
    """A round length at the distance of the camera's target, about a sixth of the picture wide: in m, and in px."""
    pixel = SUPERSAMPLING * pixel_size(camera)
    wish = 0.16 * camera.width / SUPERSAMPLING * pixel
    power = 10.0 ** np.floor(np.log10(wish))
    length = float(max(step for step in (1.0, 2.0, 5.0) if step * power <= wish) * power)
    return length, length / pixel


def _scale_bar(camera: Camera) -> str:
    """In a strip of its own, below the pixels."""
    length, wide = round_length(camera)
    left, row = 0.03 * camera.width / SUPERSAMPLING, camera.height / SUPERSAMPLING + 0.5 * SCALE_STRIP
    bar = stroke(f"M{number(left)} {number(row)}h{number(wide)}", INK, 3.0)
    return bar + text_at(left + wide + 8.0, row + 0.35 * LABEL_SIZE, length_text(length), size=LABEL_SIZE)
