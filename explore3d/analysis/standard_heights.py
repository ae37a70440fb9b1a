"""Standard heights: what grooves, ridges and steps measure by ISO 5436-1 and by Wolf's pruning, beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from explore3d import count_text
from mapping import BoolArray, Feature, FloatArray, IntArray, Interval, length_text
from mapping.base import LaidTrace, SweepHeights
from mapping.estimate.roughness import flat_height, level_difference, round_height, wolf_height
from mapping.geometry.mesh import arclengths, distances, nearest_on
from mapping.geometry.templates import contact_half_width
from mapping.inference.kinds import kind_of, sizes_of

# Bins in a third of a width, or in a portion beside a step: more than twice what a portion must hold
_BINS = 12
# A section that meets its line at a sine below this is none: it is stretched to more than twice the width, and the
# portions, six half-widths long at a right angle, reach over other details
_ACROSS = 0.5
# A flat top that is at least this share of the width fills the standard's middle portion, its middle third
_FLAT_SHARE = 1.0 / 3.0
# The parts beside a step are so many times as long as what is left out at its edge: the standard leaves out a third of
# the width beside an edge, and takes two thirds
_SIDE_PER_EDGE = 2.0

STANDARDS_SENTENCE = (
    "Heights by ISO 5436-1: parallel lines through the portions beside the edges and through the middle third (A1), or "
    "a parabola there (A2); beside a step, which that standard knows with two edges only, two parallel lines. Wolf's "
    "height is the threshold up to which pruning leaves the hill or dale in its profile, after an S-filter. They are "
    "of the ball's path, not of the body: noise and the ball's shape stay in them. Ranges are 90 % intervals of the "
    "mean, from section to section."
)


@dataclass(frozen=True, eq=False)
class StandardHeight:
    """What one feature measures by the standards.

    Args:
        id: of the feature, or of the two steps that bound it.
        method: "ISO 5436-1 A1", "ISO 5436-1 A2" or "parallel lines".
        height: signed, with the 90 % interval of the mean of its sections; None if there is none, see `why_not`.
        wolf: largest threshold at which Wolf's pruning leaves it, likewise; None for a single step.
        sections: across it, that these rest on.
        why_not: one sentence saying why there is no height, "" if there is one.
    """

    id: str
    method: str
    height: Interval | None
    wolf: Interval | None
    sections: int
    why_not: str = ""

    def record(self) -> dict[str, Any]:
        """The same in JSON's types, m."""
        sizes = {name: getattr(self, name) for name in ("height", "wolf")}
        known = {
            name: None if size is None else {"median": size.median, "low": size.low, "high": size.high}
            for name, size in sizes.items()
        }
        return {"id": self.id, "method": self.method, "sections": self.sections, "why_not": self.why_not} | known

    def row(self) -> tuple[str, str, str, str]:
        """Feature, method, height and Wolf's height, as text; the reason in place of a height that there is not."""
        height = f"{self.height} in {count_text(self.sections, 'section')}" if self.height else self.why_not
        return self.id, self.method, height, str(self.wolf) if self.wolf else ""


def has_sections(feature: Feature) -> bool:
    """True of what the standards have sections of: ridges, grooves and steps, and what is like them in a profile."""
    return bool(feature.details.free_section) or (kind_of(feature).line and kind_of(feature).sampled)


def standard_heights(trace: LaidTrace, features: Sequence[Feature]) -> tuple[StandardHeight, ...]:
    """The ridges, grooves and steps of a trace by the standards, in their order, then what pairs of steps bound.

    Args:
        trace: laid on its base.
        features: found on it, with their ids.
    """
    lines = [_Line.of(feature, trace) for feature in features if has_sections(feature)]
    wanted = [line for line in lines if not line.why_not]
    bounded: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for sweep in trace.laid_sweeps if wanted else ():
        if len(sweep.trace) < 3:
            continue
        apart = float(sweep.arclength[-1]) / (len(sweep.trace) - 1)
        for piece in sweep.heights(max(apart, min(line.bin_width for line in wanted))):
            steps = []
            for line in wanted:
                others = [feature for feature in features if feature is not line.feature]
                crossing = _Crossing.of(piece, line, others, trace.tip_radius)
                if crossing is not None and line.is_step:
                    steps.append((crossing.middle, line, line.measure_step(crossing)))
                elif crossing is not None:
                    line.measure(crossing, piece)
            steps.sort(key=lambda step: step[0])
            for (start, first, up), (stop, second, down) in pairwise(steps):
                if up * down < 0.0 and not _between(piece, start, stop, features, trace.tip_radius):
                    depth, wolf = _bounded_by(piece, start, stop, up > 0.0)
                    bounded.setdefault((first.feature.id, second.feature.id), []).append((depth, wolf))
    pairs = [
        _result(f"{one} to {other}", "ISO 5436-1 A1", [depth for depth, _ in values], [wolf for _, wolf in values])
        for (one, other), values in bounded.items()
        if np.isfinite([depth for depth, _ in values]).any()
    ]
    return (*(line.result() for line in lines), *pairs)


