"""Grammar: crossings of sweeps become bumps, ridges, pits, grooves and steps."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapping.base import Base
from mapping.crossing import Crossing
from mapping.detectors import Detections
from mapping.feature import Evidence, Feature, Interval
from mapping.inspection import Inspection, inspect
from mapping.linking import LONGEST_LINK, groups, order
from mapping.runs import RunPoint, split_runs
from mapping.trace import Trace

FloatArray = NDArray[np.float64]

# A line longer than this many half-widths of its crossings cannot be one round bump: sweeps further than one
# half-width from its crest miss it.
LONGEST_BUMP = 2.4
# Crossings lower than this share of the line's height passed beside an end.
FULL_HEIGHT = 0.85
NAMES = {True: ("bump", "ridge"), False: ("pit", "groove")}
# A trace of curvature 1 / (a + r) tells the body's radius a only if that is this share of the sum.
CLEAR_RADIUS = 0.3


def assemble(detections: Detections, trace: Trace, base: Base) -> tuple[Feature, ...]:
    """Features of the base, the strongest evidence first, with preliminary intervals.

    Crossings of one sign are linked where no inspected place between them denies a line. A group as long as its
    crossings are wide is a bump (or pit), a longer one a ridge (or groove) with ends, closed if it returns
    to its beginning, split where branches leave it. Steps are linked likewise; those that a ridge explains,
    because a sweep ran along it, are dropped. In a single profile every crossing is a bump, a pit or a step.

    Reference: paper definitions 2 and 3; theory section 5.
    """
    crossings = detections.crossings
    if not crossings:
        return ()
    single = len({c.sweep for c in crossings}) == 1 and len(np.unique(trace.sweep)) == 1
    scale = _scale(crossings, trace.tip_radius)
    inspection = None if single else inspect(trace, base, detections.noise, 0.25 * scale)
    features: list[Feature] = []
    runs, steps = split_runs(crossings)
    along: list[RunPoint] = []
    for run in runs:
        others = [c for other in runs for c in (other.first, other.last)] + steps
        if inspection is None or run.is_band(others, inspection.pitch, trace.tip_radius):
            steps += [run.first, run.last]
        else:
            along += run.points(max(min(inspection.pitch, run.length), scale), base, trace.tip_radius)
    for convex in (True, False):
        kind = "convex" if convex else "concave"
        some = [c for c in [*crossings, *along] if c.kind == kind]
        if inspection is None:
            features += [_point_feature([c], NAMES[convex][0], detections, trace.tip_radius) for c in some]
        elif some:
            for members in groups(some, inspection, scale):
                features += _lines([some[i] for i in members], convex, inspection, detections, trace.tip_radius)
    features = _without_shadows(features, trace.tip_radius)
    features += _steps(steps, features, inspection, detections, scale, trace.tip_radius)
    return tuple(sorted(features, key=lambda f: -f.evidence.snr))


def _scale(crossings: Sequence[Crossing], tip_radius: float) -> float:
    """Half-width of a sharp crest of the typical height, m."""
    heights = np.array([abs(c.height) for c in crossings])
    return float(np.sqrt(2 * tip_radius * np.median(heights)))


def _lines(
    members: list[Crossing], convex: bool, inspection: Inspection, detections: Detections, tip_radius: float
) -> list[Feature]:
    """One bump, one ridge, or the arms of a junction."""
    top = float(np.quantile([abs(c.height) for c in members], 0.8))
    full = _across_first([c for c in members if abs(c.height) >= FULL_HEIGHT * top - 2 * c.height_sd], inspection)
    merged = _merged(full, 0.5 * float(np.sqrt(2 * tip_radius * top)))
    points = np.array([_mean_point(cluster) for cluster in merged])
    main, branches = order(points)
    path = points[main]
    across = _across(full, path)
    if _polyline_length(path) <= LONGEST_BUMP * across and _falls_off(members, across):
        return [_point_feature(members, NAMES[convex][0], detections, tip_radius)]
    if len(main) < 2:
        return [_point_feature(members, NAMES[convex][0], detections, tip_radius)]
    arms = [main, *(b for b in branches if _polyline_length(points[b]) > 2 * across)]
    features = []
    for arm in arms:
        clusters = [merged[i] for i in arm]
        axis = points[arm]
        if len(arms) == 1 and _closes(axis, top, across, inspection):
            axis, clusters = np.vstack([axis, axis[:1]]), [*clusters, clusters[0]]
        features.append(
            _line_feature(
                axis,
                clusters,
                members if len(arms) == 1 else None,
                convex,
                detections,
                inspection,
                tip_radius,
                ("junction",) if len(arms) > 1 else (),
            )
        )
    return features


def _across_first(full: list[Crossing], inspection: Inspection) -> list[Crossing]:
    """Crossings less the points of runs that have a true crossing near: a run knows its line only within a width."""
    true = [c for c in full if not isinstance(c, RunPoint)]
    if not true:
        return full
    places = np.array([c.point for c in true])
    reach = 1.5 * min(inspection.pitch, 1e300)
    return [c for c in full if not isinstance(c, RunPoint) or np.linalg.norm(places - c.point, axis=1).min() > reach]


def _merged(crossings: list[Crossing], distance: float) -> list[list[Crossing]]:
    """Clusters of crossings nearer to each other than the distance, the strongest first in each."""
    clusters: list[list[Crossing]] = []
    for crossing in sorted(crossings, key=lambda c: -c.snr):
        home = next((k for k in clusters if np.linalg.norm(k[0].point - crossing.point) < distance), None)
        if home is None:
            clusters.append([crossing])
        else:
            home.append(crossing)
    return clusters


def _mean_point(cluster: list[Crossing]) -> FloatArray:
    """Mean of the crossings' points, weighted by their precision."""
    weights = np.array([1 / max(c.position_sd, 1e-12) ** 2 for c in cluster])
    return np.asarray(weights @ np.array([c.point for c in cluster]) / weights.sum())


