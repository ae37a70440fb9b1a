"""Faint lines: followed along a straight course by passes that go on until they tell whether the line is there."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace

import numpy as np

from hw import Move
from mapping import FloatArray, Trace, length_text
from mapping.detection import Crossing
from mapping.instrument import Noise
from planners import Outcome, Plan
from planners.follow.axis_track import AxisEnd, Slides
from planners.follow.end_finder import Crest, EndFinder, places_along
from planners.follow.line import Line, joined, returned
from planners.follow.presence import PRIOR_REACH_SDS, Expected, presence
from planners.follow.recross import flattening
from planners.follow.ridge_follower import BRACKETS
from planners.follow.sense import Sense
from planners.follow.template_fit import FEWEST_FITTED, crest_shape, dip_shape
from planners.paths import Strokes, to_and_fro

# Probability that a place says the line is there where it is not, or is not where it is: a line is asked at ten places
# or so, and one in a hundred then ends wrongly
WRONG_DECISIONS = 1e-3
# Log odds at which passes over a place end (theory section 11; Wald, Annals of Mathematical Statistics 16, 1945)
DECIDED = float(np.log((1.0 - WRONG_DECISIONS) / WRONG_DECISIONS))
# Squared signal-to-noise ratio of all passes at which a test that looks once is wrong as seldom: (2 x 3.09)^2, with the
# quantile of WRONG_DECISIONS. So many passes are made at most, and a third of them on average
DECISIVE = 38.2
# Times that the odds are asked at one place, if all passes are made
ASKED = 12
# Log of the factor by which the height of a lead may be wrong: the section that it was sought with, a crest's, says
# 0.56 of the height of a dip as wide, and more of a wider one
LEAD_HEIGHT_SD = 0.35
# Half-widths of bare base beside the places where a line may lie: correlated noise is told there
BARE_BESIDE = 1.6
# The step along a line, in its length so far
LEAD_STEP = 0.25


@dataclass(frozen=True, eq=False)
class FaintLead:
    """Where to begin following a faint line.

    Args:
        seed: its crossing in the middle of what is known of it.
        way: (3,) the way that it goes there.
        passes: that tell for sure whether it is there.
        length: so far, m.
    """

    seed: Crossing
    way: FloatArray
    passes: int
    length: float


@dataclass(frozen=True, eq=False)
class Straight:
    """Course and height of a line about a straight one on the base.

    Args:
        mean: (3,) offset to the left (m), slope and bend (1/m), as the law has them.
        covariance: (3, 3).
        log_height, log_height_sd: of its |height|, ln m.
    """

    mean: FloatArray
    covariance: FloatArray
    log_height: float
    log_height_sd: float

    @classmethod
    def of(cls, lead: FaintLead) -> Straight:
        """What a lead tells: its middle, either end, and how far it bulges between them are known equally well."""
        sd, length = lead.seed.position_sd, lead.length
        sds = sd * np.array([1.0, np.sqrt(12.0) / length, 8.0 / length**2])
        return cls(np.zeros(3), np.diag(sds**2), float(np.log(abs(lead.seed.height))), LEAD_HEIGHT_SD)

    def at(self, s: float) -> Expected:
        """What is expected at a place along it, m."""
        row = _row(s)
        place, sd = float(row @ self.mean), float(np.sqrt(row @ self.covariance @ row))
        return Expected(place, sd, self.log_height, self.log_height_sd)

    def slope(self, s: float) -> float:
        """Tangent of the angle by which it has turned to the left."""
        return float(self.mean[1] + s * self.mean[2])

    def told(self, s: float, known: Expected) -> Straight:
        """With what is known of one place."""
        row, before = _row(s), self.at(s)
        pull = self.covariance @ row / before.place_sd**2
        mean = self.mean + pull * (known.place - before.place)
        gone = (1.0 - (known.place_sd / before.place_sd) ** 2) * before.place_sd**2
        return Straight(mean, self.covariance - gone * np.outer(pull, pull), known.log_height, known.log_height_sd)


def _row(s: float) -> FloatArray:
    return np.array([1.0, s, 0.5 * s * s])


@dataclass
class FaintFollower:
    """Follows ridges and grooves that no single sweep shows.

    Whether such a line goes on is not a matter of detection: where it would lie and how high it would be is known, and
    a sequential test of this against nothing needs a third of the passes that detect it anywhere. Nor does it bend
    from one crossing to the next: all of them tell one course.

    Args:
        strokes, sense: how to touch and to feel.
        noise: of the samples.
        known: tells whether a point lies on an axis found before (there the line joins it).
    """

    strokes: Strokes
    sense: Sense
    noise: Noise
    known: Callable[[FloatArray], bool] = lambda point: False

    def follow(self, lead: FaintLead) -> Plan:
        """Follow a lead both ways; the outcome's value is an AxisTrack or None."""
        course = Straight.of(lead)
        first, course = yield from self._cross(lead, course, 0.0)
        if first is None:
            return Outcome("lost", "the faint line was not found again where the survey showed it")
        halves: list[tuple[Line, AxisEnd | None]] = []
        for side in (1.0, -1.0):
            line = Line([first], LEAD_STEP * lead.length)
            end, course = yield from self._one_way(lead, course, line, side)
            halves.append((line, end))
            if end is None:
                break
        track = joined(halves, float(np.sign(lead.seed.height)))
        height = float(np.exp(course.log_height))
        track = replace(track, height=height, height_sd=course.log_height_sd * height)
        reasons = "closed" if track.closed else " and ".join(end.reason for end in track.ends)
        return Outcome("done", f"{length_text(track.length)} in {len(track.points)} points: {reasons}", track)

    def _one_way(
        self, lead: FaintLead, course: Straight, line: Line, side: float
    ) -> Generator[Move, Trace, tuple[AxisEnd | None, Straight]]:
        """To the end on one side: steps until the line is gone, halves until a slide can find the end between."""
        tip = self.strokes.tip_radius
        there, gone, brackets = 0.0, np.inf, [share * tip for share in BRACKETS]
        step = max(line.step, tip)
        while True:
            ahead = min(step, 0.5 * (gone - there))
            walk = self.strokes.walk(lead.seed.point, side * lead.way, there + ahead)
            if walk.cut and walk.along[-1] < there + 0.5 * ahead:
                return AxisEnd(walk.points[-1], 0.0, "edge of the model", walk.directions[-1]), course
            at = float(walk.along[-1])
            found, course = yield from self._cross(lead, course, side * at)
            if found is None:
                gone = at
            else:
                there = at
                line.crossings.append(found)
                if self.known(found.point):
                    return AxisEnd(found.point, found.position_sd, "joins another", walk.directions[-1]), course
                if returned(line):
                    return None, course
            if gone - there <= brackets[0]:
                end = yield from self._end(lead, course, line, there, side, gone - there)
                del brackets[0]
                if end.reason == "end" or not brackets:
                    return end, course

    def _end(
        self, lead: FaintLead, course: Straight, line: Line, at: float, side: float, gone: float
    ) -> Generator[Move, Trace, AxisEnd]:
        """Slide along the course and off the end, which lies at most `gone` (m) beyond a place on one side."""
        point, heading, _ = self._onto(lead, course, side * at)
        rough = AxisEnd(point, np.inf, "end", side * heading, gone)
        height = float(np.exp(course.log_height))
        crest = Crest(height, height * course.log_height_sd, line.half_width, float(np.sign(lead.seed.height)))
        finder = EndFinder(self.strokes, self.sense.base, self.noise, lead.passes)
        return (yield from finder.slide(rough, crest))

    def _cross(
        self, lead: FaintLead, course: Straight, s: float
    ) -> Generator[Move, Trace, tuple[Crossing | None, Straight]]:
        """The crossing at a place along the course, None if the line is not there; and the course as it is known then.

        Passes to and fro go on until it is decided, or all are made: then the likelier is believed.
        """
        tip, expected = self.strokes.tip_radius, course.at(s)
        point, _, left = self._onto(lead, course, s)
        half_width = float(np.sqrt(2.0 * tip * np.exp(expected.log_height)))
        half = PRIOR_REACH_SDS * expected.place_sd + BARE_BESIDE * half_width
        back, ahead = self.strokes.walk(point, -left, half), self.strokes.walk(point, left, half)
        points = np.concatenate([back.points[:0:-1], ahead.points])
        normals = np.concatenate([back.normals[:0:-1], ahead.normals])
        along = np.concatenate([-back.along[:0:-1], ahead.along])
        sign, wide = float(np.sign(lead.seed.height)), flattening(along, normals, points[-1] - points[0], tip)
        shape = dip_shape(tip) if sign < 0 else crest_shape(0.5 * float(np.exp(expected.log_height)), tip)
        about = replace(expected, place=0.0, place_sd=wide * expected.place_sd)
        move, felt, made = self.strokes.over(points, normals), None, 0
        odds, known = 0.0, about
        while made < lead.passes and abs(odds) < DECIDED:
            batch = max(2, int(np.ceil(lead.passes / ASKED)))
            for trace in (yield from to_and_fro(move, batch)):
                feet = self.sense.base.foot(trace.centers, tip)
                felt = Slides.joined(felt, feet.points, feet.height)
            made += batch
            if felt is None or len(felt.heights) < FEWEST_FITTED:
                continue
            place = wide * places_along(felt.points, points, along)
            order = np.argsort(place, kind="stable")
            noise = self.noise.of_passes(felt.count)
            odds, known = presence(place[order], felt.heights[order], shape, sign, about, half_width, noise)
        at = expected.place + known.place / wide
        known = replace(known, place=at, place_sd=known.place_sd / wide)
        if odds <= 0.0:
            return None, course
        course = course.told(s, known)
        there = self._onto(lead, course, s)[0]
        normal = self.strokes.onto(there)[1]
        high = float(np.exp(course.log_height))
        found = replace(
            lead.seed,
            point=there,
            normal=normal,
            tangent=left,
            height=sign * high,
            height_sd=high * course.log_height_sd,
            position_sd=known.place_sd,
            half_width=float(np.sqrt(2.0 * tip * high)),
            snr=float(np.sqrt(2.0 * odds)),
        )
        return found, course

    def _onto(self, lead: FaintLead, course: Straight, s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Where the line is expected at a place along it, its heading there, and the way to the left of that."""
        walk = self.strokes.walk(lead.seed.point, lead.way if s >= 0.0 else -lead.way, abs(s))
        forward = walk.directions[-1] if s >= 0.0 else -walk.directions[-1]
        left = np.cross(walk.normals[-1], forward)
        point, normal = self.strokes.onto(walk.points[-1] + course.at(s).place * left)
        heading = forward + course.slope(s) * left
        heading = heading - (heading @ normal) * normal
        heading /= np.linalg.norm(heading)
        return point, heading, np.cross(normal, heading)
