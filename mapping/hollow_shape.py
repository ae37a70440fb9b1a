"""HollowShape: grooves and pits, in which the ball rests on the nearer rim or on the bottom."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mapping.bump_shape import Spot
from mapping.chart import Chart
from mapping.curve_modes import CurveModes
from mapping.priors import Prior
from mapping.shapes import rim_height
from mapping.window import Window

FloatArray = NDArray[np.float64]

# Two Gauss points average a template over its bin: exact for cubics between kinks.
NODES = np.array([-1.0, 1.0]) / np.sqrt(3.0)


@dataclass(frozen=True, eq=False)
class PitShape:
    """Round pits with an upright wall and a flat bottom: position, log width of the mouth, log depth.

    `free` is 1 for a lone profile: the pit is then taken to lie under it.
    """

    window: Window
    spot: Spot
    tip_radius: float
    free: int
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        return (*("along", "across")[: self.free], "log width", "log depth")

    @property
    def units(self) -> tuple[str, ...]:
        return (*("m", "m")[: self.free], "ln m", "ln m")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights (negative) over the base's trace, m."""
        width, depth = np.exp(theta[:, self.free, None]), np.exp(theta[:, self.free + 1, None])
        x, y = self._places
        dx = x[None] - theta[:, 0, None, None]
        dy = y[None] - (theta[:, 1, None, None] if self.free > 1 else 0.0)
        rim = 0.5 * width[..., None] - np.hypot(dx, dy)
        bend = float(self.spot.bends.mean())
        return np.asarray(rim_height(rim, self.tip_radius, depth[..., None], bend).mean(axis=2))

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray]:
        """(n, nodes) tangent coordinates of the nodes of each bin, m."""
        nodes = bin_nodes(self.window) - self.spot.point
        return nodes @ self.spot.axes[0], nodes @ self.spot.axes[1]


@dataclass(frozen=True, eq=False)
class GrooveShape:
    """Grooves with upright walls and a flat bottom: lateral modes, ends, log width, log depth."""

    window: Window
    chart: Chart
    modes: CurveModes
    tip_radius: float
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("start", "end")
        return (*self.modes.names, *ends, "log width", "log depth")

    @property
    def units(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("m", "m")
        return (*self.modes.units, *ends, "ln m", "ln m")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights (negative) over the base's trace, m."""
        s, lateral, bend = self._places
        middle = self.modes.lateral(theta[:, : self.modes.count], s.ravel()).reshape(len(theta), *s.shape)
        rim = 0.5 * np.exp(theta[:, -2, None, None]) - np.abs(lateral[None] - middle)
        if not self.chart.closed:
            rim = np.minimum(rim, np.minimum(s[None] - theta[:, -4, None, None], theta[:, -3, None, None] - s[None]))
        depth = np.exp(theta[:, -1, None, None])
        return np.asarray(rim_height(rim, self.tip_radius, depth, bend[None]).mean(axis=2))

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, nodes) distances along the chart, lateral distances, and bends of the base there."""
        nodes = bin_nodes(self.window)
        s, lateral, leg = self.chart.coordinates(nodes.reshape(-1, 3))
        shape = nodes.shape[:2]
        return s.reshape(shape), lateral.reshape(shape), self.chart.bend[leg].reshape(shape)


def bin_nodes(window: Window) -> FloatArray:
    """(n, nodes, 3) places within each bin, m."""
    return np.asarray(window.feet[:, None] + (window.half[:, None] * NODES)[..., None] * window.tangents[:, None])
