"""Extrusion: planes and the arcs between them, swept along a straight line: a fillet, a roof, a bent sheet."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapping import FloatArray, Surface
from mapping.base.base import FitValue
from mapping.base.profiles import SHORTEST_BEND
from mapping.base.quadrics import Cloud, Fitted, grid_faces, pieces_of
from mapping.geometry.mesh import spline_design
from mapping.instrument import FEATURE_RESIDUAL_SDS, robust_fit

# The numbers by which a section is sought, tried with 72 bodies (fillets, edges, corners, gutters, roofs, edges above a
# corner; places, turns, radii and directions by chance, noise of 20 um): as they are the bends of 66 are right, and 65
# come within 4 um; with half or twice the cells 59 and 59 or 67 and 64, the directions 60 and 59 or 67 and 67, with two
# thirds or four thirds of the pieces 67 and 66 or 56 and 54, with half of the rounding 66 and 64. Of twelve bodies a
# third or three times the places of an arc, and slopes of 72 or 87 degrees, changed at most one.
# Bends of a section, at most: a gutter with a lip on either side has four
MOST_ARCS = 4
# Directions that the line is sought in, over half a turn, and straight pieces that the section is sought as: both only
# begin the fit, which then turns freely
LINE_DIRECTIONS, STRAIGHT_PIECES = 24, 24
# Cells that a section is searched with: 40 to each piece, whose median knows its height to 0.2 of the scatter
SEARCHED_CELLS = 1000
# One in so many of these is enough for the direction
ROUGHLY = 3
# Rounding that bends are begun with, in pieces: sharp, and over most of what lies between two of them
BEGUN_ROUND = (0.1, 2.0)
# Rounds of parting what the body explains from what stands off it, until no cell changes
PARTED_ROUNDS = 6
# Steps of one fit: of the 72 bodies 61 and 60 are right with 40, 64 and 62 with 60, and no more with 200, all in the
# same time
SECTION_STEPS = 100
# Largest sine of a slope against the plane that most of the path lies in: 80 degrees
STEEPEST_SINE = 0.985
# Places that an arc is laid out with: chords of an arc that turns by a leave radius a^2 / 8 of so many squared, 3e-6
# of the radius for a right angle
PLACES_OF_ARC = 300


@dataclass(frozen=True, eq=False)
class _Section:
    """The path's section: lines, and circular arcs between them, whose sine of the slope changes evenly.

    Args:
        offset: height at the first place of the extent, m.
        sine: of the first line's slope.
        lines: (B,) lengths over the extent of the lines between arcs, m, not below 0: arcs may join, and do where a
            ball leaves a wall's foot; the first is the place where the first arc begins.
        turns: (B,) changes of the sine: above 0 where the body is hollow.
        rounding: (B,) radii by which arcs are rounder than the sharpest that a ball can follow, m: over a sharp edge
            its centre turns on one of the tip's radius, in a sharp corner on none.
        tip_radius: m.
        low, high: extent, m.
    """

    offset: float
    sine: float
    lines: FloatArray
    turns: FloatArray
    rounding: FloatArray
    tip_radius: float
    low: float
    high: float

    @property
    def spans(self) -> tuple[FloatArray, FloatArray]:
        """(B,) where the path's arcs begin and end, m."""
        long = _arcs(self.turns, self.rounding, self.tip_radius)
        end = np.cumsum(self.lines + long)
        return end - long, end

    @property
    def places(self) -> FloatArray:
        """(B,) middles of the arcs, m."""
        return np.asarray(np.mean(self.spans, axis=0))

    @property
    def sines(self) -> FloatArray:
        """(B + 1,) of the slopes of the lines."""
        return self.sine + np.cumsum(np.append(0.0, self.turns))

    @property
    def possible(self) -> bool:
        """True of arcs within the extent, and of slopes that are no walls."""
        begin, end = self.spans
        inside = self.low < begin[0] and end[-1] < self.high
        return bool(inside and (np.abs(self.sines) < STEEPEST_SINE).all())

    def steps(self, noise: float, cell: float) -> bool:
        """True of two lines that are one another's parallels, as far as heights of a noise (m) tell, with a sharp climb
        between them that is no wider than a detail and a cell (m), whose mean is on its way up as soon as its last
        sample is: a step, upright or slanted."""
        places, sines, round_ones = self.places, self.sines, np.cumsum(np.append(0, self.rounding > 0.0))
        first, last = np.triu_indices(len(places), 1)
        turned = np.abs(sines[last + 1] - sines[first]) * (self.high - self.low)
        sharp = round_ones[last + 1] == round_ones[first]
        climb = sharp & (places[last] - places[first] < SHORTEST_BEND * self.tip_radius + cell)
        return bool((climb & (turned < FEATURE_RESIDUAL_SDS * noise)).any())

    def outline(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(K,) places along the section, heights and sines: corners, and places of each arc; a kink is many in one."""
        begin, end = self.spans
        share = np.linspace(0.0, 1.0, PLACES_OF_ARC)
        p, s, sine = [np.array([min(self.low, begin.min(initial=self.low))])], [np.array([self.sine])], self.sine
        for k in range(len(begin)):
            p.append(begin[k] + share * (end[k] - begin[k]))
            s.append(sine + share * self.turns[k])
            sine += self.turns[k]
        p.append(np.array([max(self.high, end.max(initial=self.high))]))
        s.append(np.array([sine]))
        places, sines = (
            np.maximum.accumulate(np.concatenate(p)),
            np.clip(np.concatenate(s), -STEEPEST_SINE, STEEPEST_SINE),
        )
        cosines = np.sqrt(1.0 - sines**2)
        # exact on circles: there the sine changes with p as the cosine does with q
        rises = np.diff(places) * (sines[1:] + sines[:-1]) / (cosines[1:] + cosines[:-1])
        return places, self.offset + np.concatenate([[0.0], np.cumsum(rises)]), sines

    def misses(self, p: FloatArray, q: FloatArray) -> FloatArray:
        """(N,) distances of places p, q (N,) of the section's plane from it, m, along its normals."""
        places, heights, sines = self.outline()
        sine = np.interp(p, places, sines)
        return np.asarray((q - np.interp(p, places, heights)) * np.sqrt(1.0 - sine**2))


def extrusion(cloud: Cloud) -> Fitted | None:
    """The extrusion of as many bends as pay for their parameters.

    The line's direction is begun where straight pieces across it explain the path best, and so many bends where these
    are parted best into runs of one slope; then all is free. What stands off is parted from what is explained until
    that settles, so that a detail along the line is no bend. None where no section with a bend can be laid, and of a
    body on two levels: a step, which is a detail upon a plane (`terraced_plane`).
    """
    thinned = cloud.points[:: max(1, len(cloud.points) // SEARCHED_CELLS)]
    pieces = _pieces(thinned, cloud)
    least, best, explained = np.inf, np.zeros(0), False
    for count in range(1, MOST_ARCS + 1):
        starts = [_start(pieces, count, rounding, cloud.tip_radius) for rounding in BEGUN_ROUND]
        settled = [_settled(start, thinned, cloud) for start in starts]
        cost, now = min(((_cost(theta, thinned, cloud), theta) for theta in settled), key=lambda each: each[0])
        if cost < least:
            least, best = cost, now
            # noise alone leaves 0.67 of it
            explained = bool(np.median(np.abs(_missed(best, thinned, cloud.tip_radius))) < cloud.scale)
        elif explained:
            break
    if not len(best):
        return None
    theta = _sharpened(_settled(best, cloud.points, cloud), cloud)
    section, frame, along = _laid(theta, cloud.points, cloud.tip_radius)
    onward = np.diff(cloud.sweep) == 0
    cell = float(np.median(np.linalg.norm(np.diff(cloud.points, axis=0)[onward], axis=1))) if onward.any() else 0.0
    missed = _missed(theta, cloud.points, cloud.tip_radius)
    if not section.possible or section.steps(cloud.scale, cell):
        return None
    return Fitted(
        "extrusion",
        _parameters(section, frame, cloud),
        missed,
        len(theta),
        lambda cloud, spacing: _mesh(section, frame, along, cloud, spacing),
    )


def _pieces(points: FloatArray, cloud: Cloud) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Turn and tilt (2,) of the line across which straight pieces explain points best, where the pieces begin and end
    (K,), m, the sines (K - 1,) of their slopes, and the height of the first end, m."""
    turns = np.arange(LINE_DIRECTIONS) * np.pi / LINE_DIRECTIONS
    few = points[::ROUGHLY]
    turn = turns[int(np.argmin([np.median(np.abs(_across(turn, few, cloud)[1])) for turn in turns]))]
    knots, _, coefficients = _across(turn, points, cloud)
    slopes = np.diff(coefficients[:-1]) / np.diff(knots)
    sines = np.clip(slopes / np.hypot(1.0, slopes), -STEEPEST_SINE, STEEPEST_SINE)
    return np.array([turn, np.arctan(coefficients[-1])]), knots, sines, float(coefficients[0])


def _across(turn: float, points: FloatArray, cloud: Cloud) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where straight pieces across a line begin and end (K,), m, what they miss of points (N,), m, and their heights
    there, m, and last their slope along the line (K + 1,)."""
    u = points[:, 0] * np.cos(turn) + points[:, 1] * np.sin(turn)
    v = points[:, 1] * np.cos(turn) - points[:, 0] * np.sin(turn)
    knots = np.linspace(u.min(), u.max(), STRAIGHT_PIECES + 1)
    design = np.column_stack([spline_design(u, np.concatenate([knots[:1], knots, knots[-1:]]), 1), v])
    # from piece to piece the slope changes by 0 +- 1: what holds for pieces between two rows
    bends = np.pad(np.diff(np.eye(STRAIGHT_PIECES + 1), 2, axis=0) / (knots[1] - knots[0]), ((0, 0), (0, 1)))
    values = np.append(points[:, 2], np.zeros(len(bends)))
    fit = robust_fit(np.vstack([design, cloud.scale * bends]), values, cloud.scale)
    return knots, fit.residual[: len(points)], fit.coefficients


def _start(
    pieces: tuple[FloatArray, FloatArray, FloatArray, float], count: int, rounding: float, tip_radius: float
) -> FloatArray:
    """Parameters of a section of so many bends, each rounded over so many of the `_pieces`; those that would overlap
    join, and are as much too far to one side as to the other."""
    direction, knots, sines, height = pieces
    places, turns = _bent(count, knots, sines)
    round_by = np.full(count, rounding * (knots[1] - knots[0]))
    half = 0.5 * _arcs(turns, round_by, tip_radius)
    lines = np.diff(places, prepend=0.0) - half - np.append(0.0, half[:-1])
    overlaps = np.maximum(-lines[1:], 0.0)
    lines[1:] += overlaps
    lines[0] -= 0.5 * overlaps.sum()
    return np.concatenate([direction, [height, sines[0]], np.column_stack([lines, turns, round_by]).ravel()])


def _arcs(turns: FloatArray, rounding: FloatArray, tip_radius: float) -> FloatArray:
    """(B,) lengths over the extent of arcs of turns and rounding (B,), m."""
    return np.asarray(np.abs(turns) * (rounding + np.where(turns < 0.0, tip_radius, 0.0)))


def _bent(count: int, knots: FloatArray, sines: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(count,) places, m, and changes of the sine where the pieces are parted best into runs of one slope."""
    sums, squares = (np.concatenate([[0.0], np.cumsum(sines**power)]) for power in (1, 2))
    middle = np.array(list(itertools.combinations(range(1, STRAIGHT_PIECES), count)))
    parts = np.column_stack([np.zeros(len(middle), dtype=int), middle, np.full(len(middle), STRAIGHT_PIECES)])
    own = np.diff(sums[parts], axis=1)
    scatter = (np.diff(squares[parts], axis=1) - own**2 / np.diff(parts, axis=1)).sum(axis=1)
    chosen = int(scatter.argmin())
    means = own[chosen] / np.diff(parts[chosen])
    return knots[middle[chosen]], np.diff(means)


def _frame(theta: FloatArray) -> FloatArray:
    """(3, 3) rows across the line in the section's plane, along the line, and upward, from turn and tilt."""
    turn, tilt = theta[:2]
    across = np.array([np.cos(turn), np.sin(turn), 0.0])
    along = np.array([-np.sin(turn) * np.cos(tilt), np.cos(turn) * np.cos(tilt), np.sin(tilt)])
    return np.stack([across, along, np.cross(across, along)])


def _laid(theta: FloatArray, points: FloatArray, tip_radius: float) -> tuple[_Section, FloatArray, tuple[float, float]]:
    """The section, its frame, and how far points reach along the line, m."""
    frame = _frame(theta)
    p, along = points @ frame[0], points @ frame[1]
    lines, turns, rounding = theta[4:].reshape(-1, 3).T
    section = _Section(theta[2], theta[3], lines, turns, rounding, tip_radius, float(p.min()), float(p.max()))
    return section, frame, (float(along.min()), float(along.max()))


def _missed(theta: FloatArray, points: FloatArray, tip_radius: float) -> FloatArray:
    """(N,) distances of points from the section, m."""
    section, frame, _ = _laid(theta, points, tip_radius)
    return section.misses(points @ frame[0], points @ frame[2])


def _cost(theta: FloatArray, points: FloatArray, cloud: Cloud) -> float:
    """Truncated chi-square and the price of the parameters (Schwarz); endless of a section that is none."""
    if not _laid(theta, points, cloud.tip_radius)[0].possible:
        return float("inf")
    missed = _missed(theta, points, cloud.tip_radius) / cloud.scale
    truncated = float(np.minimum(missed**2, FEATURE_RESIDUAL_SDS**2).sum())
    return truncated + len(theta) * float(np.log(len(points)))


def _settled(theta: FloatArray, points: FloatArray, cloud: Cloud) -> FloatArray:
    """Least absolute misses, then least squares over what the body explains."""
    theta, kept = _fit(theta, points, cloud, "soft_l1"), np.zeros(len(points), dtype=bool)
    for _ in range(PARTED_ROUNDS):
        near = np.abs(_missed(theta, points, cloud.tip_radius)) < FEATURE_RESIDUAL_SDS * cloud.scale
        if (near == kept).all() or near.sum() < 2 * len(theta):
            break
        kept, theta = near, _fit(theta, points[near], cloud, "linear")
    return theta


def _sharpened(theta: FloatArray, cloud: Cloud) -> FloatArray:
    """The same, sharp where an arc is no longer than two cells: the means of those beside a kink blunt it as much. The
    lines beside it go on until they meet, or until an arc of the tip's radius fits between them."""
    steps = np.linalg.norm(np.diff(cloud.points, axis=0), axis=1)
    cell = float(np.median(steps[np.diff(cloud.sweep) == 0])) if (np.diff(cloud.sweep) == 0).any() else 0.0
    section = _laid(theta, cloud.points, cloud.tip_radius)[0]
    blunted = np.abs(section.turns) * section.rounding < 2.0 * cell
    slopes = np.arcsin(np.clip(section.sines, -STEEPEST_SINE, STEEPEST_SINE))
    longer = np.where(blunted, section.rounding, 0.0) * np.tan(0.5 * np.abs(np.diff(slopes)))
    lines = section.lines + np.cos(slopes[:-1]) * (longer + np.append(0.0, longer[:-1]))
    bends = np.column_stack([lines, section.turns, np.where(blunted, 0.0, section.rounding)])
    return np.concatenate([theta[:4], bends.ravel()])


def _fit(start: FloatArray, points: FloatArray, cloud: Cloud, loss: str) -> FloatArray:
    """Parameters that miss points least, from a beginning."""
    from scipy.optimize import least_squares

    size = float(np.ptp(points, axis=0).max())
    count = (len(start) - 4) // 3
    scale = np.array([1.0, 1.0, size, 1.0, *[size, 1.0, size] * count])
    free = -np.inf
    least = np.array([*[free] * 4, *[free, free, 0.0], *[0.0, free, 0.0] * (count - 1)])
    settings: dict[str, Any] = {"loss": loss, "f_scale": cloud.scale, "x_scale": scale, "max_nfev": SECTION_STEPS}
    found = least_squares(_missed, start, args=(points, cloud.tip_radius), bounds=(least, np.inf), **settings)
    return np.asarray(found.x)


def _parameters(section: _Section, frame: FloatArray, cloud: Cloud) -> dict[str, FitValue]:
    """What was found, in the object frame: the line's direction, and of each bend a point of the path in its middle,
    the change of the sine of the slope there, and the radius of the body: 0 of what is as sharp as the path tells."""
    places, heights, _ = section.outline()
    middles = np.column_stack([section.places, 0.0 * section.places, np.interp(section.places, places, heights)])
    hollow = (section.turns > 0.0) & (section.rounding > 0.0)
    return {
        "axis": (frame[1] @ cloud.axes).tolist(),
        "middles": cloud.world(middles @ frame).tolist(),
        "turns": section.turns.tolist(),
        "radii": (section.rounding + np.where(hollow, section.tip_radius, 0.0)).tolist(),
    }


def _mesh(
    section: _Section, frame: FloatArray, along: tuple[float, float], cloud: Cloud, spacing: float | None
) -> Surface:
    """The body's section, one tip radius inward, swept over the cloud's extent and a margin."""
    places, heights, sines = section.outline()
    ways = np.column_stack([np.sqrt(1.0 - sines**2), sines])
    up = np.column_stack([-ways[:, 1], ways[:, 0]])
    path = np.column_stack([places, heights])
    outline = [path[0] - cloud.tip_radius * up[0] - cloud.margin * ways[0]]
    for bend in range(len(section.turns)):
        arc = slice(1 + bend * PLACES_OF_ARC, 1 + (bend + 1) * PLACES_OF_ARC)
        if section.rounding[bend] > 0.0:
            outline += list(path[arc] - cloud.tip_radius * up[arc])
        elif section.turns[bend] < 0.0:
            outline.append(path[arc][0] - cloud.tip_radius * up[arc][0])
        else:  # the ball reaches no farther into a corner: its sides are drawn on until they meet
            middle = up[arc][0] + up[arc][-1]
            outline.append(path[arc][0] - cloud.tip_radius * middle / (1.0 + up[arc][0] @ up[arc][-1]))
    corners = np.array([*outline, path[-1] - cloud.tip_radius * up[-1] + cloud.margin * ways[-1]])
    low, high = along[0] - cloud.margin, along[1] + cloud.margin
    lines = np.linspace(low, high, 1 + pieces_of(high - low, spacing))
    points = np.concatenate(
        [np.column_stack([np.full(len(lines), p), lines, np.full(len(lines), q)]) for p, q in corners]
    )
    return Surface(cloud.world(points @ frame), grid_faces(len(corners), len(lines)))
