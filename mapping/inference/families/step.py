"""StepShape: an upright step along a curve on the base."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapping import FloatArray
from mapping.inference.curves import Chart, CurveModes
from mapping.inference.families.hollow import bin_nodes
from mapping.inference.likelihood import Prior, Window


@dataclass(frozen=True, eq=False)
class StepShape:
    """Steps of height h < r: lateral modes of the edge, and the height.

    `high_side` is +1 if the chart's lateral side is the high one, else -1. Whether the base lies low or high does
    not matter: the height of the base under each run is marginalised.
    """

    window: Window
    chart: Chart
    modes: CurveModes
    tip_radius: float
    high_side: float
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray

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
        return out

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray]:
        """(n, nodes) lateral distances from the chart, and the (m, n, nodes) modes there."""
        nodes = bin_nodes(self.window)
        s, lateral, _ = self.chart.coordinates(nodes.reshape(-1, 3))
        return lateral.reshape(nodes.shape[:2]), self.modes.basis(s).reshape(-1, *nodes.shape[:2])
