"""Proposals: what else the trace of a neighbourhood may mean. A bad one costs time, never correctness.

Each generator takes a fitted configuration and yields lists of parts; the evidence alone decides.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mapping import BoolArray, Feature, FloatArray, Interval, MappingError, Support
from mapping.geometry.mesh import arclengths, distances, middle, nearest_on
from mapping.inference.configuration.configuration import (
    HOPELESS,
    PEAK_SDS,
    Configuration,
    Part,
    about,
    as_bar,
    as_bell,
    as_frustum,
    as_slanted,
    as_smooth,
    as_twin,
    laid,
    part_of,
)
from mapping.inference.configuration.neighbourhood import NEIGHBOURHOOD_REACH, Neighbourhood
from mapping.inference.configuration.pursuit import pursued
from mapping.inference.curves import HIGHEST_DEGREE, ends_on_face
from mapping.inference.families import (
    BellRidgeShape,
    BellShape,
    BumpShape,
    GrooveShape,
    RidgeShape,
    SmoothGrooveShape,
    StepShape,
    TrapezoidShape,
    TwinShape,
    smooth_groove_beside,
)
from mapping.inference.kinds import kind_made_of, kind_of, sizes_of

Parts = list[Part]
# Tops and runs of the flanks of what has a flat top (None: upright), in half-widths of the disturbance, that its
# optimum is searched from: no descent leads from flanks that are never touched to such as are. Gaps of a twin likewise
FLATS, GAPS = ((0.5, None), (0.1, 0.6)), (0.2, 0.7)
# Half widths of what runs out, in those of the disturbance, that its optimum is searched from
SKIRTS = (0.3, 0.8)
# Points so near to a straight line, in half-widths, may be of it
ON_LINE = 0.35
# Half of a line that may be meant instead of a point, in half-widths of its disturbance
SHORT_LINE = 0.3
# A line no longer than that, in half-widths of its disturbance, may be a point: twice that is as long as it is wide,
# and its ends are known to a tenth of that at least
AS_WIDE = 2.2
# Two points that may be meant instead of one lie so many of its half-widths to either side
POINTS_APART = 0.3
# A course whose ends lie no farther apart than this share of its length may be closed: three quarters of a circle's are
# 0.3 of it apart, half a circle's 0.64
CLOSING_GAP = 0.5
# Points of a leg that distances between lines are taken at
POINTS_OF_LEG = 65
# Half-widths by which a line goes on beyond what it is extended to: the end is sought from there. With 0.1 and 0.3
# three cracks with burrs of the building seeds are two ridges each; with 1 one of them is a single one, with a remark
EXTENDED = 0.3
# Points that two lines are drawn through, at least
FEWEST_POINTS = 4
# Logarithm by which the radius of a crest exceeds a wire's where the thin one is asked as well: the prior's scale
THINNER = 1.0
# Degrees that a line's course is asked to have instead of a higher one. Each is half of the next, up to the highest: a
# line keeps at most twice the bends that it needs, and more odds are asked for only where the data pay for them
LOWER_DEGREES = (1, 2, 4, 8)
# Most points that straight lines are drawn through: two by two, which is the square of that
MOST_DRAWN_THROUGH = 60
# Answers that are fitted of those that gain most before a fit, unless they are hopeless already: of 87 answers on seven
# plates 50 were likelier than what was there after a fit, and lost 19 at most before it
MOST_RETOLD = 6


def sections(now: Configuration) -> Iterator[Parts]:
    """Another section of a line that is wider than a wire of its height: round, flat, running out, or two in one; a
    bump whose flank runs out or with a flat top, a groove whose walls do, and a step that climbs over a run."""
    for k, part in enumerate(now.parts):
        if isinstance(part.shape, BumpShape):
            half = sizes_of(part.feature, now.place.around.trace.tip_radius).half_width
            for share in SKIRTS:
                yield [*now.parts[:k], as_bell(part, share * half), *now.parts[k + 1 :]]
            for top, run in FLATS:
                flat = as_frustum(part, now.place, top * half, run and run * half)
                yield [*now.parts[:k], flat, *now.parts[k + 1 :]]
        if type(part.shape) is GrooveShape and not _has_crests_at_rims(part, now):
            yield [*now.parts[:k], as_smooth(now.parts, k, now.place), *now.parts[k + 1 :]]
        if isinstance(part.shape, StepShape) and not part.shape.slanted:
            yield [*now.parts[:k], as_slanted(now.parts, k, now.place), *now.parts[k + 1 :]]
        ridge = _ridge_of(part, now.place)
        if ridge is None or now.as_narrow_as_wires[k]:
            continue
        half = sizes_of(ridge.feature, now.place.around.trace.tip_radius).half_width
        others = [as_bar(ridge, now.place, top * half, run and run * half) for top, run in FLATS]
        others += [as_bell(ridge, share * half) for share in SKIRTS]
        others += [as_twin(ridge, now.place, share * half, lying=wires) for share in GAPS for wires in (False, True)]
        if not isinstance(part.shape, RidgeShape):
            others.append(ridge)
        for other in others:
            if type(other.shape) is not type(part.shape):
                yield [*now.parts[:k], other, *now.parts[k + 1 :]]


def _has_crests_at_rims(groove: Part, now: Configuration) -> bool:
    """True of a groove beside which crests run: what they leave walls that run out would say a second time."""
    lines = [part for part in now.parts if part is not groove and kind_of(part.feature).line]
    return any(kind_of(line.feature).sign > 0 and _faces(groove, line, now.place) for line in lines)


def without(now: Configuration) -> Iterator[Parts]:
    """One detail less."""
    for k in range(len(now.parts)):
        yield [*now.parts[:k], *now.parts[k + 1 :]]


def joined(now: Configuration) -> Iterator[Parts]:
    """Two details as one line: end to end, a line and a point that is more of it, or two lines side by side.

    The whole has the section of its pieces.
    """
    for one, other in itertools.combinations(range(len(now.parts)), 2):
        first, second = now.parts[one], now.parts[other]
        lines = [axis_of(first), axis_of(second)]
        rest = [part for k, part in enumerate(now.parts) if k not in (one, other)]
        made_of = kind_of(first.feature).made_of
        if made_of and made_of == kind_of(second.feature).made_of:
            whole = _straight_through(np.concatenate(lines))
            as_line = replace(first.feature, kind=kind_made_of(made_of, line=True).name)
            alike = {type(part.shape): part for part in (second, first) if kind_of(part.feature).line}
            for like in alike.values() or [replace(first, feature=as_line)]:
                yield [*rest, _alike(like, whole, now.place)]
                if min(len(line) for line in lines) == 1:  # a sweep that passes beyond an end feels it, too
                    short = _shortened(whole, lines[0 if len(lines[0]) == 1 else 1][0], like.feature, now.place)
                    yield [*rest, _alike(like, short, now.place)]
        if min(len(line) for line in lines) < 2:
            continue
        # the top between two edges may be wider than what each of them disturbs, where a crest's flanks meet
        edges = kind_of(first.feature).sided and kind_of(second.feature).sided
        if not _faces(first, second, now.place, NEIGHBOURHOOD_REACH if edges else 1.0):
            continue
        across = nearest_on(lines[0], lines[1])[0] - lines[0]
        middle, width = lines[0] + 0.5 * across, float(np.median(np.linalg.norm(across, axis=1)))
        if edges:
            felt = np.concatenate([axis_of(as_far_as_felt(part, now.place)) for part in (first, second)])
            middle = _beyond(felt, middle, sizes_of(first.feature, now.place.around.trace.tip_radius).half_width)
        height = 0.5 * (abs(first.feature.height.median) + abs(second.feature.height.median))
        for crossings in ("convex", "concave"):
            kind = kind_made_of(crossings, line=True)
            line = _line(_sized(first.feature, kind.name, kind.sign * height, width), middle, now.place)
            yield [*rest, line]
            if isinstance(line.shape, RidgeShape):
                yield [*rest, as_bar(line, now.place, width)]
                yield [*rest, as_twin(line, now.place, width)]


def chained(now: Configuration) -> Iterator[Parts]:
    """All pieces of one course as one line, open and closed: rows leave a ring in pieces where they run along it.

    The whole has the section of the piece that stands out most: another's would have to be found anew, and until it is
    the whole is less likely than the pieces. Pieces of a groove are asked as one whose walls run out, too: two upright
    ones that lie over each other at a slant leave more of its trace than one does. Not as a closed one: of a groove
    with ends whose course was laid badly that would be likelier than what it was laid as, and leads nowhere.
    """
    kinds = {kind_of(part.feature).made_of for part in now.parts} - {""}
    for made_of in sorted(kinds):
        if not kind_made_of(made_of, line=True).has_ends:
            continue
        alike = [k for k, part in enumerate(now.parts) if kind_of(part.feature).made_of == made_of]
        alike = [k for k in alike if not now.parts[k].feature.closed]
        course, used = _course_of([axis_of(now.parts[k]) for k in alike], now.place.half_width)
        if not used:
            continue
        pieces = [now.parts[alike[k]] for k in used]
        rest = [part for k, part in enumerate(now.parts) if k not in {alike[m] for m in used}]
        like = max(pieces, key=lambda piece: (kind_of(piece.feature).line, piece.feature.evidence.snr))
        crossings = sum(piece.feature.evidence.crossings for piece in pieces)
        support = replace(like.feature.evidence, crossings=crossings)
        like = replace(like, feature=replace(like.feature, evidence=support))
        courses = [course] if len(used) > 1 else []
        if _comes_near(course):
            courses.append(np.vstack([course, course[:1]]))
        for each, degree in itertools.product(courses, (*LOWER_DEGREES, HIGHEST_DEGREE)):
            try:
                line = _alike(like, each, now.place, degree, degree)
            except MappingError:  # pieces that are of no course: as smooth as that it turns back, or leaves the base
                continue
            yield [*rest, line]
            if type(line.shape) is GrooveShape and not line.feature.closed:
                yield [*rest, as_smooth([*rest, line], len(rest), now.place)]


def may_be_closed(part: Part) -> bool:
    """True of an open line that may return to where it began."""
    kind = kind_of(part.feature)
    return kind.line and kind.has_ends and not part.feature.closed and _comes_near(axis_of(part))


def _comes_near(course: FloatArray) -> bool:
    """True if a polyline (K, 3) ends where it may be closed."""
    return float(np.linalg.norm(course[-1] - course[0])) < CLOSING_GAP * float(arclengths(course)[-1])


def _course_of(axes: list[FloatArray], half_width: float) -> tuple[FloatArray, list[int]]:
    """Points (K, 3) evenly along the pieces of a course, and the numbers of these; none without a line.

    From the longest on, each time the piece and the end of the course that are nearest to each other, no farther apart
    than one of them is long. A piece that runs beside the course, nearer than both are felt together (half_width, m),
    is a part of it and leads nowhere.
    """
    lengths = [float(arclengths(axis)[-1]) for axis in axes]
    if not any(lengths):
        return np.zeros((0, 3)), []
    pieces = [_evenly(axis) for axis in axes]
    longest = int(np.argmax(lengths))
    course, used, last = pieces[longest], [longest], [longest, longest]  # the pieces that it begins and ends with
    while True:
        left = [k for k in range(len(pieces)) if k not in used]
        beside = [k for k in left if _runs_beside(pieces[k], course, half_width)]
        if beside:
            used += beside
            continue
        gaps = [
            (float(np.linalg.norm(pieces[k][-of] - course[-at])), k, of, at)
            for k, of, at in itertools.product(left, (0, 1), (0, 1))
        ]
        gap, nearest, of, at = min(gaps, default=(np.inf, longest, 0, 0))
        if gap > max(lengths[nearest], lengths[last[at]]):
            return _evenly(course), used
        onward = course if at else course[::-1]
        piece = pieces[nearest][::-1] if of else pieces[nearest]
        from_end = np.linalg.norm(piece - onward[-1], axis=1).argmin()  # what lies before it runs beside the course
        onward = np.vstack([onward, piece[from_end:]])
        course = onward if at else onward[::-1]
        used.append(nearest)
        last[at] = nearest


def _runs_beside(piece: FloatArray, course: FloatArray, reach: float) -> bool:
    """True of a point so near (m) to a course (K, 3), and of a line (M, 3) most of which is, but not beyond an end."""
    nearest, along = nearest_on(piece, course)
    away = np.linalg.norm(piece - nearest, axis=1)
    if len(piece) > 1:
        away[(along <= 0.0) | (along >= arclengths(course)[-1])] = np.inf
    return bool(np.median(away) < reach)


def _evenly(axis: FloatArray) -> FloatArray:
    """(POINTS_OF_LEG, 3) points along a polyline (K, 3), as far from one another; one point as it is."""
    s = arclengths(axis)
    apart = np.concatenate([[True], np.diff(s) > 0.0])
    if apart.sum() < 2:
        return axis[:1]
    even = np.linspace(0.0, s[-1], POINTS_OF_LEG)
    return np.column_stack([np.interp(even, s[apart], axis[apart, i]) for i in range(3)])


def between(now: Configuration) -> Iterator[Parts]:
    """A groove between two ridges that face each other, and a ridge along each rim of a groove."""
    for one, other in itertools.combinations(range(len(now.parts)), 2):
        first, second = (_ridge_of(now.parts[k], now.place) for k in (one, other))
        if first and second and _faces(first, second, now.place, NEIGHBOURHOOD_REACH):
            # what a hollow between them leaves is no part of their sections
            rest = [part for k, part in enumerate(now.parts) if k not in (one, other)]
            yield [*rest, first, second, _hollow(axis_of(first), axis_of(second), first.feature, now.place)]
    for k, part in enumerate(now.parts):
        if isinstance(part.shape, TwinShape):
            single = apart_of(part)
            hollow = _hollow(axis_of(single[0]), axis_of(single[1]), part.feature, now.place)
            yield [*now.parts[:k], *single, hollow, *now.parts[k + 1 :]]
        if type(part.shape) is GrooveShape:
            axis, width = axis_of(part), float(np.exp(part.start[-2]))
            aside = 0.5 * width * _lateral(part)
            height = 0.3 * abs(part.feature.height.median)
            burr = _sized(part.feature, kind_made_of("convex", line=True).name, height, height)
            yield [*now.parts, *(_line(burr, axis + side * aside, now.place) for side in (-1.0, 1.0))]


def apart(now: Configuration) -> Iterator[Parts]:
    """A twin as two lines that need not be alike, a point as two, and a line that is short, or leaves something over,
    as points where it ends."""
    for k, part in enumerate(now.parts):
        if isinstance(part.shape, TwinShape):
            yield [*now.parts[:k], *apart_of(part), *now.parts[k + 1 :]]
        if not kind_of(part.feature).line:
            spot, half = part.shape, sizes_of(part.feature, now.place.around.trace.tip_radius).half_width
            for way in spot.spot.axes:  # type: ignore[attr-defined]
                two = [
                    replace(part.feature, axis=axis_of(part) + side * POINTS_APART * half * way) for side in (-1.0, 1.0)
                ]
                rest = [*now.parts[:k], *now.parts[k + 1 :]]
                yield [*rest, *(part_of(_plainly(each), now.place) for each in two)]
        elif _is_crest(part) and (may_be_points(part, now.place) or not now.is_explained):
            own, ends = np.maximum(now.felt, 0.0), axis_of(part)[[0, -1]]
            away = np.linalg.norm(now.place.window.feet - ends[:, None], axis=2)
            points = [
                _felt_about(now, end, np.where(near, own, 0.0), part.feature)  # else both are the higher one
                for end, near in zip(ends, (away[0] < away[1], away[1] <= away[0]), strict=True)
            ]
            yield [*now.parts[:k], *points, *now.parts[k + 1 :]]


def _is_crest(part: Part) -> bool:
    """True of an open line that stands out."""
    kind = kind_of(part.feature)
    return kind.line and kind.has_ends and kind.sign > 0 and not part.feature.closed


def may_be_points(part: Part, place: Neighbourhood) -> bool:
    """True of an open line that stands out and is no longer than two points beside each other are felt."""
    half = sizes_of(part.feature, place.around.trace.tip_radius).half_width
    return _is_crest(part) and float(arclengths(axis_of(part))[-1]) < 2.0 * AS_WIDE * half


def moved(now: Configuration) -> Iterator[Parts]:
    """A point that stands out where rows feel it together: from a place on a row no slope leads to between two."""
    for k, part in enumerate(now.parts):
        kind = kind_of(part.feature)
        if not kind.line and kind.sign > 0 and not now.is_explained:
            others = replace(now, parts=(*now.parts[:k], *now.parts[k + 1 :])).crests
            spot = _felt_about(now, axis_of(part)[0], np.maximum(now.felt - others, 0.0), part.feature)
            yield [*now.parts[:k], spot, *now.parts[k + 1 :]]


def _felt_about(now: Configuration, place: FloatArray, own: FloatArray, like: Feature) -> Part:
    """The point that stands out where rows feel something together about a place (3,).

    Rows that feel one lie less than twice its half-width apart, and each of them is as much lower as it passes beside
    it.

    Args:
        now: what is known.
        place: where it was felt.
        own: (n,) heights that it leaves beyond what is known, m.
        like: a feature as high as it was felt there.
    """
    feet, tip = now.place.window.feet, now.place.around.trace.tip_radius
    reach = 2.0 * sizes_of(like, tip).half_width
    near = np.linalg.norm(feet - place, axis=1) < reach
    if (own[near] > 0.0).any():
        place = feet[near][int(np.argmax(own[near]))]
        near = np.linalg.norm(feet - place, axis=1) < reach
    weight = own[near] ** 2 / max(float((own[near] ** 2).sum()), np.finfo(float).tiny)
    middle = place + weight @ (feet[near] - place)
    height = float(weight @ (now.felt[near] + ((feet[near] - middle) ** 2).sum(axis=1) / (2.0 * tip)))
    spot = _sized(like, kind_made_of("convex", line=False).name, height, height)
    return part_of(_plainly(replace(spot, axis=middle[None], normals=like.normals[:1])), now.place)


def other_kinds(now: Configuration) -> Iterator[Parts]:
    """A short line as a point, a point as a short line, and a bar as a step along one of its walls."""
    for k, part in enumerate(now.parts):
        if isinstance(part.shape, TrapezoidShape):
            step, top = kind_made_of("step", line=True), float(part.shape.parts(part.start[None])[1][0])
            for side in (-1.0, 1.0):
                edge = _line(_sized(part.feature, step.name, abs(part.feature.height.median), 0.0),
                             axis_of(part) + 0.5 * side * top * _lateral(part), now.place)  # fmt: skip
                yield [*now.parts[:k], edge, *now.parts[k + 1 :]]
        kind, half = kind_of(part.feature), sizes_of(part.feature, now.place.around.trace.tip_radius).half_width
        rest = [*now.parts[:k], *now.parts[k + 1 :]]
        if kind.sided or not kind.made_of:
            continue
        other, axis = kind_made_of(kind.made_of, line=not kind.line), axis_of(part)
        point = as_point(replace(part.feature, axis=axis), now.place.around.trace.tip_radius)
        if point is not None:
            yield [*rest, part_of(point, now.place)]
            if isinstance(part.shape, TrapezoidShape):  # the ball stands on a flat top no higher than that
                flat = part_of(replace(point, height=part.feature.height), now.place)
                yield [*rest, as_frustum(flat, now.place, float(part.shape.parts(part.start[None])[1][0]))]
        if not kind.line:
            shape: Any = part.shape
            like, half_length = replace(part.feature, kind=other.name), SHORT_LINE * half
            for way in shape.spot.axes:
                short = axis + np.array([[-half_length], [half_length]]) * way
                yield [*rest, _line(like, short, now.place)]


def ringed(now: Configuration, points: FloatArray) -> Iterator[Parts]:
    """A closed ridge round a point that stands out, through the crests (M, 3) about it: of a ring hardly wider than
    what a ball feels rows one way tell crests to both sides of its middle, which lie as those of a spot do."""
    for k, part in enumerate(now.parts):
        kind = kind_of(part.feature)
        if kind.line or kind.sign < 0:
            continue
        spot: Any = part.shape
        free = points  # of the crests that no other part holds
        for other in now.parts[:k] + now.parts[k + 1 :]:
            free = free[distances(free, axis_of(other)) > now.place.half_width]
        aside = (free - axis_of(part)) @ spot.spot.axes.T
        own = aside[np.linalg.norm(aside, axis=1) < NEIGHBOURHOOD_REACH * now.place.half_width]
        if len(own) < FEWEST_POINTS:
            continue
        # the circle of least squares of its equation (Kasa, IEEE Trans. Instrum. Meas. 25, 1976)
        equation = np.column_stack([2.0 * own, np.ones(len(own))])
        x, y, rest = np.linalg.lstsq(equation, (own**2).sum(axis=1), rcond=None)[0]
        turn = np.append(np.linspace(0.0, 2.0 * np.pi, POINTS_OF_LEG)[:-1], 0.0)
        circle = np.array([x, y]) + np.sqrt(rest + x**2 + y**2) * np.column_stack([np.cos(turn), np.sin(turn)])
        height = part.feature.height.median
        wire = _sized(part.feature, kind_made_of(kind.made_of, line=True).name, height, height)
        ring = _line(wire, axis_of(part) + circle @ spot.spot.axes, now.place)
        yield [*now.parts[:k], ring, *now.parts[k + 1 :]]


def as_point(line: Feature, tip_radius: float) -> Feature | None:
    """The point that may be meant instead of a line which is hardly longer than wide; None of others.

    Of one that stands out the ball is as high at both ends of the line as the line is.
    """
    kind = kind_of(line)
    half, length = sizes_of(line, tip_radius).half_width, float(arclengths(line.axis)[-1])
    if not kind.line or kind.sided or not kind.made_of or length >= AS_WIDE * half:
        return None
    if kind.sign > 0:
        line = replace(line, height=about(line.height.median + length**2 / (8.0 * tip_radius)))
    point, at, nowhere = kind_made_of(kind.made_of, line=False), middle(line.axis)[0], Interval(0.0, 0.0, 0.0)
    nearest = int(np.argmin(np.linalg.norm(line.axis - at, axis=1)))
    normal = line.normals[min(nearest, len(line.normals) - 1)]
    return _plainly(replace(line, kind=point.name, axis=at[None], normals=normal[None], length=nowhere))


def straight(now: Configuration, points: FloatArray) -> Iterator[Parts]:
    """Straight lines through the crests' points (M, 3), instead of all lines that stand out."""
    lines = [part for part in now.parts if isinstance(part.shape, RidgeShape | TwinShape)]
    if not lines or len(points) < FEWEST_POINTS:
        return
    near = np.min([distances(points, axis_of(line)) for line in lines], axis=0) < now.place.half_width
    found = straight_lines(points[near], ON_LINE * now.place.half_width)
    # one straight line for another is the same: how far it goes where nobody looked is all that could differ
    same = len(found) == len(lines) == 1 and isinstance(lines[0].shape, RidgeShape) and lines[0].shape.modes.degree == 1
    if found and not same:
        model = max(lines, key=lambda part: part.feature.evidence.snr).feature
        rest = [part for part in now.parts if not any(part is line for line in lines)]
        yield [*rest, *(_line(model, line, now.place) for line in found)]


