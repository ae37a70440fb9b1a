"""Crossing: one place where one sweep passed over something the base does not explain."""

from __future__ import annotations

from dataclasses import dataclass

from mapping import FloatArray

STEP_CROSSINGS = ("step up", "step down")


@dataclass(frozen=True, eq=False)
class Crossing:
    """A detection on a single sweep.

    Args:
        sweep: number of the sweep.
        t: time of the crest, s.
        point: (3,) point of the base under the crest, m.
        normal: (3,) outward unit normal of the base there.
        tangent: (3,) unit direction of the sweep there, tangent to the base.
        kind: "convex" (bump, ridge), "concave" (pit, groove), "step up" or "step down" along the sweep.
        height: signed height of the crest of the trace over the base's trace, m.
        height_sd: its standard deviation, m.
        position_sd: standard deviation of the crest along the sweep, m.
        half_width: half of the extent of the disturbance on the trace, m.
        trace_curvature: curvature of the trace at the crest, 1/m.
        snr: matched-filter signal-to-noise ratio.
        curvature_feature: True if finer than the tip (paper, definition 1).
        start, stop: range of sample indices within the sweep that the disturbance covers.
    """

    sweep: int
    t: float
    point: FloatArray
    normal: FloatArray
    tangent: FloatArray
    kind: str
    height: float
    height_sd: float
    position_sd: float
    half_width: float
    trace_curvature: float
    snr: float
    curvature_feature: bool
    start: int
    stop: int

    @property
    def is_step(self) -> bool:
        """True where the sweep went from one level to another, up or down."""
        return self.kind in STEP_CROSSINGS
