"""Error against finger time: what the features would have been, had the finger stopped earlier."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from explore3d.analysis.truth import AXIS_SAMPLES, Comparison, TrueFeature, compare
from mapping import Trace
from mapping.assembly import Inspections, assemble, inspected_for, place_spacing
from mapping.base import LaidTrace
from mapping.detection import Detections
from mapping.geometry.mesh import nearest_on, resample
from mapping.model import ObjectModel

# The last one is the finished model's
MOMENTS = 8


def time_curve(
    detections: Detections,
    trace: Trace,
    model: ObjectModel,
    truth: Sequence[TrueFeature],
    share: Callable[[float], None] = lambda _: None,
    inspections: Inspections | None = None,
) -> tuple[tuple[float, float], ...]:
    """The worst error of place and extent over the true features, at moments of the exploration.

    At each moment only what had been felt by then is used, and the features are those of the grammar, before any
    posterior; the last point is the finished model. Nothing is laid on the base again, and no height looked at again:
    they are those of the whole trace's places, of the sweeps done by then. Lines that no single sweep shows are sought
    only if the finished model has one.

    Args:
        detections: of the whole trace; each crossing knows its time.
        trace: the whole trace, in the order of time; as a LaidTrace it is not laid on the base again.
        model: the finished model.
        truth: the true features; moments at which one of them is not found yet are left out.
        share: told the share done.
        inspections: the heights of the whole trace that the finished model was made of.

    Returns:
        (seconds of finger time, worst distance between a true axis and the found one in m), in the order of time.
    """
    if not detections.crossings:  # there is no moment at which anything was known, but the last
        worst = _worst(model, truth, trace.tip_radius)
        return () if worst is None else ((float(trace.t[-1] - trace.t[0]), worst),)
    laid = LaidTrace.of(trace, model.base)
    spacing = place_spacing(detections.crossings, trace.tip_radius)
    faint = any(feature.faint for feature in model.features)
    inspections = inspections or inspected_for(detections, laid, model.base, faint=faint)
    begun = {sweep.number: float(sweep.trace.t[0]) for sweep in reversed(laid.laid_sweeps)}
    times = np.array([crossing.t for crossing in detections.crossings])
    moments = np.unique(np.quantile(times, np.linspace(0.0, 1.0, MOMENTS)[:-1], method="nearest"))
    curve = []
    for done, moment in enumerate(moments):
        # a sweep is finished before anyone can know what it found
        numbers = {number for number, t in begun.items() if t <= moment}
        felt = laid.of_sweeps(numbers)
        sweeps = {crossing.sweep for crossing in detections.crossings if crossing.t <= moment}
        seen = replace(detections, crossings=tuple(c for c in detections.crossings if c.sweep in sweeps))
        known = inspections.of_sweeps(numbers)
        features = assemble(seen, felt, model.base, spacing=spacing, faint=faint, inspections=known, proposals=())
        curve.append((float(felt.t[-1]), _worst(replace(model, features=features), truth, trace.tip_radius)))
        share((done + 1) / len(moments))
    curve.append((float(trace.t[-1]), _worst(model, truth, trace.tip_radius)))
    return tuple((float(t - trace.t[0]), worst) for t, worst in curve if worst is not None)


def _worst(model: ObjectModel, truth: Sequence[TrueFeature], tip_radius: float) -> float | None:
    """The largest distance of an axis, its ends included, over all true features; None if one is missed."""
    rows = compare(model, truth, tip_radius)
    if any(row.status == "missed" for row in rows):
        return None
    return max(_distance(row) for row in rows if row.status == "found")


def _distance(row: Comparison) -> float:
    """Hausdorff distance between the true axis and the found one, m."""
    assert row.true is not None and row.found is not None
    axes = row.true.axis, row.found.axis
    return max(
        float(np.linalg.norm(points - nearest_on(points, other)[0], axis=1).max())
        for points, other in ((resample(axes[0], AXIS_SAMPLES), axes[1]), (resample(axes[1], AXIS_SAMPLES), axes[0]))
    )