def extended(now: Configuration) -> Iterator[Parts]:
    """A line that goes on beyond an end, to the nearest or to the farthest of what stands off there.

    No optimum leads from one sweep to the next: between two of them the trace does not depend on where an end is.
    """
    window = now.place.window
    for k, part in enumerate(now.parts):
        kind = kind_of(part.feature)
        if not kind.line or not kind.has_ends or part.feature.closed:
            continue
        places = window.feet[_peaks(now, float(kind.sign))]
        half, course = sizes_of(part.feature, now.place.around.trace.tip_radius).half_width, axis_of(part)
        for axis in (course, course[::-1]):
            way = axis[-1] - axis[-2]
            way /= max(float(np.linalg.norm(way)), np.finfo(float).tiny)
            along = (places - axis[-1]) @ way
            off = np.linalg.norm(places - axis[-1] - along[:, None] * way, axis=1)
            beyond = along[(along > 0.0) & (off < half)]
            for reach in sorted({float(beyond.min()), float(beyond.max())}) if len(beyond) else ():
                longer = _alike(part, np.vstack([axis, axis[-1] + (reach + EXTENDED * half) * way]), now.place)
                yield [*now.parts[:k], longer, *now.parts[k + 1 :]]


def smoother(now: Configuration) -> Iterator[Parts]:
    """A line that bends less: an axis that no smooth course follows within its doubt was laid as it was felt, point by
    point, and pays for every bend."""
    for k, part in enumerate(now.parts):
        if not kind_of(part.feature).line or part.feature.closed:
            continue
        shape: Any = part.shape.midway if isinstance(part.shape, TwinShape) else part.shape
        for degree in LOWER_DEGREES:
            if degree < shape.modes.degree:
                yield [*now.parts[:k], _alike(part, axis_of(part), now.place, degree, degree), *now.parts[k + 1 :]]


