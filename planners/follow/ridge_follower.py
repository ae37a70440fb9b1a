"""Ridge following: cross, predict, cross again; where the ridge is lost, bisect, then slide off its end."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace

import numpy as np

from hw import Move
from mapping import FloatArray, Trace, length_text
from mapping.detection import Crossing
from mapping.instrument import Noise
from planners import Outcome, Plan
from planners.follow.axis_track import AxisEnd, Course, course
from planners.follow.end_finder import Crest, EndFinder
from planners.follow.line import Line, joined, mean_height, returned
from planners.follow.recross import is_step, seen_again
from planners.follow.sense import Sense
from planners.paths import Strokes, tangential

Crossed = Generator[Move, Trace, Crossing | None]

# A crossing lower than this share of the ridge's last heights lies beyond its end
STILL_HIGH = 0.7
FALLING_HEIGHT_SHARE = 0.9
# In tip radii: the first step and the longest, and how closely crossings bracket an end before a slide finds it; once
# more, more closely, where the slide did not
FIRST_STEP, LONGEST_STEP = 0.4, 2.0
BRACKETS = (0.6, 0.15)
# Standard deviation of a crossing's place, against the precision wanted of an end, from which steps are shorter
DOUBT = 1.9
# By how much the heading may turn in one step, rad
MOST_TURN = 0.45
# Crossings that tell a course so well that a slide may look for the end some way ahead
WELL_KNOWN = 4
# Cosine of the angle up to which a line is said to go straight on
STRAIGHT_ON_COSINE = 0.95


@dataclass(frozen=True, eq=False)
class RidgeFollower:
    """Follows ridges, grooves and steps over a base.

    Args:
        strokes, sense: how to touch and to feel.
        noise: of the samples.
        precision: wanted standard deviation of an end, m.
        known: tells whether a point lies on an axis found before (there the ridge joins it).
    """

    strokes: Strokes
    sense: Sense
    noise: Noise
    precision: float
    known: Callable[[FloatArray], bool] = lambda point: False

    def follow(self, seed: Crossing, ways: list[FloatArray]) -> Plan:
        """Follow from a seed in one or two directions (3,); the outcome's value is an AxisTrack or None."""
        sign = float(np.sign(seed.height))
        first = yield from self._first(seed, ways[0], sign)
        if first is None:
            return Outcome("lost", "the crossing that began the ridge was not found again")
        halves: list[tuple[Line, AxisEnd | None]] = []
        for way in ways[:2]:
            line = self._begun(first, way, halves)
            end = yield from self._one_way(line, way, sign)
            halves.append((line, end))
            if end is None:
                break
        track = joined(halves, sign)
        reasons = "closed" if track.closed else " and ".join(end.reason for end in track.ends)
        return Outcome("done", f"{length_text(track.length)} in {len(track.points)} points: {reasons}", track)

    @property
    def _longest(self) -> float:
        return LONGEST_STEP * self.strokes.tip_radius

    def _told_by(self, crossing: Crossing) -> float:
        """Longest step after which as uncertain crossings still tell the course, m."""
        share = min(1.0, (DOUBT * self.precision / max(crossing.position_sd, np.finfo(float).tiny)) ** 2)
        return max(share * self._longest, FIRST_STEP * self.strokes.tip_radius)

    def _begun(self, first: Crossing, way: FloatArray, halves: list[tuple[Line, AxisEnd | None]]) -> Line:
        """A line that begins at the seed; where it only goes on backwards, what was crossed so far leads it."""
        step = FIRST_STEP * self.strokes.tip_radius
        if not halves or len(halves[0][0].crossings) < 3:
            return Line([first], step)
        forth = halves[0][0]
        ahead = course(forth.points[::-1], first.normal, way, self.strokes.tip_radius)
        if float(ahead.heading @ tangential(way, first.normal)) < STRAIGHT_ON_COSINE:
            return Line([first], step)
        return Line(forth.crossings[::-1], forth.step, len(forth.crossings) - 1)

    def _one_way(self, line: Line, way: FloatArray, sign: float) -> Generator[Move, Trace, AxisEnd | None]:
        """Extend the line until it ends; None if it closes upon itself."""
        gone, empty = np.inf, np.full(3, np.inf)
        brackets = [share * self.strokes.tip_radius for share in BRACKETS]
        for _ in range(10_000):
            last = line.crossings[-1]
            ahead = course(line.points, last.normal, way, self.strokes.tip_radius)
            bend = max(abs(ahead.turn), np.finfo(float).tiny)
            step = min(line.step, 0.5 * gone, self._told_by(last), MOST_TURN / bend)
            walk = self.strokes.walk(ahead.point, ahead.heading, step, ahead.turn)
            if walk.cut and walk.along[-1] < 0.5 * step:
                return AxisEnd(walk.points[-1], 0.0, "edge of the model", walk.directions[-1])
            reach = max(0.6 * line.half_width, 0.2 * step)
            lowest = STILL_HIGH * line.height
            heading = walk.directions[-1] if len(line.crossings) % 2 else -walk.directions[-1]
            found = yield from self._cross(walk.points[-1], heading, last, sign, reach, lowest)
            if found is None or np.linalg.norm(found.point - last.point) < 0.5 * walk.along[-1]:  # the last one again
                gone, empty = float(walk.along[-1]), walk.points[-1]
                if len(line.crossings) < WELL_KNOWN:
                    del brackets[:-1]
                if gone <= max(brackets[0], 4.0 * self.precision):
                    end = yield from self._end(line, ahead, gone, sign)
                    if len(brackets) == 1 or (end.reason == "end" and (yield from self._leads_to(line, end, sign))):
                        return end
                    del brackets[0]
                continue
            missed = float(np.linalg.norm(found.point - walk.points[-1]))
            self._adapt(line, missed / reach)
            line.crossings.append(found)
            gone -= float(walk.along[-1])
            if missed > 0.5 * reach or self._passes_by(line, ahead, gone, empty, 0.5 * reach):
                gone = np.inf
            if self.known(found.point):
                return AxisEnd(found.point, found.position_sd, "joins another", ahead.heading)
            if returned(line):
                return None
            if gone <= 0.1 * self.strokes.tip_radius:
                return (yield from self._end(line, ahead, max(gone, 0.0), sign))
        return AxisEnd(line.points[-1], np.inf, "lost", way)

    def _leads_to(self, line: Line, end: AxisEnd, sign: float) -> Generator[Move, Trace, bool]:
        """True if the crest is found, where the course says, shortly before an end that a slide found.

        A slide that leaves a bend straight on looks as if the crest ended there.
        """
        last = line.crossings[-1]
        way = float(np.linalg.norm(end.point - last.point)) - 0.5 * line.half_width
        if is_step(last) or way < BRACKETS[-1] * self.strokes.tip_radius:
            return True
        ahead = course(line.points, last.normal, end.heading, self.strokes.tip_radius)
        walk = self.strokes.walk(ahead.point, ahead.heading, way, ahead.turn)
        reach = 0.6 * line.half_width
        found = yield from self._cross(
            walk.points[-1], walk.directions[-1], last, sign, reach, STILL_HIGH * line.height
        )
        if found is None:
            return False
        line.crossings.append(found)
        return bool(np.linalg.norm(found.point - walk.points[-1]) < 0.5 * reach)

    def _passes_by(self, line: Line, ahead: Course, gone: float, empty: FloatArray, near: float) -> bool:
        """True if the line, as its last crossing bends it, does not lead to the place that was found empty.

        The heading was wrong then; nothing says that the ridge ends before it.
        """
        if not 0.0 < gone < np.inf:
            return False
        onward = course(line.points, line.crossings[-1].normal, ahead.heading, self.strokes.tip_radius)
        there = self.strokes.walk(onward.point, onward.heading, gone, onward.turn).points[-1]
        return bool(np.linalg.norm(there - empty) > near)

    def _adapt(self, line: Line, miss: float) -> None:
        """A longer step after a good prediction, a shorter one after a bad one."""
        # two crossings say nothing of a bend
        factor = 1.5 if miss < 0.15 and len(line.crossings) > 2 else 0.6 if miss > 0.45 else 1.0
        line.step = float(np.clip(line.step * factor, 0.2 * self.strokes.tip_radius, self._longest))

    def _first(self, seed: Crossing, heading: FloatArray, sign: float) -> Crossed:
        """The seed crossed squarely: a sweep that met the ridge at a slant saw it too wide."""
        half = 2.5 * seed.half_width
        trace = yield self.strokes.line(seed.point, np.cross(seed.normal, heading), half, half)
        if is_step(seed) and self._stays_high(trace, sign * abs(seed.height)):
            return seed
        return self.sense.nearest(trace, seed.point, sign, 0.3 * abs(seed.height), 1.2 * seed.half_width)

    def _stays_high(self, trace: Trace, height: float) -> bool:
        """True if one end of the sweep lies at least half as high as a step: a ridge comes down on both sides."""
        edge = max(1, len(trace) // 8)
        if len(trace) < 16:
            return False
        over = [
            self.sense.base.foot(trace.centers[part], trace.tip_radius).height.mean() / height
            for part in (slice(0, edge), slice(-edge, None))
        ]
        return bool(max(over) > 0.5)

    def _cross(
        self, point: FloatArray, heading: FloatArray, like: Crossing, sign: float, reach: float, lowest: float
    ) -> Crossed:
        """Cross the ridge at a predicted point, square to its heading, from the right to the left.

        A sweep that felt nothing is repeated once.
        """
        _, normal = self.strokes.onto(point)
        way = np.cross(normal, heading)
        half = (2.5 if is_step(like) else 1.6) * like.half_width + reach
        move = self.strokes.line(point, way, half, half)
        for _ in range(2):
            trace = yield move
            if len(trace):
                found = seen_again(trace, self.sense.base, self.noise, point, way, like, reach)
                return found if found is not None and sign * found.height >= lowest else None
        return None

    def _end(self, line: Line, ahead: Course, gone: float, sign: float) -> Generator[Move, Trace, AxisEnd]:
        """Slide along the crest and off the end, where the crossings have bracketed it."""
        if is_step(line.crossings[-1]):
            return AxisEnd(line.crossings[-1].point, 0.5 * gone, "end", ahead.heading, gone)
        farthest, whole = line.crossings[-1].point, line
        line = replace(line, crossings=list(line.crossings))
        # where the crest has begun to fall it has ended already, and what lies beside it pulls at the crossing
        while len(line.crossings) > 2 and self._is_falling(line):
            line.crossings.pop()
        last = line.crossings[-1]
        gone += float(np.linalg.norm(farthest - last.point))
        ahead = course(line.points, last.normal, ahead.heading, self.strokes.tip_radius)
        # as the ends of a straight line through crossings that lie evenly on it
        beside = 2.0 * last.position_sd / float(np.sqrt(len(line.crossings)))
        rough = AxisEnd(ahead.point, np.inf, "end", ahead.heading, gone, ahead.turn, across_sd=beside)
        finder = EndFinder(self.strokes, self.sense.base, self.noise)
        # the last crossing may lie beyond the end already
        height, sd = mean_height(line.crossings[:-1] or line.crossings)
        end = yield from finder.slide(rough, Crest(height, sd, line.half_width, sign))
        if end.reason == "end":
            whole.crossings = line.crossings
        return end

    def _is_falling(self, line: Line) -> bool:
        """True if the last crossing is lower than the line."""
        return abs(line.crossings[-1].height) < FALLING_HEIGHT_SHARE * line.height
