"""Plateaus: neighbouring sweeps that leave the base's level and come back to it side by side are on one floor or top.

No sweep crosses the walls that run along the sweeps; but each sweep over the floor tells its own depth, by what it felt
before and behind, and the sweeps beside that stay on the base tell where it ends. All four walls of a pocket or boss
are those of one hollow or ridge with a flat bottom or top.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapping import Details, Feature, FloatArray, Interval
from mapping.assembly.lines import FULL_HEIGHT, Around
from mapping.assembly.linking import HEIGHT_RATIO
from mapping.assembly.points import evidence
from mapping.detection import Crossing
from mapping.inference.kinds import kind_made_of

# Steps up and down on one sweep that differ in height by no more than this factor bound one level; 1.2 and 2 are alike
# over 8 pockets and bosses of random sizes (4 to 9 mm, 0.1 to 0.6 mm deep, rows 0.6 to 1.2 mm apart)
ALIKE_STEPS = 1.4
# Sweeps no further apart than so many pitches are neighbours: the next but one is 2 away
NEXT_SWEEP = 1.5
# Cosine of the angle between sweeps that run side by side
ALONGSIDE = 0.9
# Rectangles about a rim are tried turned by so many degrees, and one along the sweeps is left for a smaller one by so
# much: about the rim of a round one all are alike
TURNS, SMALLER = 5.0, 0.95
# Sweeps at the full height, at least: a single one may be on the crest of a line that runs along it (see `runs`)
FEWEST_FULL = 2


@dataclass(frozen=True, eq=False)
class Span:
    """A stretch of one sweep on another level: from the step that leads there to the one that leads back."""

    first: Crossing
    last: Crossing

    @property
    def height(self) -> float:
        """Signed height over the base, m."""
        up = 1.0 if self.first.kind == "step up" else -1.0
        return up * 0.5 * (abs(self.first.height) + abs(self.last.height))

    @property
    def middle(self) -> FloatArray:
        return 0.5 * (self.first.point + self.last.point)

    @property
    def chord(self) -> FloatArray:
        return self.last.point - self.first.point

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.chord))


@dataclass(frozen=True, eq=False)
class Plateau:
    """A hollow with a flat bottom or a ridge with a flat top, as the spans of sweeps show it.

    Args:
        feature: with its axis along the longer side.
        aside: (3,) direction of the shorter side.
    """

    feature: Feature
    aside: FloatArray

    def rounds(self, crossing: Crossing, pitch: float, tip_radius: float) -> bool:
        """True of what a sweep felt where the ball goes round the rim: lower than the plateau, beside its walls.

        What stands there besides is still found, by what it leaves over (see `accounted`).
        """
        top, axis = abs(self.feature.height.median), self.feature.axis
        offset = crossing.point - axis.mean(axis=0)
        way = (axis[-1] - axis[0]) / self.feature.length.median
        beyond = max(abs(offset @ way) - 0.5 * self.feature.length.median,
                     abs(offset @ self.aside) - 0.5 * self.feature.width.median)  # fmt: skip
        out = float(np.sign(self.feature.height.median)) * beyond
        return abs(crossing.height) < FULL_HEIGHT * top and -pitch < out < pitch + float(
            np.sqrt(2.0 * tip_radius * top)
        )


def plateau_features(crossings: Sequence[Crossing], around: Around) -> tuple[list[Feature], tuple[Crossing, ...]]:
    """Hollows with a flat bottom and ridges with a flat top whose ends sweeps passed by, and the crossings that are
    parts of none."""
    pitch, tip = around.inspection.pitch, around.tip_radius
    # at a wall higher than its radius the ball drops: the trace is no smooth function of where that stands, and each
    # sweep shows it between two samples (`free_sections`)
    spans = [span for span in _spans(crossings) if _off_base(span, around) and abs(span.height) < tip]
    plateaus, used = list[Plateau](), set[int]()
    for group in _side_by_side(spans, pitch):
        plateau = _plateau(group, around)
        if plateau is not None:
            plateaus.append(plateau)
            used |= {id(c) for span in group for c in (span.first, span.last)}
    rest = tuple(c for c in crossings if id(c) not in used and not any(each.rounds(c, pitch, tip) for each in plateaus))
    return [plateau.feature for plateau in plateaus], rest


def across_sweeps(crossings: Sequence[Crossing], around: Around) -> set[int]:
    """Identities of the steps that sweeps side by side felt on a plateau that goes on beyond them on both sides.

    It runs across them: none ran along a line there (see `runs`).
    """
    spans = [span for span in _spans(crossings) if _off_base(span, around)]
    groups = [group for group in _side_by_side(spans, around.inspection.pitch) if not any(_ended(group, around))]
    wide = [group for group in groups if len({span.first.sweep for span in _full(group)}) >= FEWEST_FULL]
    return {id(c) for group in wide for span in group for c in (span.first, span.last)}


def _spans(crossings: Sequence[Crossing]) -> list[Span]:
    """Of each sweep the steps of opposite ways and like heights that follow each other."""
    by_sweep: dict[int, list[Crossing]] = {}
    for c in crossings:
        if c.is_step:
            by_sweep.setdefault(c.sweep, []).append(c)
    spans = []
    for steps in by_sweep.values():
        left = sorted(steps, key=lambda c: c.t)
        while len(left) > 1:
            first, last = left[0], left[1]
            low, high = sorted((abs(first.height), abs(last.height)))
            if first.kind != last.kind and high < ALIKE_STEPS * low:
                spans.append(Span(first, last))
                left = left[1:]
            left = left[1:]
    return spans


def _off_base(span: Span, around: Around) -> bool:
    """True if the stretch between the steps is what stands off the base, not what lies beside it."""
    own = around.inspection.of_sweep(span.first.sweep)
    along = (around.inspection.points[own] - span.first.point) @ span.chord / max(span.length, 1e-300) ** 2
    between = around.inspection.height[own][(along > 0.0) & (along < 1.0)]
    return bool(len(between) and np.median(between) / span.height > 0.5)


def _side_by_side(spans: Sequence[Span], pitch: float) -> list[list[Span]]:
    """Groups of spans on sweeps side by side, of one sign, that overlap."""
    parent = list(range(len(spans)))

    def root(i: int) -> int:
        while parent[i] != i:
            i = parent[i]
        return i

    for i, one in enumerate(spans):
        for j in range(i):
            if root(i) != root(j) and _are_neighbours(one, spans[j], pitch):
                parent[root(i)] = root(j)
    groups: dict[int, list[Span]] = {}
    for i, span in enumerate(spans):
        groups.setdefault(root(i), []).append(span)
    return list(groups.values())


def _are_neighbours(one: Span, other: Span, pitch: float) -> bool:
    short, long = sorted((one, other), key=lambda span: span.length)
    low, high = sorted((abs(one.height), abs(other.height)))
    if one.first.sweep == other.first.sweep or one.height * other.height < 0.0 or low < HEIGHT_RATIO * high:
        return False
    way = long.chord / max(long.length, 1e-300)
    if abs(short.chord @ way) < ALONGSIDE * short.length:
        return False
    offset = short.middle - long.middle
    along = float(offset @ way)
    return abs(along) < 0.5 * long.length and float(np.linalg.norm(offset - along * way)) < NEXT_SWEEP * pitch


def _plateau(group: list[Span], around: Around) -> Plateau | None:
    """The hollow or ridge that spans side by side are of; None if a sweep beside either end does not show that it ends.

    It lies along its longer side; how square or round its ends are, the posterior says.
    """
    full = _full(group)
    if len({span.first.sweep for span in full}) < FEWEST_FULL or not all(_ended(group, around)):
        return None
    longest = max(full, key=lambda span: span.length)
    normal, way = longest.first.normal, longest.chord / longest.length
    aside = np.cross(normal, way)
    sign, pitch = float(np.sign(longest.height)), around.inspection.pitch
    outline = _outline(group, full, longest.middle, np.stack([way, aside]), around)
    middle, sides, (length, width) = _rectangle(outline)
    line, centre = (each @ np.stack([way, aside]) for each in (sides, middle))
    axis = longest.middle + centre + 0.5 * length * np.array([[-1.0], [1.0]]) * line
    feet = around.base.foot(axis + around.tip_radius * normal, around.tip_radius)
    members = [c for span in group for c in (span.first, span.last)]
    sd = float(np.median([c.height_sd for c in members]) / np.sqrt(len(full)))
    doubt = pitch + 0.5 * float(np.median([c.half_width for c in members]))
    feature = Feature(
        kind=kind_made_of("convex" if sign > 0 else "concave", line=True).name,
        axis=feet.points,
        normals=feet.normals,
        height=Interval.normal(sign * float(np.median([abs(span.height) for span in full])), sd),
        width=Interval(width, max(width - doubt, 0.0), width + doubt),
        length=Interval(length, max(length - doubt, 0.0), length + doubt),
        evidence=evidence(members, around.detections),
        curvature_feature=any(c.curvature_feature for c in members),
        position_sd=float(np.median([c.position_sd for c in members])),
        details=Details(top=width, run=0.0, end_rounding=0.0) if sign > 0 else Details(end_rounding=0.0),
    )
    return Plateau(feature, np.cross(normal, line))


def _outline(
    group: Sequence[Span], full: Sequence[Span], middle: FloatArray, frame: FloatArray, around: Around
) -> FloatArray:
    """(M, 2) places on the rim, along and across the sweeps, m: where full spans end; and to either side where the ball
    that goes round the rim says, or half-way to the next sweep.

    Args:
        group, full: the spans, and those at the full height.
        middle: (3,) m.
        frame: (2, 3) directions along and across the sweeps.
        around: pitch and tip.
    """

    def ends(span: Span) -> FloatArray:
        return np.array([c.point - middle for c in (span.first, span.last)]) @ frame.T

    rim, sides = [ends(span) for span in full], [0, 0]
    across = [float(ends(span)[:, 1].mean()) for span in full]
    top, out = float(np.median([abs(span.height) for span in full])), float(np.sign(full[0].height))
    for span in group:
        at = ends(span)
        side = int(at[:, 1].mean() > max(across)) - int(at[:, 1].mean() < min(across))
        if side and span not in full:
            # the ball touches the rim beside it: outside of a ridge's, inside of a hollow's
            drop = top - abs(span.height) if out > 0.0 else abs(span.height)
            away = float(np.sqrt(2.0 * around.tip_radius * max(drop, 0.0)))
            rim.append(at - np.array([0.0, side * out * away]))
            sides[side > 0] += 1
    for side, span, known in zip(
        (-1, 1), (full[int(np.argmin(across))], full[int(np.argmax(across))]), sides, strict=True
    ):
        if not known:
            rim.append(ends(span) + np.array([0.0, 0.5 * side * around.inspection.pitch]))
    return np.concatenate(rim)


def _rectangle(outline: FloatArray) -> tuple[FloatArray, FloatArray, tuple[float, float]]:
    """Middle (2,), direction (2,) of the longer side, and lengths of both sides of the smallest rectangle about places
    (M, 2), m."""
    best = None
    for turn in np.radians(np.arange(0.0, 90.0, TURNS)):
        sides = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        low, high = (outline @ sides.T).min(axis=0), (outline @ sides.T).max(axis=0)
        size = high - low
        if best is None or size.prod() < SMALLER * best[0]:
            k = int(size.argmax())
            best = size.prod(), 0.5 * (low + high) @ sides, sides[k], (float(size[k]), float(size[1 - k]))
    assert best is not None  # there are turns
    return best[1:]


def _full(group: Sequence[Span]) -> list[Span]:
    """Those at the height of most of them: sweeps beside a wall are held by its rim."""
    top = float(np.quantile([abs(span.height) for span in group], 0.8))
    return [span for span in group if abs(span.height) > FULL_HEIGHT * top]


def _ended(group: Sequence[Span], around: Around) -> tuple[bool, bool]:
    """Of both sides of spans side by side whether sweeps were felt to be back on the base there."""
    full = _full(group)
    longest = max(full, key=lambda span: span.length)
    aside = np.cross(longest.first.normal, longest.chord / longest.length)
    across = [float((span.middle - longest.middle) @ aside) for span in full]
    height = float(np.median([span.height for span in full]))
    low, high = full[int(np.argmin(across))], full[int(np.argmax(across))]
    return _ends(low, -aside, height, around), _ends(high, aside, height, around)


def _ends(outermost: Span, aside: FloatArray, height: float, around: Around) -> bool:
    """True if a sweep beside the outermost span was felt below half of the height all along its middle half: up to
    where the ball that touches its wall comes down, and one sweep more. A line at a slant goes on beside a part of it.
    """
    inspection = around.inspection
    reach = NEXT_SWEEP * inspection.pitch + float(np.sqrt(2.0 * around.tip_radius * abs(height)))
    near = inspection.near(outermost.middle + np.array([[-0.25], [0.25]]) * outermost.chord, reach)
    offset = inspection.points[near] - outermost.middle
    out, along = offset @ aside, offset @ outermost.chord / outermost.length**2
    beside = (out > 0.5 * inspection.pitch) & (out < reach) & (np.abs(along) < 0.25)
    low = inspection.height[near] / height < 0.5
    own = [low[beside & (inspection.sweep[near] == number)] for number in np.unique(inspection.sweep[near[beside]])]
    return any(len(each) > 1 and bool(each.all()) for each in own)