def _alike(part: Part, axis: FloatArray, place: Neighbourhood, most: int = HIGHEST_DEGREE, least: int = 1) -> Part:
    """A line of a part's section along another axis."""
    shape: Any = part.shape
    line = _line(part.feature, axis, place, most, least)
    if isinstance(shape, TwinShape):
        return as_twin(line, place, float(np.exp(part.start[0])), lying=shape.lying)
    if isinstance(shape, TrapezoidShape):
        return as_bar(line, place, float(shape.parts(part.start[None])[1][0]))
    if isinstance(shape, BellRidgeShape):
        return as_bell(line, float(np.exp(part.start[-2])))
    if isinstance(shape, StepShape) and shape.slanted:
        climbing = replace(part.feature, details=replace(part.feature.details, run=float(np.exp(part.start[-1]))))
        return as_slanted([replace(line, feature=climbing)], 0, place)
    if isinstance(shape, SmoothGrooveShape):
        upright: Any = line.shape
        smooth = smooth_groove_beside(upright, sizes_of(part.feature, shape.tip_radius))
        section = shape.names.index("log half width") - len(shape.names)
        return Part(line.feature, smooth, np.concatenate([smooth.start[:section], part.start[section:]]))
    return line


def more(now: Configuration) -> Iterator[Parts]:
    """Whatever stands off the configuration most: a point there, or a straight line through several such places.

    A crest that was fitted alone is as wide as what lies beside it made it: it is asked as a thin one, too.
    """
    yield from _more(now)
    thin = [_thin(part, now.place) for part in now.parts]
    if any(one is not other for one, other in zip(thin, now.parts, strict=True)):
        yield from _more(laid(thin, now.place))