@dataclass
class _Line:
    """One feature, the portions that its sections need, and what its sections gave.

    Args:
        feature: a ridge, a groove or a step.
        method: by which it is measured.
        edge: half of what is left out beside an edge of a step, m; else half of the width as it is felt.
        span: so far to either side its section goes, m.
        bin_width: of heights that are fine enough, m.
        why_not: why it has no section, "" if it may have.
    """

    feature: Feature
    method: str
    edge: float
    span: float
    bin_width: float
    why_not: str = ""
    heights: list[float] = field(default_factory=list)
    wolf: list[float] = field(default_factory=list)

    @property
    def is_step(self) -> bool:
        return kind_of(self.feature).sided

    @classmethod
    def of(cls, feature: Feature, trace: LaidTrace) -> _Line:
        width, tip = feature.width.median, trace.tip_radius
        # so far from an edge of that height the ball does not lie on what is beside it
        reach = float(contact_half_width(min(abs(feature.height.median), tip), 0.0, tip))
        if kind_of(feature).sided:
            edge = max(reach + 0.5 * width, _BINS / _SIDE_PER_EDGE * _spacing(trace))
            side = _SIDE_PER_EDGE * edge
            return cls(feature, "parallel lines", edge, edge + side, side / _BINS)
        top = feature.details.top
        method = f"ISO 5436-1 A{1 if top is not None and top >= _FLAT_SHARE * width else 2}"
        why = ""
        if feature.width.censored or 3.0 * reach > width:
            why = (
                f"a tip of {length_text(tip)} bridges {length_text(reach, 2)} beside each edge: the standard's "
                f"portions need a width of {length_text(3.0 * reach, 2)}, known to be there"
            )
        return cls(feature, method, 0.5 * width + reach, 1.5 * width, width / 3.0 / _BINS, why)

    def measure_step(self, crossing: _Crossing) -> float:
        """By how much a sweep rises over the step, m, NaN if it cannot be told."""
        rise = level_difference(crossing.u, crossing.z, self.edge, self.span - self.edge)
        self.heights.append(float(np.copysign(rise, self.feature.height.median)))
        return rise

    def measure(self, crossing: _Crossing, piece: SweepHeights) -> None:
        """A section across a ridge or a groove."""
        by = flat_height if self.method.endswith("1") else round_height
        self.heights.append(by(crossing.u, crossing.z, self.feature.width.median))
        felt = np.zeros(len(piece.height), dtype=bool)
        felt[crossing.bins[np.abs(crossing.u) <= self.edge]] = True
        self.wolf.append(wolf_height(piece.height, piece.spacing, felt, self.edge, self.feature.height.median > 0.0))

    def result(self) -> StandardHeight:
        return _result(self.feature.id, self.method, self.heights, self.wolf, self.why_not)


