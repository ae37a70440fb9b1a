"""StepShape: an upright step along a curve on the base."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mapping import FloatArray
from mapping.inference.curves import Chart, CurveModes
from mapping.inference.families.nodes import line_nodes
from mapping.inference.likelihood import Prior, Window

if TYPE_CHECKING:
    from mapping.inference.families.groove import GrooveShape, OffsetRims


@dataclass(frozen=True, eq=False)
class StepShape:
    """Steps of any height: lateral modes of the edge, and the height.

    `high_side` is +1 if the chart's lateral side is the high one, else -1. Whether the base lies low or high does
    not matter: the height of the base under each run is marginalised. `grooves` stay as they are, each with its
    parameters (1, P): what they leave alone is not in the heights, but what running along the edge changes is.
    """

    window: Window
    chart: Chart
    modes: CurveModes
    tip_radius: float
    high_side: float
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray
    grooves: tuple[tuple[GrooveShape, FloatArray], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.modes.names, "height")

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.modes.units, "m")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the low side's trace, m."""
        from mapping.geometry.templates import step_heights

        courses, heights = np.ascontiguousarray(theta[:, : self.modes.count]), np.ascontiguousarray(theta[:, -1])
        out = np.empty((len(theta), len(self.window)))
        step_heights(*self._places, courses, heights, self.high_side, self.tip_radius, out)
        for rims, (_, known) in zip(self._offset_rims, self.grooves, strict=True):
            out += rims.heights(np.hstack([np.tile(known, (len(theta), 1)), theta]))
        return out

    @cached_property
    def _offset_rims(self) -> list[OffsetRims]:
        from mapping.inference.families.groove import OffsetRims

        alone = replace(self, grooves=())
        return [OffsetRims(groove, alone) for groove, _ in self.grooves]

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, nodes) lateral distances from the chart, (2, m, n, nodes) modes and slopes, and bends of the base."""
        _, lateral, basis, bend, _ = line_nodes(self.window, self.chart, self.modes, self.tip_radius)
        return lateral, basis, bend