def _thin(part: Part, place: Neighbourhood) -> Part:
    """A crest that is round or runs out with the section of a wire of its height; others as they are."""
    if isinstance(part.shape, BellShape | BellRidgeShape):
        height = max(float(part.start[-3]), np.finfo(float).tiny)
        wire = _sized(part.feature, part.feature.kind, height, height)
        return _line(wire, axis_of(part), place, HIGHEST_DEGREE)
    if not isinstance(part.shape, RidgeShape | BumpShape):
        return part
    start = part.start.copy()
    start[-1] = np.log(0.5 * max(float(start[-2]), np.finfo(float).tiny))
    return Part(part.feature, part.shape, start) if start[-1] < part.start[-1] - THINNER else part


def _more(now: Configuration) -> Iterator[Parts]:
    """The same for one configuration.

    The highest of crests is felt: what stands off one is as high as it is felt there, not as it stands off.
    """
    window, tip = now.place.window, now.place.around.trace.tip_radius
    for sign in (1.0, -1.0):
        over, peak = sign * now.residual, _peaks(now, sign)
        if not peak.any():
            continue
        places, heights = window.feet[peak], over[peak]
        top = int(np.argmax(heights))
        high = heights > 0.3 * heights[top]
        felt = heights + now.crests[peak] if sign > 0 else heights
        model = _model(now.place, places[top], window.normals[peak][top], sign * float(np.median(felt[high])))
        half = float(np.sqrt(2.0 * tip * abs(model.height.median)))
        spot = kind_made_of("convex" if sign > 0 else "concave", line=False)
        found = straight_lines(places[high], max(ON_LINE * half, 1.5 * float(window.half.max())))
        line = kind_made_of("convex" if sign > 0 else "concave", line=True)
        for axis in found[:2]:
            if len(axis) > 1 and float(arclengths(axis)[-1]) > 0.5 * half:
                yield [
                    *now.parts,
                    _line(_sized(model, line.name, model.height.median, abs(model.height.median)), axis, now.place),
                ]
        yield [*now.parts, part_of(replace(model, kind=spot.name), now.place)]