@dataclass(frozen=True, eq=False)
class _Crossing:
    """Where a sweep crosses a line: its middle bin, and bins, places across (along the way) and heights, (n,) each."""

    middle: int
    bins: IntArray
    u: FloatArray
    z: FloatArray

    @classmethod
    def of(cls, piece: SweepHeights, line: _Line, others: Sequence[Feature], tip_radius: float) -> _Crossing | None:
        """The crossing of one line, None if there is no section of it.

        A section begins and ends beside the feature, is no nearer to the line's known ends than it is long, holds no
        other feature, and crosses under more than 30 degrees.
        """
        feature, span = line.feature, line.span
        places = piece.centers if piece.feet is None else piece.feet
        low, high = feature.axis.min(axis=0) - 2.0 * span, feature.axis.max(axis=0) + 2.0 * span
        inside = np.flatnonzero(((places >= low) & (places <= high)).all(axis=1))
        if len(inside) < 2:
            return None
        on_axis, along = nearest_on(places[inside], feature.axis)
        middle = int(np.linalg.norm(places[inside] - on_axis, axis=1).argmin())
        side = way = np.gradient(places[inside], axis=0)[middle]
        if len(feature.axis) > 1:
            s, at = arclengths(feature.axis), float(along[middle])
            first_seen, last_seen = feature.details.ends_seen or (False, False)
            if not feature.closed and ((first_seen and at < span) or (last_seen and at > s[-1] - span)):
                return None
            leg = min(int(np.searchsorted(s, at, side="right")), len(s) - 1)
            side = np.cross(feature.normals[leg], feature.axis[leg] - feature.axis[leg - 1])
        side = side / max(float(np.linalg.norm(side)), np.finfo(float).tiny)
        across = float(way @ side)
        if abs(across) <= _ACROSS * float(np.linalg.norm(way)):
            return None
        u = (places[inside] - on_axis[middle]) @ side * np.sign(across)
        part = _run(np.abs(u) <= span, inside, middle)
        if part.start == part.stop or any(
            (distances(places[inside[part]], other.axis) < sizes_of(other, tip_radius).half_width).any()
            for other in others
        ):
            return None
        bins = inside[part]
        return cls(int(inside[middle]), bins, u[part], piece.height[bins])


def _run(wanted: BoolArray, bins: IntArray, middle: int) -> slice:
    """The wanted bins in a row about one of them: a later pass over the same place is another crossing."""
    breaks = np.flatnonzero(~wanted[:-1] | ~wanted[1:] | (np.diff(bins) != 1)) + 1
    which = int(np.searchsorted(breaks, middle, side="right"))
    edges = [0, *breaks.tolist(), len(bins)]
    return slice(edges[which], edges[which + 1]) if wanted[middle] else slice(0, 0)


def _between(piece: SweepHeights, start: int, stop: int, features: Sequence[Feature], tip_radius: float) -> bool:
    """True if a sweep meets any other detail than steps where the standard's portions of a pair of steps lie."""
    width = stop - start
    if start - width < 0 or stop + width > len(piece.height) - 1:
        return True
    places = (piece.centers if piece.feet is None else piece.feet)[start - width : stop + width + 1]
    return any(
        (distances(places, each.axis) < sizes_of(each, tip_radius).half_width).any()
        for each in features
        if not kind_of(each).sided
    )


def _bounded_by(piece: SweepHeights, start: int, stop: int, up: bool) -> tuple[float, float]:
    """Height of what two steps bound, negative of a groove, and Wolf's of the same, m."""
    width = piece.spacing * (stop - start)
    u = piece.spacing * (np.arange(len(piece.height)) - 0.5 * (start + stop))
    near = np.abs(u) <= 1.5 * width
    between = np.abs(u) <= 0.5 * width
    return flat_height(u[near], piece.height[near], width), wolf_height(
        piece.height, piece.spacing, between, 0.5 * width, up
    )


def _spacing(trace: LaidTrace) -> float:
    """The largest mean distance of a sweep's samples, m."""
    sweeps = [sweep for sweep in trace.laid_sweeps if len(sweep.trace) > 2]
    return max((float(sweep.arclength[-1]) / (len(sweep.trace) - 1) for sweep in sweeps), default=0.0)


def _result(
    name: str, method: str, heights: Sequence[float], wolf: Sequence[float], why_not: str = ""
) -> StandardHeight:
    known = [height for height in heights if np.isfinite(height)]
    why = why_not or ("" if known else "no sweep crosses it with enough samples, and nothing else, beside it")
    return StandardHeight(
        name, method, _mean(known), _mean([each for each in wolf if np.isfinite(each)]), len(known), why
    )


def _mean(values: Sequence[float]) -> Interval | None:
    """The mean of sections with its 90 % interval by Student's t; of a single one the value alone."""
    from scipy.special import stdtrit

    if not values:
        return None
    mean = float(np.mean(values))
    if len(values) == 1:
        return Interval(mean, mean, mean)
    wide = float(stdtrit(len(values) - 1, 0.95) * np.std(values, ddof=1) / np.sqrt(len(values)))
    return Interval(mean, mean - wide, mean + wide)
