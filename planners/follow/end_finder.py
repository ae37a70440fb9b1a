"""Ridge end: sweeps along the crest and off its end, all fitted together."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from hw import Move
from mapping import FloatArray, Trace
from mapping.base import Base
from mapping.instrument import Noise
from planners.follow.axis_track import AxisEnd, AxisTrack, Slides
from planners.follow.recross import flattening
from planners.follow.template_fit import FEWEST_FITTED, ShapeFit, end_shape, fit_shape
from planners.paths import Strokes, tangential, to_and_fro

# A slide in half-widths of the disturbance: from so far before the end to so far beyond it. The first one must find
# the end; the others pass only over what its place changes, the fall of the crest
FIRST = (1.2, 1.8)
NEXT = (0.4, 1.25)
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
    """Slides off the ends of ridges and grooves.

    Args:
        strokes: how to touch.
        base: the global model.
        noise: of the samples.
        passes: sweeps of the first slide, which must find the end: a single one does not show a faint line.
    """

    strokes: Strokes
    base: Base
    noise: Noise
    passes: int = 1

    def slide(self, end: AxisEnd, crest: Crest) -> Generator[Move, Trace, AxisEnd]:
        """A better estimate of an end from one more sweep along the crest; the old one if that shows nothing."""
        tip = self.strokes.tip_radius
        # a groove is crossed no more where its end lifts the ball, that far before the end
        half = max(crest.half_width, float(np.sqrt(2.0 * tip * crest.height)))
        back = self.strokes.walk(end.point, -end.heading, FIRST[0] * half, -end.turn)
        ahead = self.strokes.walk(end.point, end.heading, end.reach + FIRST[1] * half, end.turn)
        points = np.concatenate([back.points[:0:-1], ahead.points])
        normals = np.concatenate([back.normals[:0:-1], ahead.normals])
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        here = float(along[len(back.points) - 1])
        swept = slice(None) if end.felt is None else self._swept(along - here, half, crest.sign)
        turn = 1 if end.felt is None or end.felt.count % 2 == 0 else -1
        move = self.strokes.over(points[swept][::turn], normals[swept][::turn])
        traces = yield from to_and_fro(move, self.passes if end.felt is None else 1)
        felt = end.felt
        for trace in traces:
            feet = self.base.foot(trace.centers, tip)
            felt = Slides.joined(felt, feet.points, feet.height)
        if felt is None or sum(len(trace) for trace in traces) < FEWEST_FITTED:
            return end
        fit = self._fitted(felt, points, normals, along, crest, float(along[-1]) - 0.5 * half)
        inside = 0.02 * tip < fit.place < float(along[-1]) - 0.5 * half - 0.02 * tip
        if not inside or fit.sd > 0.2 * tip or abs(fit.height) < 0.4 * crest.height:
            return end if np.isfinite(end.sd) else replace(end, sd=max(end.reach, 0.1 * tip), reason="lost")
        where, heading = _at(fit.place, along, points, normals)
        # further slides start from the end: they must follow the same curve
        onto = self.strokes.onto(where)[0]
        return replace(end, point=onto, sd=fit.sd, reason="end", heading=heading, reach=0.0, felt=felt)

    def _swept(self, offset: FloatArray, half: float, sign: float) -> slice:
        """The waypoints over the fall of the crest: beyond the end of a ridge, before that of a groove."""
        before, beyond = NEXT if sign > 0 else NEXT[::-1]
        inside = np.flatnonzero((offset >= -before * half) & (offset <= beyond * half))
        return slice(inside[0], inside[-1] + 1) if len(inside) > 1 else slice(None)

    def _fitted(
        self, felt: Slides, points: FloatArray, normals: FloatArray, along: FloatArray, crest: Crest, last: float
    ) -> ShapeFit:
        """The end's place on the line of points, from all slides laid over each other."""
        place = places_along(felt.points, points, along)
        order = np.argsort(place, kind="stable")
        # the correlated part of the noise averages out over the slides, not along them
        noise = self.noise.of_passes(felt.count)
        shape = end_shape(crest.sign, self.strokes.tip_radius)
        wide = flattening(along, normals, points[-1] - points[0], self.strokes.tip_radius)
        fit = fit_shape(
            wide * place[order],
            felt.heights[order],
            shape,
            crest.sign,
            crest.height,
            (0.0, wide * last),
            noise,
            crest_sd=crest.height_sd,
        )
        return replace(fit, place=fit.place / wide, sd=fit.sd / wide)


def _at(place: float, along: FloatArray, points: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Point and heading (3,) at an arclength of a polyline."""
    where = np.array([np.interp(place, along, points[:, k]) for k in range(3)])
    k = int(np.clip(np.searchsorted(along, place), 1, len(points) - 1))
    return where, tangential(points[k] - points[k - 1], normals[k])


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
