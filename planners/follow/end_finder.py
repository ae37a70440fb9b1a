"""Ridge end: a sweep along the crest and off its end finds it, sweeps across the line about it sharpen it."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from hw import Move
from mapping import FloatArray, Trace
from mapping.base import Base
from mapping.instrument import Noise
from planners.follow.axis_track import AxisEnd, AxisTrack, Slides
from planners.follow.end_place import OFFSETS, UNKNOWN_TURN, EndPlace, EndSection
from planners.follow.recross import flattening
from planners.follow.template_fit import FEWEST_FITTED, ShapeFit, end_shape, fit_shape
from planners.paths import Strokes, tangential, to_and_fro

# A slide in half-widths of the disturbance: from so far before the end to so far beyond it
SLIDE = (1.2, 1.8)
# Sweeps across a line about its end: passes between two looks at what they tell, to and fro; and at most
PASSES, MOST_PASSES = 2, 150
# Samples' spacing that they are chosen by, in half-widths
SAMPLES_APART = 0.01
# A round end against a square one, in a / (r + a) half-widths: two traces that differ by less than a hundredth of the
# height; and the standard deviation of a rounding of which nothing is known (mapping.inference.families.ridge)
ROUNDED, UNKNOWN_ROUNDING_SD = 0.4, 0.35


@dataclass(frozen=True)
class Crest:
    """What is known of the ridge that ends: |height| and its standard deviation, half-width (m), sign."""

    height: float
    height_sd: float
    half_width: float
    sign: float

    @classmethod
    def of(cls, track: AxisTrack) -> Crest:
        """The crest of a followed axis."""
        return cls(track.height, track.height_sd, track.half_width, track.sign)

    def rounding_sd(self, tip_radius: float) -> float:
        """Standard deviation of an end's place that no number of slides takes away, m: whether it is round or square.

        A groove's end is an edge, whatever its outline.
        """
        if self.sign < 0:
            return 0.0
        section = 0.5 * (self.half_width**2 / self.height + self.height) - tip_radius
        radius = min(0.5 * self.height, max(section, 0.0))
        return UNKNOWN_ROUNDING_SD * ROUNDED * self.half_width * radius / (tip_radius + radius)


@dataclass(frozen=True, eq=False)
class EndFinder:
    """Finds the ends of ridges and grooves by slides off them, and sharpens them by sweeps across.

    Args:
        strokes: how to touch.
        base: the global model.
        noise: of the samples.
        passes: of a slide: a single one does not show a faint line.
    """

    strokes: Strokes
    base: Base
    noise: Noise
    passes: int = 1

    def slide(self, end: AxisEnd, crest: Crest) -> Generator[Move, Trace, AxisEnd]:
        """The place of an end along the crest by a sweep along it; the end as it was if that feels nothing."""
        tip, half = self.strokes.tip_radius, self._half(crest)
        about = _Course.about(self.strokes, end, SLIDE[0] * half, end.reach + SLIDE[1] * half)
        felt: Slides | None = None
        for trace in (yield from to_and_fro(self.strokes.over(about.points, about.normals), self.passes)):
            feet = self.base.foot(trace.centers, tip)
            felt = Slides.joined(felt, feet.points, feet.height)
        if felt is None or len(felt.heights) < FEWEST_FITTED:
            return end
        last = float(about.along[-1]) - 0.5 * half
        fit = self._fitted(felt, about, crest, last)
        inside = float(about.along[0]) + 0.02 * tip < fit.place < last - 0.02 * tip
        if not inside or fit.sd > 0.2 * tip or abs(fit.height) < 0.4 * crest.height:
            return replace(end, sd=max(end.reach, 0.1 * tip), reason="lost")
        where, heading = about.at(fit.place)
        # what follows starts from the end: it must follow the same curve
        onto = self.strokes.onto(where)[0]
        return replace(end, point=onto, sd=fit.sd, reason="end", heading=heading, reach=0.0)

    def sharpen(
        self, end: AxisEnd, crest: Crest, wanted: tuple[float, float]
    ) -> Generator[Move, Trace, tuple[AxisEnd, Crest]]:
        """The place of an end by sweeps to and fro across the line, those by which what is wanted is known the soonest;
        the end as it was if they do not show it. And the ridge, with its height as it is known then.

        Beyond the end, places lie straight on: a line that bends has no bend where it is not, and what the ball feels
        of its end is round about that.

        Args:
            wanted: standard deviations of the end's place along the line and across it, m.
        """
        half, enough = self._half(crest), np.array(wanted)
        about = _Course.about(self.strokes, end, half, OFFSETS[-1] * half, straight_on=True)
        # of an end that no slide showed it is known as far as where the crest was gone
        along_sd = end.sd if np.isfinite(end.sd) else max(end.reach, half)
        place = EndPlace(
            self._section(end, crest, half, about),
            self.noise,
            np.array([0.0, 0.0, 0.0, crest.height]),
            np.array([along_sd, half, UNKNOWN_TURN, crest.height_sd]),
        )
        made, useless = 0, set[float]()
        while made < MOST_PASSES and place.fits and place.within(half) and (place.sd[:2] > enough).any():
            could = [each for each in place.sweeps(SAMPLES_APART * half) if about.holds(each.offset)]
            could = [each for each in could if each.offset not in useless]
            if not could:
                break
            seconds = np.array([2.0 * each.half for each in could]) / self.strokes.speed
            chosen, foretold = place.next(could, seconds, enough)
            sweep = could[chosen]
            # what is foretold changes with what is felt: no more than was made before is made before the next look
            passes = PASSES * max(1, round(min(0.5 * foretold, made) / PASSES))
            middle, heading = about.at(sweep.offset)
            left = np.cross(self.strokes.onto(middle)[1], heading)
            traces = yield from to_and_fro(self.strokes.line(middle, left, sweep.half, sweep.half), passes)
            made += passes
            if sum(map(len, traces)) < FEWEST_FITTED * passes // PASSES:
                useless.add(sweep.offset)
                continue
            for trace in traces:
                feet = self.base.foot(trace.centers, self.strokes.tip_radius)
                place.learn(sweep, (feet.points - middle) @ left, feet.height)
            place.solve()
        along, across, _, height = place.place.tolist()
        known = bool((place.sd[:2] <= enough).all())
        shown = place.felt and (place.fits or known)
        if not shown or not place.within(half) or height < 0.4 * crest.height:
            return end, crest
        where, heading = about.at(along)
        point = self.strokes.onto(where + across * np.cross(self.strokes.onto(where)[1], heading))[0]
        sharp = replace(end, point=point, sd=float(place.sd[0]), across_sd=float(place.sd[1]), heading=heading)
        return sharp, replace(crest, height=height, height_sd=float(place.sd[3]))

    def _section(self, end: AxisEnd, crest: Crest, half: float, about: _Course) -> EndSection:
        """What the trace looks like about an end of a line with such a course."""
        tip = self.strokes.tip_radius
        left = np.cross(self.strokes.onto(end.point)[1], end.heading)
        beside = _Course.about(self.strokes, replace(end, heading=left, turn=0.0), half, half)
        # centres are |I + r II| apart: where the base is twisted, what is nearest to a place beside the line lies ahead
        twist = float((about.normals[-1] - about.normals[0]) @ left / (about.along[-1] - about.along[0]))
        wide = about.flattening(self._round(crest)), beside.flattening(self._round(crest))
        return EndSection(crest.sign, half, tip, wide, twist * self._round(crest) / wide[0] ** 2)

    def _round(self, crest: Crest) -> float:
        """Radius about which the ball goes round a body of curvature k beside an end, m.

        Over a cap whose middle stands c and whose top H over the base, the ball's centre falls as over a flat base
        whose lengths are stretched by the root of (1 + k c) (1 + k (r + H)): with c = H / 2, to first order in H / r,
        of 1 + k (r + 3/2 H). In a groove it rests on the base beside it.
        """
        return self.strokes.tip_radius + (1.5 * crest.height if crest.sign > 0 else 0.0)

    def _half(self, crest: Crest) -> float:
        """Half-width of the disturbance about an end, m: a groove is crossed no more where its end lifts the ball."""
        widest = float(np.sqrt(2.0 * self.strokes.tip_radius * crest.height))
        # that of a ridge is narrower where the base is bent, and by that it is told how wide the ridge itself is
        return crest.half_width if crest.sign > 0 else max(crest.half_width, widest)

    def _fitted(self, felt: Slides, about: _Course, crest: Crest, last: float) -> ShapeFit:
        """The end's place on its course, from all slides laid over each other."""
        place = places_along(felt.points, about.points, about.along)
        order = np.argsort(place, kind="stable")
        # the correlated part of the noise averages out over the slides, not along them
        noise = self.noise.of_passes(felt.count)
        shape = end_shape(crest.sign, self.strokes.tip_radius)
        wide = about.flattening(self._round(crest))
        fit = fit_shape(
            wide * place[order],
            felt.heights[order],
            shape,
            crest.sign,
            crest.height,
            (wide * float(about.along[0]), wide * last),
            noise,
            crest_sd=crest.height_sd,
        )
        return replace(fit, place=fit.place / wide, sd=fit.sd / wide)


