"""Step: an upright edge between two levels."""

from __future__ import annotations

from typing import Any

import numpy as np

from mapping import Feature, FloatArray, Interval
from mapping.geometry.proxy import Part, Terrace
from mapping.geometry.templates import contact_half_width, step_height
from mapping.inference.families import Sizes, StepShape
from mapping.inference.kinds.kind import Section, place_sd, preliminary, uphill
from mapping.inference.kinds.lines import LineKind, Parameters, Traced
from mapping.inference.kinds.posterior_density import height_prior
from mapping.inference.likelihood import Shape


class Step(LineKind):
    """Steps, up to walls: course and height; the higher side is the one that fits better."""

    def sizes(self, feature: Feature, tip_radius: float) -> Sizes:
        """A step has no width: its disturbance is that of a sharp edge of its height."""
        height, sd, _ = preliminary(feature, tip_radius)
        half = float(contact_half_width(min(height, tip_radius), 0.0, tip_radius))
        return Sizes(height, sd, 0.0, half, place_sd(feature, half))

    def trace(self, feature: Feature, feet: FloatArray, normals: FloatArray, tip_radius: float) -> FloatArray:
        """(N,) heights over the low side, m; 0 where it is not known which that is; see `Kind.trace`."""
        away = uphill(feature, feet)
        return step_height(away, abs(feature.height.median), tip_radius) if away.any() else away

    def shape(self, traced: Traced) -> StepShape:
        height = traced.sizes.height
        whole = traced.laterals + Parameters((height_prior(traced.sizes),), (height,), (0.02 * height,))
        sides = [
            StepShape(traced.window, traced.chart, traced.modes, traced.tip_radius, side, *whole.arrays)
            for side in (-1.0, 1.0)
        ]
        return max(sides, key=_rough_fit)

    def section(self, feature: Feature, shape: Shape, draws: FloatArray) -> Section:
        sign = 1.0 if feature.height.median >= 0.0 else -1.0
        side = {"high_side": shape.high_side}  # type: ignore[attr-defined]
        return Section(Interval.from_draws(sign * draws[:, -1]), Interval(0.0, 0.0, 0.0), side)

    def part(self, feature: Feature, exaggeration: float = 1.0) -> Part | None:
        """The terrace; None of an edge whose higher side was not recorded, or that is a point or closed."""
        side, height = feature.details.high_side, exaggeration * abs(feature.height.median)
        if side is None or not height > 0.0 or len(feature.axis) < 2 or feature.closed:
            return None
        return Terrace(feature.axis, feature.normals, height, side)

    def heights(self, shape: Any, truth: FloatArray, feet: FloatArray, normals: FloatArray) -> FloatArray:
        s, lateral, _ = shape.chart.coordinates(feet)
        x = lateral - shape.modes.lateral(truth[None, : shape.modes.count], s)[0]
        return step_height(shape.high_side * x, truth[-1], shape.tip_radius)

    def profile(
        self, feature: Feature, x: FloatArray, feet: FloatArray, normals: FloatArray, tip_radius: float
    ) -> FloatArray:
        """(N,) heights of a sweep that climbs it squarely, m; see `Kind.profile`."""
        return step_height(x, abs(feature.height.median), tip_radius)

    def outline(self, height: float, width: float) -> tuple[FloatArray, bool]:
        """A wall."""
        return np.array([[0.0, 0.0], [0.0, height]]), False


def _rough_fit(shape: StepShape) -> float:
    """Correlation of a step's template with the data, each run's mean taken out."""
    template, height = shape.templates(shape.start[None])[0], shape.window.height
    total = 0.0
    for start, stop in zip(shape.window.starts[:-1], shape.window.starts[1:], strict=True):
        total += float((template[start:stop] - template[start:stop].mean()) @ height[start:stop])
    return total


STEP = Step(
    name="step",
    plural="steps",
    sign=0,
    line=True,
    sided=True,
    made_of="step",
    words={"height": "high", "length": "long"},
    colour=(0.48, 0.31, 0.64, 1.0),
    typical=(0.3e-3, 0.0),
)