def retold(now: Configuration) -> Iterator[Parts]:
    """All details or all but one, or the steps alone, and beside them the thin crests that explain best what is felt,
    where the configuration leaves something over."""
    window = now.place.window
    for answer in [] if now.is_explained else pursued(now)[:MOST_RETOLD]:
        if answer.gain < -HOPELESS:
            return
        parts = [now.parts[k] for k in answer.kept]
        for axis, height in zip(answer.crests.axes, answer.crests.heights.tolist(), strict=True):
            up = window.normals[int(np.linalg.norm(window.feet - axis[0], axis=1).argmin())]
            spot, line = _model(now.place, axis[0], up, height), kind_made_of("convex", line=True).name
            if (axis[0] == axis[1]).all():
                parts.append(part_of(spot, now.place))
            else:
                parts.append(_line(_sized(spot, line, height, height), axis, now.place))
        yield parts


def _peaks(now: Configuration, sign: float) -> BoolArray:
    """(n,) True where the residual is highest (or, for the sign -1, lowest) along a run, and stands off."""
    window, over = now.place.window, sign * now.residual
    peak = np.zeros(len(window), dtype=bool)
    for start, stop in zip(window.starts[:-1], window.starts[1:], strict=True):
        own = over[start:stop]
        peak[start + 1 : stop - 1] = (own[1:-1] >= own[:-2]) & (own[1:-1] > own[2:])
    return np.asarray(peak & (sign * now.standing_off > PEAK_SDS))


