"""Cross-section: what one sweep felt across a feature, beside what the feature's record predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import BoolArray, Feature, FloatArray, IntArray, Interval, Trace
from mapping.base import Base, Feet, LaidTrace, over_levels
from mapping.detection import Crossing
from mapping.estimate.envelope import Estimate
from mapping.estimate.sweeps import BRIDGED
from mapping.geometry.mesh import directions, middle, nearest_on
from mapping.inference.kinds import feature_trace, kind_of

# The section reaches so many half-widths of the disturbance to either side.
SECTION_REACH = 2.4
SECTION_BINS = 60
GRID = 241
# Share of a feature's height that is not to be seen beside it: two pixels of a panel
UNSEEN_SHARE = 0.01
# Half-widths to either side that a section shows if one of the nearest sweeps does: both flanks end at one. Of
# many that turn on the crest no more are laid on the base than a bound on time allows
BOTH_SIDES, MOST_PASSAGES = 1.0, 8
# Sine of the angle at which a sweep must cross a line to show its section: 30 degrees
LEAST_SINE = 0.5
# Half-widths, and standard deviations of places along the sweep, by which samples may go back before it has turned: not
# to be seen, and more than noise moves one of thousands
GONE_BACK, GONE_BACK_SDS = 0.05, 6.0


@dataclass(frozen=True, eq=False)
class CrossSection:
    """Heights over the base along one sweep, at signed distances from the feature's crest.

    Args:
        feature: whose crest it is.
        sweep: number of the sweep.
        x, height: (N,) samples: distance across the feature, and height over the base, or its level, m.
        bin_x, bin_height, bin_sd: (M,) means over equal bins, and their standard errors, m.
        grid, predicted, low, high: (G,) places, and the trace of the recorded feature there, on the level of the
            samples about it: median, and the 5 % and 95 % quantiles of its height.
        body_x, body_z, bridged: (B,) the estimated surface over the base along the sweep, m, and where the tip
            bridged it; empty if no surface was estimated.
        across: True if x is measured across a line, False if along the sweep over a point.
    """

    feature: Feature
    sweep: int
    x: FloatArray
    height: FloatArray
    bin_x: FloatArray
    bin_height: FloatArray
    bin_sd: FloatArray
    grid: FloatArray
    predicted: FloatArray
    low: FloatArray
    high: FloatArray
    body_x: FloatArray
    body_z: FloatArray
    bridged: BoolArray
    across: bool


def cross_section(
    feature: Feature,
    trace: Trace,
    base: Base,
    crossings: Sequence[Crossing],
    estimate: Estimate | None = None,
    others: Sequence[Feature] = (),
) -> CrossSection | None:
    """The section along the sweep that crosses nearest to the feature's middle, of a line one of those that show both
    its sides if there are such; None if no sweep does.

    Args:
        feature: what was found.
        trace: all samples.
        base: the global model.
        crossings: detections on the trace.
        estimate: the estimated surface of the same trace.
        others: features that the trace shows, too; the feature itself may be among them.
    """
    laid, best = LaidTrace.of(trace, base), None
    # over a point each sweep shows another height: that nearest to its middle tells most
    most = MOST_PASSAGES if len(feature.axis) > 1 else 1
    nearest: Sequence[Crossing | None] = _nearest_crossings(feature, trace.tip_radius, crossings)[:most]
    for crossing in nearest or [None]:
        own = _Passage.of(feature, crossing, laid)
        if own is not None and (best is None or own.shown > best.shown):
            best = own
        if best is not None and best.shown >= BOTH_SIDES:
            break
    if best is None:
        return None
    window, feet, half, heading, index, x = best.window, best.feet, best.half, best.heading, best.index, best.x
    grid = np.linspace(x[0], x[-1], GRID)
    points, normals = (_interpolated(grid, x, getattr(feet, name)[index]) for name in ("points", "normals"))
    sizes = [feature.height.median, feature.height.low, feature.height.high]
    curves = [_trace_of(feature, size, grid, points, normals, trace.tip_radius) for size in sizes]
    height = over_levels(feet.height[index], np.zeros(0, dtype=np.int64), base.levels)
    level = float(feet.height[index][0] - height[0])
    bins = _binned(x, height)
    felt = np.interp(grid, x, height)
    if kind_of(feature).sided:
        curves = _aligned(curves, felt)
    else:  # the level about it is the fit's own: noise that is correlated and drifts move it
        alone = _alone(feature, others, points, normals, trace.tip_radius)
        curves = [curve + float(np.median((felt - curves[0])[alone])) for curve in curves]
    sweep = int(trace.sweep[window[0]])
    return CrossSection(
        feature,
        sweep,
        x,
        height,
        *bins,
        grid,
        curves[0],
        np.minimum(curves[1], curves[2]),
        np.maximum(curves[1], curves[2]),
        *_body(feature, window[index], half, heading, estimate, base, trace.tip_radius, level),
        len(feature.axis) > 1,
    )


@dataclass(frozen=True, eq=False)
class _Passage:
    """One sweep over a feature.

    Args:
        window: (W,) samples of the sweep about it.
        feet: of these on the base.
        half: half of the strip that the feature disturbs, m.
        heading: of the sweep over a point; None over a line.
        index: (N,) of the window: those that the section shows, in the order of x.
        x: (N,) their distances from the crest, m.
    """

    window: IntArray
    feet: Feet
    half: float
    heading: FloatArray | None
    index: IntArray
    x: FloatArray

    @classmethod
    def of(cls, feature: Feature, crossing: Crossing | None, trace: LaidTrace) -> _Passage | None:
        """That about a crossing, or nearest to the middle; None if it has hardly a sample."""
        window = _window(feature, crossing, trace)
        if len(window) == 0:
            return None
        feet = trace.feet(window)
        half = max(half_width(feature, trace.tip_radius), 0.0 if crossing is None else crossing.half_width)
        heading = _heading(feature, feet.points, half)
        x, beside = _place(feature, feet.points, feet.normals, heading)
        near = (np.abs(x) < SECTION_REACH * half) & (beside < half) & _one_way(x, beside, half)
        index = np.flatnonzero(near)[np.argsort(x[near], kind="stable")]
        return None if len(index) < 3 else cls(window, feet, half, heading, index, x[index])

    @property
    def shown(self) -> float:
        """How far it goes on the side that it shows less of, in half-widths."""
        return float(min(-self.x[0], self.x[-1])) / self.half


def half_width(feature: Feature, tip_radius: float) -> float:
    """Half of the strip that the feature disturbs on the trace, m (theory section 6)."""
    width = feature.width.median if np.isfinite(feature.width.median) else 0.0
    if feature.height.median < 0:
        return max(0.5 * width, float(np.sqrt(2 * tip_radius * abs(feature.height.median))))
    return float(np.sqrt(2 * tip_radius * abs(feature.height.median))) + 0.5 * width


def _nearest_crossings(feature: Feature, tip_radius: float, crossings: Sequence[Crossing]) -> list[Crossing]:
    """The crossings of the feature, not along it, that which lies nearest to its middle first."""
    reference, _ = middle(feature.axis)
    half = half_width(feature, tip_radius)
    close = [
        crossing
        for crossing in crossings
        if np.linalg.norm(crossing.point - nearest_on(crossing.point[None], feature.axis)[0][0]) < half
        and (len(feature.axis) == 1 or _angle(crossing, feature) > LEAST_SINE)
    ]
    return sorted(close, key=lambda crossing: float(np.linalg.norm(crossing.point - reference)))


def _window(feature: Feature, crossing: Crossing | None, trace: Trace) -> IntArray:
    """Samples of the sweep around the crossing; without one, of the sweep that passes nearest to the middle."""
    if crossing is None:
        return _nearest_passage(feature, trace)
    own = np.flatnonzero(trace.sweep == crossing.sweep)
    # A sweep may cross a feature many times: what is far from this crossing is another one.
    margin = 1.5 * (crossing.stop - crossing.start) + 10
    return own[max(0, int(crossing.start - margin)) : int(crossing.stop + margin)]


def _one_way(x: FloatArray, beside: FloatArray, half: float) -> BoolArray:
    """Samples from the one in the middle of the section to where the sweep turns on either side.

    A sweep that turns within the section passes the same distances twice, at other places of the feature.
    """
    # second differences of places along an even way are noise, of a variance six times as large
    noise = float(np.median(np.abs(np.diff(x, 2)))) / (0.6745 * np.sqrt(6.0)) if len(x) > 2 else 0.0
    least = max(GONE_BACK * half, GONE_BACK_SDS * noise)
    on, ways = int(np.hypot(x, beside).argmin()), list[tuple[float, IntArray]]()
    for own in (np.arange(on, len(x)), np.arange(on, -1, -1)):
        away = x[own] - x[on]
        way = float(np.sign(away[int(np.argmax(np.abs(away) > least))]))
        gone = way * away
        back = np.maximum.accumulate(gone) - gone > least
        ways.append((way, own[: int(np.argmax(gone[: int(np.argmax(back))])) + 1] if back.any() else own))
    if ways[0][0] == ways[1][0]:  # it turns just there
        ways = [max(ways, key=lambda each: len(each[1]))]
    kept = np.zeros(len(x), dtype=bool)
    for _, own in ways:
        kept[own] = True
    return kept


def _nearest_passage(feature: Feature, trace: Trace) -> IntArray:
    """Samples of the sweep that passes nearest to the middle of the crest, among those that do not run along it."""
    half = half_width(feature, trace.tip_radius)
    number = len(feature.axis) // 2
    above = middle(feature.axis)[0] + trace.tip_radius * feature.normals[number]
    away = np.linalg.norm(trace.centers - above, axis=1)
    close = np.flatnonzero(away < max(2.0 * half, 1.5 * float(away.min())))
    passages: dict[int, float] = {}
    for sweep in np.unique(trace.sweep[close]):
        own = close[trace.sweep[close] == sweep]
        way = trace.centers[own[-1]] - trace.centers[own[0]]
        length = float(np.linalg.norm(way))
        if len(feature.axis) > 1 and length > 0.0:
            along = directions(feature.axis)[min(number, len(feature.axis) - 1)]
            if np.linalg.norm(np.cross(way, along)) < LEAST_SINE * length:
                continue
        passages[int(sweep)] = float(away[own].min())
    if not passages:
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero(trace.sweep == min(passages, key=lambda sweep: passages[sweep]))


def _interpolated(grid: FloatArray, x: FloatArray, vectors: FloatArray) -> FloatArray:
    """(len(grid), 3) vectors given at x (N,), between them."""
    return np.column_stack([np.interp(grid, x, vectors[:, i]) for i in range(3)])


def _angle(crossing: Crossing, feature: Feature) -> float:
    """Sine of the angle between the sweep and the feature's axis at the crossing."""
    near = int(np.linalg.norm(feature.axis - crossing.point, axis=1).argmin())
    return float(np.linalg.norm(np.cross(directions(feature.axis)[near], crossing.tangent)))