def _across(crossings: list[Crossing], path: FloatArray) -> float:
    """Half-width of the disturbance across a line, from crossings at any angle."""
    widths = []
    for crossing in crossings:
        heading = _heading(path, crossing.point)
        sine = 1.0 if heading is None else float(np.linalg.norm(np.cross(heading, crossing.tangent)))
        widths.append(crossing.half_width * max(sine, 0.2))
    return float(np.median(widths))


def _heading(path: FloatArray, point: FloatArray) -> FloatArray | None:
    """Unit direction of the polyline near a point, over its neighbours on both sides."""
    if len(path) < 2:
        return None
    nearest = int(np.linalg.norm(path - point, axis=1).argmin())
    step = path[min(nearest + 1, len(path) - 1)] - path[max(nearest - 1, 0)]
    norm = float(np.linalg.norm(step))
    return step / norm if norm > 0 else None


def _falls_off(members: list[Crossing], half_width: float) -> bool:
    """True if the heights fall off from one centre as over a cap rather than stay level along a line.

    Chi-square of H (1 - |p - c|^2 / w^2) against that of a level line, both least squares.
    """
    points = np.array([c.point for c in members])
    heights = np.array([abs(c.height) for c in members])
    span = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    if len(members) < 3 or span < 0.3 * half_width:
        return bool(2 * span <= 1.5 * half_width)
    sd = np.hypot([c.height_sd for c in members], 0.03 * heights.max())
    offset = points - points.mean(axis=0)
    axes = np.linalg.svd(offset, full_matrices=False)[2]
    u = offset @ axes[0] / half_width
    fall = heights.max() * u**2
    cap = np.column_stack([np.ones(len(u)), u]) / sd[:, None]
    misfit_cap = np.linalg.lstsq(cap, (heights + fall) / sd, rcond=None)[0]
    residual_cap = cap @ misfit_cap - (heights + fall) / sd
    level = np.average(heights, weights=1 / sd**2)
    return bool(residual_cap @ residual_cap < (((heights - level) / sd) ** 2).sum())


def _closes(axis: FloatArray, height: float, across: float, inspection: Inspection) -> bool:
    """True if a smooth arc from the last point back to the first, along the headings there, is not denied."""
    gap = float(np.linalg.norm(axis[-1] - axis[0]))
    length = _polyline_length(axis)
    if len(axis) < 4 or gap > LONGEST_LINK * max(min(inspection.pitch, 1e300), across) or gap > 0.5 * length:
        return False
    out, back = axis[-1] - axis[-2], axis[1] - axis[0]
    out, back = out / np.linalg.norm(out), back / np.linalg.norm(back)
    t = np.linspace(0.0, 1.0, 25)[:, None]
    chord = 1.3 * gap
    arc = (
        (2 * t**3 - 3 * t**2 + 1) * axis[-1]
        + (t**3 - 2 * t**2 + t) * chord * out
        + (3 * t**2 - 2 * t**3) * axis[0]
        + (t**3 - t**2) * chord * back
    )
    return not inspection.denies(arc[2:-2], height, 0.25 * across)


def _point_feature(members: list[Crossing], kind: str, detections: Detections, tip_radius: float) -> Feature:
    best = max(members, key=lambda c: abs(c.height))
    return Feature(
        kind=kind,
        axis=best.point[None],
        normals=best.normal[None],
        height=Interval.normal(best.height, best.height_sd),
        width=_width(best.height, best.half_width, tip_radius),
        length=Interval(0.0, 0.0, 0.0),
        evidence=_evidence(members, detections),
        curvature_feature=bool(best.curvature_feature),
        position_sd=best.position_sd,
        extra={"trace_curvature": best.trace_curvature},
    )