def straight_lines(points: FloatArray, tolerance: float) -> list[FloatArray]:
    """Axes (2, 3) of straight lines that hold the points (M, 3), the one that holds most of them first.

    Args:
        points: m.
        tolerance: distance from a line up to which a point may belong to it, m.
    """
    left = points[:: 1 + len(points) // MOST_DRAWN_THROUGH]
    lines = []
    while len(left) > 1:
        first, second = np.triu_indices(len(left), 1)
        way = left[second] - left[first]
        length = np.linalg.norm(way, axis=1)
        apart = length > 2.0 * tolerance
        if not apart.any():
            break
        first, way = first[apart], way[apart] / length[apart, None]
        offset = left[None] - left[first][:, None]
        along = np.einsum("pmi,pi->pm", offset, way)
        off = np.linalg.norm(offset - along[..., None] * way[:, None], axis=2)
        held = off < tolerance
        best = int(np.argmax(held.sum(axis=1) - (np.where(held, off, 0.0) / tolerance).mean(axis=1)))
        if held[best].sum() < 2:
            break
        lines.append(_straight_through(left[held[best]]))
        left = left[~held[best]]
    return lines


@dataclass(frozen=True)
class Proposal:
    """A named generator.

    Args:
        name: what it does.
        of: from a configuration and the points of crests (M, 3) to the parts of others.
    """

    name: str
    of: Callable[[Configuration, FloatArray], Iterator[Parts]]


ONE_COURSE = Proposal("one course", lambda now, points: chained(now))
JOIN = Proposal("join", lambda now, points: joined(now))
SMOOTHER = Proposal("smoother", lambda now, points: smoother(now))
REMOVE = Proposal("remove", lambda now, points: without(now))
RETELL = Proposal("retell", lambda now, points: retold(now))
PROPOSALS = (
    REMOVE,
    SMOOTHER,
    Proposal("section", lambda now, points: sections(now)),
    Proposal("straight lines", straight),
    RETELL,
    Proposal("ring", ringed),
    ONE_COURSE,
    JOIN,
    Proposal("apart", lambda now, points: apart(now)),
    Proposal("move", lambda now, points: moved(now)),
    Proposal("between", lambda now, points: between(now)),
    Proposal("kind", lambda now, points: other_kinds(now)),
    Proposal("extend", lambda now, points: extended(now)),
    Proposal("add", lambda now, points: more(now)),
)


def _ridge_of(part: Part, place: Neighbourhood) -> Part | None:
    """A line that stands out, as a round ridge on its course; None of others."""
    shape: Any = part.shape
    if isinstance(shape, RidgeShape):
        return part
    if part.feature.kind != kind_made_of("convex", line=True).name:
        return None
    return _line(part.feature, axis_of(part), place, most=8)


def axis_of(part: Part) -> FloatArray:
    """(K, 3) the axis of a part as it was fitted."""
    shape, theta = part.shape, part.start
    if isinstance(shape, TwinShape):
        shape, theta = shape.midway, theta[1:]
    if not kind_of(part.feature).line:
        spot: Any = shape
        place = np.zeros((1, 2))
        place[0, : spot.free] = theta[: spot.free]
        return np.asarray(spot.spot.lifted(place, np.zeros(1)))
    line: Any = shape
    names = list(line.names)
    ends = line.modes.middle + line.modes.reach * np.array([-1.0, 1.0])
    if "start" in names:
        first = names.index("start")
        ends = ends_on_face(line.chart, line.modes, theta[None, : line.modes.count], theta[None, first : first + 2])[0]
    s = np.linspace(ends[0], ends[1], 2 if line.modes.degree < 2 and len(line.chart.s) < 9 else 33)
    points, laterals, _, _ = line.chart.at(s)
    return np.asarray(points + line.modes.lateral(theta[None, : line.modes.count], s)[0][:, None] * laterals)


def _lateral(part: Part) -> FloatArray:
    line: Any = part.shape
    return np.asarray(line.chart.laterals[len(line.chart.laterals) // 2])


def apart_of(part: Part) -> Parts:
    """Both lines of a twin."""
    twin: Any = part.shape
    return [Part(part.feature, twin.midway, twin.single(part.start[None], side)[0]) for side in (-1.0, 1.0)]


def as_far_as_felt(part: Part, place: Neighbourhood) -> Part:
    """A line of a kind without ends over all places that felt it; others as they are."""
    kind, shape = kind_of(part.feature), part.shape
    if not kind.line or kind.has_ends or part.feature.closed:
        return part
    axis = axis_of(part)
    way = (axis[-1] - axis[0]) / max(float(np.linalg.norm(axis[-1] - axis[0])), np.finfo(float).tiny)
    half = sizes_of(part.feature, place.around.trace.tip_radius).half_width
    line: Any = shape
    s, lateral, _ = line.chart.coordinates(place.window.feet)
    along = (place.window.feet - axis[0]) @ way
    felt = np.abs(lateral - line.modes.lateral(part.start[None, : line.modes.count], s)[0]) < half
    low, high = float(along[felt].min(initial=0.0)), float(along[felt].max(initial=(axis[-1] - axis[0]) @ way))
    before, after = -low > half, high - (axis[-1] - axis[0]) @ way > half
    if not before and not after:
        return part
    first = [axis[0] + low * way] if before else []
    return _line(part.feature, np.vstack([*first, axis, *([axis[0] + high * way] if after else [])]), place)


def _beyond(felt: FloatArray, middle: FloatArray, reach: float) -> FloatArray:
    """A polyline (K, 3) gone on straight past the last of the places (M, 3) where its edges, which have no ends, were
    felt, so far (m) that no sweep would feel an end there."""
    longer = middle.copy()
    for end, before in ((0, 1), (-1, -2)):
        way = middle[end] - middle[before]
        way /= max(float(np.linalg.norm(way)), np.finfo(float).tiny)
        longer[end] += (max(float(((felt - middle[end]) @ way).max()), 0.0) + reach) * way
    return longer


def _faces(first: Part, second: Part, place: Neighbourhood, share: float = 1.0) -> bool:
    """True if two lines run beside each other, nearer than both of their disturbances reach, or this share of it."""
    tip = place.around.trace.tip_radius
    reach = share * sum(sizes_of(each.feature, tip).half_width for each in (first, second))
    one, other = axis_of(first), axis_of(second)
    return all(np.median(distances(dense(of), line)) < reach for of, line in ((one, other), (other, one)))


def dense(axis: FloatArray) -> FloatArray:
    """Points along a polyline (K, 3), many to each leg: two that cross have none of their corners in common."""
    share = np.linspace(0.0, 1.0, POINTS_OF_LEG)[:, None]
    return np.concatenate([a + share * (b - a) for a, b in itertools.pairwise(axis)])


def _hollow(one: FloatArray, other: FloatArray, like: Feature, place: Neighbourhood) -> Part:
    """The groove between two lines: as wide as they are apart, as deep as a ball dips there."""
    across = nearest_on(one, other)[0] - one
    width = float(np.median(np.linalg.norm(across, axis=1)))
    tip = place.around.trace.tip_radius
    kind = kind_made_of("concave", line=True)
    return _line(_sized(like, kind.name, -(width**2) / (8.0 * tip), width), one + 0.5 * across, place)


def _straight_through(points: FloatArray) -> FloatArray:
    """(2, 3) the straight line through points, from the first to the last of them along it."""
    middle = points.mean(axis=0)
    way = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    along = (points - middle) @ way
    return np.asarray(middle + np.array([[along.min()], [along.max()]]) * way)


def _shortened(axis: FloatArray, point: FloatArray, like: Feature, place: Neighbourhood) -> FloatArray:
    """A straight axis (2, 3) whose end at a point (3,) is a half-width short of it, or the axis half as long."""
    end = int(np.argmin(np.linalg.norm(axis - point, axis=1)))
    back, short = axis[1 - end] - axis[end], axis.copy()
    half = sizes_of(like, place.around.trace.tip_radius).half_width
    short[end] = axis[end] + min(half / max(float(np.linalg.norm(back)), np.finfo(float).tiny), 0.5) * back
    return short


def _line(like: Feature, axis: FloatArray, place: Neighbourhood, most: int = 1, least: int = 1) -> Part:
    """A part of a feature's kind and sizes along another axis, of a course of these degrees."""
    base, tip = place.around.base, place.around.trace.tip_radius
    up = like.normals[np.linalg.norm(axis[:, None] - like.axis[None], axis=2).argmin(axis=1)]
    feet = base.foot(axis + tip * up, tip)
    laid = replace(like, axis=axis if place.window.flat else feet.points, normals=feet.normals)
    return part_of(_plainly(laid), place, most, least)


def _plainly(feature: Feature) -> Feature:
    """What a proposal begins with: nothing is known of it but its kind, place and sizes."""
    return replace(feature, notes=(), junction=False, posterior=None, faint=False)


def _sized(like: Feature, kind: str, height: float, width: float) -> Feature:
    details = replace(like.details, radius=None, top=None, run=None, high_side=None, misfit=None)
    return replace(
        like, kind=kind, height=about(height), width=Interval(width, 0.5 * width, 2.0 * width), details=details
    )


def _model(place: Neighbourhood, point: FloatArray, normal: FloatArray, height: float) -> Feature:
    """A feature of a height about a place, of which nothing else is known."""
    kind = kind_made_of("convex" if height > 0.0 else "concave", line=False)
    width = abs(height) if height > 0.0 else 2.0 * float(np.sqrt(2.0 * place.around.trace.tip_radius * -height))
    return Feature(kind.name, point[None], normal[None], about(height), Interval(width, 0.5 * width, 2.0 * width),
                   Interval(0.0, 0.0, 0.0), Support(0.0, 2), True, 0.1 * place.half_width)  # fmt: skip