def _heading(feature: Feature, points: FloatArray, half: float) -> FloatArray | None:
    """(3,) unit vector of the sweep over a point, from its samples (N, 3) within the disturbance; None for lines.

    Fewer samples would not do: noise moves single ones further than they lie apart.
    """
    if len(feature.axis) > 1:
        return None
    offset = points - feature.axis[0]
    away = np.linalg.norm(offset, axis=1)
    near = offset[away < max(half, float(np.partition(away, min(2, len(away) - 1))[min(2, len(away) - 1)]))]
    heading: FloatArray = np.linalg.svd(near - near.mean(axis=0), full_matrices=False)[2][0]
    forward: FloatArray = heading * np.sign(heading[int(np.abs(heading).argmax())])
    return forward


def _place(
    feature: Feature, points: FloatArray, normals: FloatArray, heading: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Signed distance of base points (N, 3) across the crest, and how far they lie beside the section, m.

    Across a line the sign is that of normal x tangent, and beside means beyond its ends. Over a point the
    distance is along the heading of the sweep, and beside is across it.
    """
    if heading is None:
        closest, s = nearest_on(points, feature.axis)
        offset = points - closest
        leg = np.clip(np.searchsorted(_knots(feature), s, side="right") - 1, 0, len(feature.axis) - 2)
        along = np.diff(feature.axis, axis=0)[leg]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
        left = np.cross(normals, along)
        return np.einsum("ij,ij->i", offset, left), np.abs(np.einsum("ij,ij->i", offset, along))
    offset = points - feature.axis[0]
    x = offset @ heading
    return x, np.sqrt(np.maximum((offset**2).sum(axis=1) - x**2, 0.0))


def _knots(feature: Feature) -> FloatArray:
    steps = np.linalg.norm(np.diff(feature.axis, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _trace_of(
    feature: Feature, height: float, x: FloatArray, points: FloatArray, normals: FloatArray, tip_radius: float
) -> FloatArray:
    """(N,) heights over the base's trace that the feature would leave if it were so high, m."""
    # The radius that the record may hold belongs to its median height.
    own = height == feature.height.median
    details = feature.details if own else replace(feature.details, radius=None)
    so_high = replace(feature, height=Interval(height, height, height), details=details)
    return kind_of(feature).profile(so_high, x, points, normals, tip_radius)


def _alone(
    feature: Feature, others: Sequence[Feature], points: FloatArray, normals: FloatArray, tip_radius: float
) -> BoolArray:
    """(N,) True where other features that end leave nothing; everywhere if there is no such place."""
    left = np.zeros(len(points))
    for other in others:
        if other is not feature and kind_of(other).sampled and not kind_of(other).sided:
            left += np.abs(feature_trace(other, points, normals, tip_radius))
    alone = left < UNSEEN_SHARE * abs(feature.height.median)
    return alone if alone.any() else np.ones(len(points), dtype=bool)


def _aligned(curves: list[FloatArray], height: FloatArray) -> list[FloatArray]:
    """Steps turned and shifted to the samples: the record does not say which side is high."""
    best: tuple[float, list[FloatArray]] | None = None
    for turned in (curves, [curve[::-1] for curve in curves]):
        shift = float(np.median(height - turned[0]))
        misfit = float(((height - turned[0] - shift) ** 2).sum())
        if best is None or misfit < best[0]:
            best = misfit, [curve + shift for curve in turned]
    assert best is not None
    return best[1]


def _binned(x: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Means over at most SECTION_BINS equal bins of x: places, heights, standard errors (0 for single samples)."""
    count = min(SECTION_BINS, max(1, len(x) // 3))
    bins = np.clip(((x - x[0]) / max(np.ptp(x), np.finfo(float).tiny) * count).astype(np.int64), 0, count - 1)
    number = np.bincount(bins, minlength=count)
    # The outermost bins may hold a single stray sample.
    kept = number > 0.25 * np.median(number)
    number = np.maximum(number, 1)
    place, mean = (np.bincount(bins, weights=v, minlength=count) / number for v in (x, height))
    spread = np.bincount(bins, weights=(height - mean[bins]) ** 2, minlength=count) / np.maximum(number - 1, 1)
    return place[kept], mean[kept], np.sqrt(spread / number)[kept]


def _body(
    feature: Feature,
    samples: IntArray,
    half: float,
    heading: FloatArray | None,
    estimate: Estimate | None,
    base: Base,
    tip_radius: float,
    level: float,
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """The estimated surface along the sweep: places, heights over the base's level, and where it was bridged.

    Only that which stems from the section's own samples (N,), or lies between them: the same sweep may pass the feature
    again, beyond its end. What balls between this sweep and its neighbours would leave lies beside it: it comes after
    all that stems from samples.
    """
    if estimate is None:
        return np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool)
    felt = np.flatnonzero((estimate.sample >= samples.min()) & (estimate.sample <= samples.max()))
    own = np.arange(felt[0], felt[-1] + 1) if len(felt) else felt
    near = np.linalg.norm(estimate.points[own] - nearest_on(estimate.points[own], feature.axis)[0], axis=1)
    own = own[near < 2.0 * SECTION_REACH * half]
    foot = base.foot(estimate.points[own], tip_radius)
    x, beside = _place(feature, foot.points, foot.normals, heading)
    keep = np.flatnonzero((np.abs(x) < SECTION_REACH * half) & (beside < half))
    order = keep[np.argsort(x[keep], kind="stable")]
    return x[order], foot.height[order] + tip_radius - level, estimate.labels[own][order] == BRIDGED