def _line_feature(
    axis: FloatArray,
    clusters: list[list[Crossing]],
    everything: list[Crossing] | None,
    convex: bool,
    detections: Detections,
    inspection: Inspection,
    tip_radius: float,
    notes: tuple[str, ...],
) -> Feature:
    members = [c for cluster in clusters for c in cluster]
    counted = members if everything is None else everything
    weights = np.array([1 / max(c.height_sd, 1e-12) ** 2 for c in members])
    heights = np.array([c.height for c in members])
    height = float(np.median(heights))
    sd = float(np.hypot(1 / np.sqrt(weights.sum()), heights.std() / np.sqrt(len(heights))))
    across = _across(members, axis)
    normals = np.array([cluster[0].normal for cluster in clusters])
    length = _polyline_length(axis)
    closed = len(axis) > 2 and np.array_equal(axis[0], axis[-1])
    slack = 0.0 if closed else max(inspection.pitch, across)
    curvature = 2 * height / across**2
    return Feature(
        kind=NAMES[convex][1],
        axis=axis,
        normals=normals,
        height=Interval.normal(height, sd),
        width=_width(height, across, tip_radius),
        length=Interval(length, length, length + 2 * slack),
        evidence=_evidence(counted, detections),
        curvature_feature=bool(abs(curvature) > 1 / (2 * tip_radius)),
        position_sd=float(np.median([c.position_sd for c in members])),
        notes=notes,
    )


def _evidence(members: Sequence[Crossing], detections: Detections) -> Evidence:
    """All crossings together; the points of one run count as the one crossing that they are."""
    runs = {(c.sweep, c.snr): c for c in members if isinstance(c, RunPoint)}
    single = [c for c in members if not isinstance(c, RunPoint)] + list(runs.values())
    return Evidence(float(np.sqrt(sum(c.snr**2 for c in single))), len(single), (detections.algorithm,))


def _width(height: float, half_width: float, tip_radius: float) -> Interval:
    """Width on the body, between nothing and the whole disturbance.

    The trace of a cap of radius a is one of radius a + r. Where the disturbance is so wide that a is a good share of
    that, a follows from it; elsewhere the trace hardly depends on a, and a body as wide as high is the guess.
    """
    tall, wide = abs(height), 2 * half_width
    around = (half_width**2 + tall**2) / (2 * tall) if tall > 0 else 0.0
    radius = around - tip_radius
    guess = min(tall, wide)
    if height > 0 and radius > max(CLEAR_RADIUS * around, 0.5 * tall):
        guess = min(2 * float(np.sqrt(max(2 * radius * tall - tall**2, 0.25 * tall**2))), wide)
    return Interval(guess, 0.0, wide)


def _without_shadows(features: list[Feature], tip_radius: float) -> list[Feature]:
    """Features less what is only the flank of a higher one of either sign."""
    kept: list[Feature] = []
    for feature in sorted(features, key=lambda f: -abs(f.height.median)):
        shadow = False
        for other in kept:
            reach = 1.3 * np.sqrt(2 * tip_radius * abs(other.height.median))
            small = abs(feature.height.median) < 0.5 * abs(other.height.median)
            if small and _distances(feature.axis, other.axis).max() < reach:
                shadow = True
        if not shadow:
            kept.append(feature)
    return kept


def _steps(
    steps: list[Crossing],
    features: list[Feature],
    inspection: Inspection | None,
    detections: Detections,
    scale: float,
    tip_radius: float,
) -> list[Feature]:
    """Steps that no ridge explains; in an area at least two sweeps must agree on one."""
    free = [
        c
        for c in steps
        if all(_distances(c.point[None], f.axis).min() > 2 * np.sqrt(2 * scale**2) + c.half_width for f in features)
    ]
    if inspection is None:
        return [_point_feature([c], "step", detections, tip_radius) for c in free]
    result = []
    for members in groups(free, inspection, scale) if free else []:
        line = [free[i] for i in members]
        if len({c.sweep for c in line}) < 2:
            continue
        points = np.array([c.point for c in line])
        main, _ = order(points)
        height = float(np.median([abs(c.height) for c in line]))
        sd = float(np.median([c.height_sd for c in line]) / np.sqrt(len(line)))
        length = _polyline_length(points[main])
        result.append(
            Feature(
                kind="step",
                axis=points[main],
                normals=np.array([line[i].normal for i in main]),
                height=Interval.normal(height, sd),
                width=Interval(0.0, 0.0, 2 * float(np.median([c.half_width for c in line]))),
                length=Interval(length, length, length + 2 * inspection.pitch),
                evidence=Evidence(float(np.sqrt(sum(c.snr**2 for c in line))), len(line), (detections.algorithm,)),
                curvature_feature=any(c.curvature_feature for c in line),
                position_sd=float(np.median([c.position_sd for c in line])),
            )
        )
    return result


def _distances(points: FloatArray, axis: FloatArray) -> FloatArray:
    """(N,) distances of points from a polyline (K, 3)."""
    if len(axis) == 1:
        return np.asarray(np.linalg.norm(points - axis[0], axis=1))
    best = np.full(len(points), np.inf)
    for start, stop in itertools.pairwise(axis):
        along = stop - start
        square = float(along @ along)
        t = np.clip((points - start) @ along / square, 0.0, 1.0) if square > 0 else np.zeros(len(points))
        best = np.minimum(best, np.linalg.norm(points - start - t[:, None] * along, axis=1))
    return best


def _polyline_length(points: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
