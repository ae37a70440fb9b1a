"""Summary: the feature that posterior draws describe, and which of its ends were only seen to go at least so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapping import Feature, FloatArray, Interval, Posterior
from mapping.base import Base, onto_base
from mapping.inference.curves import Chart, ends_on_face
from mapping.inference.families import LineShape, PosteriorProblem, with_nominal_tip
from mapping.inference.kinds import PointShape, kind_of

# Draws that lengths of curves are measured on, and points of the reported axis.
FEW_DRAWS = 400
AXIS_POINTS = 64


def describe(
    problem: PosteriorProblem, posterior: Posterior, base: Base, likeliest: FloatArray | None = None
) -> Feature:
    """The detected feature with axis, intervals and standard deviation from the draws of its posterior.

    Args:
        problem, posterior: whose parameters were drawn.
        base: the global model.
        likeliest: (P,) of the draws; None: the density tells.
    """
    full, problem = posterior, with_nominal_tip(problem)
    shape: Any = problem.target.shape
    # What is described is the feature: the draws of a free tip's radius, in the last column, are left out.
    posterior = replace(full, samples=full.samples[:, : len(shape.names)])
    if kind_of(problem.feature).line:
        feature = _describe_line(problem, shape, posterior, base, likeliest)
    else:
        feature = _describe_point(problem, shape, posterior, base)
    notes = tuple(note for note in (*feature.notes, *_warnings(posterior)) if note)
    return replace(feature, posterior=full, notes=tuple(dict.fromkeys(notes)))


def described_at(theta: FloatArray, problem: PosteriorProblem, base: Base) -> Feature:
    """The feature that parameters (P,) of the problem's shape describe, without intervals."""
    shape, nan = problem.target.shape, float("nan")
    one = Posterior(shape.names, shape.units, theta[None], nan, nan, "not needed", "only the optimum was asked for")
    return describe(problem, one, base)


def _warnings(posterior: Posterior) -> tuple[str, ...]:
    if posterior.trusted:
        return ()
    return (f"posterior: {posterior.status}: {posterior.reason}",)


def _describe_point(problem: PosteriorProblem, shape: PointShape, posterior: Posterior, base: Base) -> Feature:
    draws = posterior.samples
    place = np.zeros((1, 2))
    place[0, : shape.free] = np.median(draws[:, : shape.free], axis=0)
    point = shape.spot.lifted(place, np.zeros(1))
    axis, normals = onto_base(point, shape.spot.normal[None], base, shape.tip_radius)
    sd = float(np.sqrt((draws[:, : shape.free].std(axis=0) ** 2).mean()))
    section = kind_of(problem.feature).section(problem.feature, shape, draws)
    notes = [section.note] if section.note else []
    if shape.free == 1:
        notes.append("seen by a single sweep: the position across it is not known")
    return replace(
        problem.feature,
        axis=axis,
        normals=normals,
        height=section.height,
        width=section.width,
        length=Interval(0.0, 0.0, 0.0),
        position_sd=sd,
        notes=(*problem.feature.notes, *notes),
        details=replace(problem.feature.details, **section.details),
    )


def _describe_line(
    problem: PosteriorProblem, shape: LineShape, posterior: Posterior, base: Base, likeliest: FloatArray | None
) -> Feature:
    draws, chart, modes = posterior.samples, shape.chart, shape.modes
    has_ends = not chart.closed and kind_of(problem.feature).has_ends
    low, high = float(chart.s[0]), float(chart.s[-1])
    if has_ends:
        ends = _ends(problem)
        low, high = np.median(on_face(draws, ends, shape), axis=0).tolist()
    count = AXIS_POINTS if (chart.closed or len(chart.s) > 8 or modes.degree > 1) else 2
    s = np.linspace(low, high, count)
    points, laterals, normals, bend = chart.at(s)
    courses = modes.lateral(draws[:, : modes.count], s)
    aside = np.median(courses, axis=0)
    points = points + aside[:, None] * laterals - (0.5 * bend * aside**2)[:, None] * normals
    axis, normals = onto_base(points, normals, base, shape.tip_radius)
    if chart.closed:
        axis[-1], normals[-1] = axis[0], normals[0]
    section = kind_of(problem.feature).section(problem.feature, shape, draws)
    best = None
    if has_ends:
        best = _likeliest(problem, draws) if likeliest is None else likeliest
    seen = None if best is None else explored(problem, best)
    length, notes = _length(problem, shape, draws, best, seen)
    # Along the axis: how well it is known across itself, and its two ends along itself (first, last).
    known: dict[str, Any] = {"axis_sd": courses.std(axis=0)}
    if has_ends:
        spans = np.quantile(on_face(draws, ends, shape), [0.05, 0.95], axis=0) - [low, high]
        known |= {"end_intervals": spans.T, "ends_seen": seen}
    return replace(
        problem.feature,
        axis=axis,
        normals=normals,
        height=section.height,
        width=section.width,
        length=length,
        position_sd=float(np.sqrt(courses.var(axis=0).mean())),
        # what assembly said of an end that the posterior speaks of is not said twice
        notes=(
            *(each for each in problem.feature.notes if not (notes and each.startswith(RUNS_ON))),
            *notes,
            *([section.note] if section.note else []),
        ),
        details=replace(problem.feature.details, **section.details, **known),
    )


