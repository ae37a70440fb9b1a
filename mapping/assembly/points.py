"""Points: a bump or pit from the crossings of one compact group, if its outline is that of a round spot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapping import Details, Feature, FloatArray, Interval, Support
from mapping.assembly.linking import Inspection
from mapping.assembly.runs import RunPoint
from mapping.detection import Crossing, Detections
from mapping.geometry.templates import CREST_OUTLIER_SDS, SHAPE_ERROR, crest_trace

# A trace of curvature 1 / (a + r) tells the body's radius a only if that is this share of the sum.
CLEAR_RADIUS = 0.3


def point_feature(
    members: Sequence[Crossing], kind: str, detections: Detections, tip_radius: float, spot: Outline | None = None
) -> Feature:
    """The feature of the members' highest crossing, at the spot that was fitted to all of them."""
    best = max(members, key=lambda c: abs(c.height))
    point, height, half_width = best.point, best.height, best.half_width
    if spot is not None:
        point, height, half_width = spot.center, spot.height, spot.half_width
    return Feature(
        kind=kind,
        axis=point[None],
        normals=best.normal[None],
        height=Interval.normal(height, best.height_sd),
        width=body_width(height, half_width, tip_radius),
        length=Interval(0.0, 0.0, 0.0),
        evidence=evidence(members, detections),
        curvature_feature=bool(best.curvature_feature),
        position_sd=best.position_sd,
        details=Details(trace_curvature=best.trace_curvature),
    )


def evidence(members: Sequence[Crossing], detections: Detections) -> Support:
    """All crossings together; the points of one run count as the one crossing that they are."""
    runs = {(c.sweep, c.snr): c for c in members if isinstance(c, RunPoint)}
    single = [c for c in members if not isinstance(c, RunPoint)] + list(runs.values())
    return Support(float(np.sqrt(sum(c.snr**2 for c in single))), len(single), (detections.algorithm,))


def body_width(height: float, half_width: float, tip_radius: float) -> Interval:
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


# A line explains the heights better than a spot by more than this (twice the log-likelihood) ...
LINE_OVER_SPOT_GAIN = 16.0
# ... and is longer than this share of the half-width of its disturbance.
SHORTEST_LINE_SHARE = 0.5
# Places within so many half-widths of the crossings' middle, beyond their own spread, take part.
OUTLINE_REACH = 1.6


@dataclass(frozen=True, eq=False)
class Outline:
    """A crest over a segment of the tangent plane; a spot if the segment has no length.

    Args:
        center: (3,) middle of the segment, m.
        heading: (3,) unit direction of the segment.
        length: of the segment, m.
        height: signed height of the crest, m.
        half_width: of the disturbance, m.
        misfit: sum of squared residuals in standard deviations, robust.
    """

    center: FloatArray
    heading: FloatArray
    length: float
    height: float
    half_width: float
    misfit: float


def outline(members: list[Crossing], inspection: Inspection, half_width: float) -> Outline:
    """The spot, or the line if the heights of all places around fit it better (theory section 5.2).

    Both are fitted to the mean heights of the inspected places near the crossings, so that the places without a
    height count as well.
    """
    points = np.array([c.point for c in members])
    highest = max(members, key=lambda c: abs(c.height))
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    frame = _tangent_frame(points - middle, highest.normal)
    reach = float(np.linalg.norm(points - middle, axis=1).max()) + OUTLINE_REACH * half_width
    near = inspection.near(middle[None], reach)
    near = near[np.linalg.norm(inspection.points[near] - middle, axis=1) < reach]
    places, height, sd = (inspection.points[near] - middle) @ frame.T, inspection.height[near], inspection.sd[near]
    flat = (points - middle) @ frame.T
    spot = _fit(places, height, sd, flat, highest.height, half_width, elongated=False)
    line = _fit(places, height, sd, flat, highest.height, half_width, elongated=True)
    is_line = spot[-1] - line[-1] > LINE_OVER_SPOT_GAIN and 2 * line[3] > SHORTEST_LINE_SHARE * line[5]
    x, y, angle, half, crest, wide, chi_square = line if is_line else spot
    heading = np.cos(angle) * frame[0] + np.sin(angle) * frame[1]
    length = 2 * half if is_line else 0.0
    return Outline(middle + x * frame[0] + y * frame[1], heading, length, crest, wide, chi_square)


def _tangent_frame(offsets: FloatArray, normal: FloatArray) -> FloatArray:
    """(2, 3) orthonormal tangents, the first along the longest spread of the offsets."""
    flat = offsets - np.outer(offsets @ normal, normal)
    first = np.linalg.svd(flat, full_matrices=False)[2][0] if np.abs(flat).max() > 0 else np.zeros(3)
    first = first - (first @ normal) * normal
    if np.linalg.norm(first) < 0.5:
        first = np.eye(3)[np.abs(normal).argmin()]
        first = first - (first @ normal) * normal
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def _fit(
    places: FloatArray,
    height: FloatArray,
    sd: FloatArray,
    crossings: FloatArray,
    crest: float,
    half_width: float,
    elongated: bool,
) -> tuple[float, ...]:
    """(x, y, angle, half-length, height, half-width, misfit) by robust least squares."""
    from scipy.optimize import least_squares

    level = np.hypot(sd, SHAPE_ERROR * crest)
    spread = 0.5 * float(np.ptp(crossings[:, 0]))
    # lengths in half-widths, heights in crests
    start = np.array([0.0, 0.0, 0.0, spread / half_width if elongated else 0.0, 1.0, 1.0])
    free = np.array([True, True, elongated, elongated, True, True])
    low = np.array([-np.inf, -np.inf, -np.inf, 0.0, 0.5, 0.4])[free]
    high = np.array([np.inf, np.inf, np.inf, np.inf, 2.0, 2.5])[free]

    def residual(values: FloatArray) -> FloatArray:
        x = start.copy()
        x[free] = values
        offset = places / half_width - x[:2]
        along = offset @ [np.cos(x[2]), np.sin(x[2])]
        beyond = np.abs(along) - np.minimum(np.abs(along), abs(x[3]))
        across = offset @ [-np.sin(x[2]), np.cos(x[2])]
        distance = half_width * np.hypot(beyond, across)
        return np.asarray((height - crest_trace(distance, x[4] * crest, x[5] * half_width)) / level)

    begin = np.clip(start[free], low + 1e-3, high - 1e-3)
    found = least_squares(residual, begin, bounds=(low, high), loss="soft_l1", f_scale=CREST_OUTLIER_SDS, x_scale=0.3)
    x = start.copy()
    x[free] = found.x
    scaled = x * [half_width, half_width, 1.0, half_width, crest, half_width]
    return (*(float(value) for value in scaled), 2 * float(found.cost))