@dataclass(frozen=True, eq=False)
class _Course:
    """The base along a line about its end: `points`, `normals` (K, 3), and `along` (K,) how far beyond the end, m."""

    points: FloatArray
    normals: FloatArray
    along: FloatArray

    @classmethod
    def about(
        cls, strokes: Strokes, end: AxisEnd, before: float, beyond: float, *, straight_on: bool = False
    ) -> _Course:
        """From so far before the end to so far beyond it, m; on along the line's bend, or straight."""
        back = strokes.walk(end.point, -end.heading, before, -end.turn)
        ahead = strokes.walk(end.point, end.heading, beyond, 0.0 if straight_on else end.turn)
        points = np.concatenate([back.points[:0:-1], ahead.points])
        normals = np.concatenate([back.normals[:0:-1], ahead.normals])
        return cls(points, normals, np.concatenate([-back.along[:0:-1], ahead.along]))

    def holds(self, place: float) -> bool:
        """True if the base goes so far beyond the end, m."""
        return bool(self.along[0] <= place <= self.along[-1])

    def at(self, place: float) -> tuple[FloatArray, FloatArray]:
        """Point and heading (3,) so far beyond the end, m."""
        where = np.array([np.interp(place, self.along, self.points[:, k]) for k in range(3)])
        k = int(np.clip(np.searchsorted(self.along, place), 1, len(self.points) - 1))
        return where, tangential(self.points[k] - self.points[k - 1], self.normals[k])

    def flattening(self, radius: float) -> float:
        """By how much shapes along it are narrower than on a flat base, for a ball that goes round it so far off, m."""
        return flattening(self.along, self.normals, self.points[-1] - self.points[0], radius)


def places_along(points: FloatArray, line: FloatArray, along: FloatArray) -> FloatArray:
    """Arclengths (N,) on a polyline (K, 3) of the places nearest to points (N, 3), beyond its ends too, m."""
    best = np.full(len(points), np.inf)
    place = np.zeros(len(points))
    for k in range(len(line) - 1):
        step = line[k + 1] - line[k]
        length = float(np.linalg.norm(step))
        if length == 0:
            continue
        share = (points - line[k]) @ step / length**2
        inner = np.clip(share, -np.inf if k == 0 else 0.0, np.inf if k == len(line) - 2 else 1.0)
        gap = ((points - line[k] - inner[:, None] * step) ** 2).sum(axis=1)
        closer = gap < best
        best[closer], place[closer] = gap[closer], along[k] + inner[closer] * length
    return place