def _likeliest(problem: PosteriorProblem, draws: FloatArray) -> FloatArray:
    """(P,) the draw of the highest density."""
    distinct = np.unique(draws, axis=0)  # a weighted draw is there as often as it weighs
    return np.asarray(distinct[int(np.argmax(problem.target.log_density(distinct)))])


def _ends(problem: PosteriorProblem) -> list[int]:
    """Columns of the places of the two ends."""
    names = problem.target.shape.names
    return [names.index("start"), names.index("end")]


def on_face(draws: FloatArray, columns: Sequence[int], shape: LineShape) -> FloatArray:
    """(S, 2) places along the chart of the ends of draws (S, P), m; where they are open at an edge of the body, its."""
    return ends_on_face(shape.chart, shape.modes, draws[:, : shape.modes.count], draws[:, columns])


def _length(
    problem: PosteriorProblem,
    shape: LineShape,
    draws: FloatArray,
    best: FloatArray | None,
    seen: tuple[bool, bool] | None,
) -> tuple[Interval, list[str]]:
    """The length, and what is to be said of it; the likeliest draw and `explored`, None of a line without ends."""
    chart = shape.chart
    some = draws[:: max(1, len(draws) // FEW_DRAWS)]
    ends = np.tile(chart.s[[0, -1]], (len(some), 1)) if seen is None else on_face(some, _ends(problem), shape)
    interval = _of_smooth(Interval.from_draws(_lengths(shape, some, ends)), chart)
    if chart.closed:
        return interval, []
    if best is None or seen is None:
        return replace(interval, censored=True), [
            f"the length of a {problem.feature.kind} is what was explored of it: at least this"
        ]
    if all(seen):
        return interval, []
    first, last = demanded(problem, best, seen)
    sure = np.sort(np.column_stack([np.maximum(ends[:, 0], first), np.minimum(ends[:, 1], last)]), axis=1)
    low = float(np.quantile(_lengths(shape, some, sure), 0.05))
    return replace(interval, low=min(low, interval.low), censored=True), [*with_open_ends((), seen)]


def _lengths(shape: LineShape, draws: FloatArray, ends: FloatArray) -> FloatArray:
    """(S,) lengths of the courses of draws (S, P) between two places along the chart (S, 2), m.

    Each is as long on its chords as the chart there, and as a smooth curve.
    """
    chart, modes = shape.chart, shape.modes
    share = np.linspace(0.0, 1.0, AXIS_POINTS if len(chart.s) > 8 or modes.degree > 1 else 2)
    s = ends[:, :1] + share * (ends[:, 1:] - ends[:, :1])
    points, laterals, _, _ = chart.at(s)
    aside = np.einsum("sm,msk->sk", draws[:, : modes.count], modes.basis(s))
    chords, own = (np.linalg.norm(np.diff(of, axis=1), axis=2) for of in (points, points + aside[..., None] * laterals))
    smooth = np.diff(np.interp(s, chart.s, chart.arcs), axis=1)
    stretched = np.divide(smooth, chords, out=np.ones_like(chords), where=chords > 0.0)
    return np.asarray(np.einsum("sk,sk->s", own, stretched))


def _of_smooth(length: Interval, chart: Chart) -> Interval:
    """A length with the doubt of its course between the chart's points: it may be as short as the chords there."""
    cut = (float(chart.arcs[-1]) / chart.length - 1.0) * length.median
    return replace(length, low=length.low - cut, high=length.high + cut)


def with_ends_of_all(feature: Feature, likely: Sequence[tuple[float, PosteriorProblem, Posterior]]) -> Feature:
    """A line with the length and the doubt of its ends that all likely families agree on: each ends in its own way.

    Args:
        feature: as its most probable family describes it.
        likely: weight, problem and posterior of each family, the most probable one first.
    """
    if len(likely) == 1 or feature.length.censored or feature.details.end_intervals is None:
        return feature
    total = sum(share for share, _, _ in likely)
    lengths, places, middle = list[FloatArray](), list[FloatArray](), np.zeros(2)
    for share, problem, posterior in likely:
        problem = with_nominal_tip(problem)
        shape: Any = problem.target.shape
        columns, draws = _ends(problem), posterior.samples[:, : len(shape.names)]
        if not places:
            middle = np.median(on_face(draws, columns, shape), axis=0)
        some = draws[np.linspace(0, len(draws) - 1, round(FEW_DRAWS * share / total)).astype(np.int64)]
        ends = on_face(some, columns, shape)
        places.append(ends - middle)
        lengths.append(_lengths(shape, some, ends))
    spans = np.quantile(np.concatenate(places), [0.05, 0.95], axis=0)
    details = replace(feature.details, end_intervals=spans.T)
    line: Any = with_nominal_tip(likely[0][1]).target.shape
    length = _of_smooth(Interval.from_draws(np.concatenate(lengths)), line.chart)
    return replace(feature, length=length, details=details)


# An end that may as well lie at the limit of what was looked at was not seen: no more log density against it.
UNSEEN = 3.0
# Places between which an end that was not seen is looked for, from the limit to the other end: half a per cent of that,
# and the one that is denied is told
PLACES_OF_END = 200
GOES_ON = "the axis goes on beyond what was explored"
# What assembly says of a line by where its crossings end; the posterior says it of each end
RUNS_ON = "runs on where nothing was inspected"


def explored(problem: PosteriorProblem, best: FloatArray) -> tuple[bool, bool]:
    """For the first and the last end: True if the data say that the axis does not go on.

    The best of the draws is moved out to the limit of the end's prior; if the density hardly drops, nothing was
    measured that could have shown the end, and the length is only bounded from below (a censored value). No line goes
    on beyond an edge of the body: where the data say that it goes on to there, its end was seen.
    """
    target = problem.target
    shape: Any = target.shape
    columns, chart = _ends(problem), shape.chart
    limits = np.array([target.low[columns[0]], target.high[columns[1]]])
    # as far before an edge as the limit is beyond
    before = 2.0 * chart.s[[0, -1]] - limits
    tried = np.tile(best, (5, 1))
    for end, column in enumerate(columns):
        tried[1 + end, column], tried[3 + end, column] = limits[end], before[end]
    value = target.log_density(tried)
    ended, goes_to_edge = value[0] - value[1:3] > UNSEEN, value[0] - value[3:] > UNSEEN
    at_edge = np.array([wall is not None for wall in chart.walls])
    first, last = ended | (at_edge & goes_to_edge)
    return bool(first), bool(last)


def demanded(problem: PosteriorProblem, best: FloatArray, seen: tuple[bool, bool]) -> tuple[float, float]:
    """How far the data demand that the axis goes, along it, m; infinitely far out of an end that was seen.

    Beyond what was looked at all places of an end are alike, and draws are of the prior there: their 5 % quantile lies
    where nothing was felt. The best of the draws is moved in from the limit until the density speaks against it.
    """
    target, columns = problem.target, _ends(problem)
    limits, places = (target.low[columns[0]], target.high[columns[1]]), [-np.inf, np.inf]
    for i, column in enumerate(columns):
        if not seen[i]:
            tried = np.linspace(limits[i], best[columns[1 - i]], PLACES_OF_END)[:-1]
            moved = np.tile(best, (len(tried), 1))
            moved[:, column] = tried
            value = target.log_density(moved)
            denied = np.flatnonzero(value < value[0] - UNSEEN)
            places[i] = float(tried[denied[0] if len(denied) else -1])
    return places[0], places[1]


def with_open_ends(notes: Sequence[str], seen: Sequence[bool]) -> tuple[str, ...]:
    """The notes of a line with the one that says which of its ends (first, last) were not seen, if any."""
    open_ends = [name for name, known in zip(("first", "last"), seen, strict=True) if not known]
    note = f"{GOES_ON} at its {' and its '.join(open_ends)} point: at least this long"
    rest = tuple(each for each in notes if not each.startswith(GOES_ON))
    return (*rest, note) if open_ends else rest
