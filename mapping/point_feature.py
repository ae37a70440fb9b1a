"""Point feature: a bump or pit from the crossings of one group, or any crossing of a single profile."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapping.crossing import Crossing
from mapping.detectors import Detections
from mapping.feature import Evidence, Feature, Interval
from mapping.outline import Outline
from mapping.runs import RunPoint

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
        extra={"trace_curvature": best.trace_curvature},
    )


def evidence(members: Sequence[Crossing], detections: Detections) -> Evidence:
    """All crossings together; the points of one run count as the one crossing that they are."""
    runs = {(c.sweep, c.snr): c for c in members if isinstance(c, RunPoint)}
    single = [c for c in members if not isinstance(c, RunPoint)] + list(runs.values())
    return Evidence(float(np.sqrt(sum(c.snr**2 for c in single))), len(single), (detections.algorithm,))


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
