"""HollowShape: grooves and pits, in which the ball rests on the nearer rim or on the bottom."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapping import FloatArray
from mapping.inference.curves import Chart, CurveModes
from mapping.inference.families.bump import Spot
from mapping.inference.families.ridge import rounding_of
from mapping.inference.likelihood import Prior, Window

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
        from mapping.geometry.templates import pit_heights

        place = np.zeros((len(theta), 2))
        place[:, : self.free] = theta[:, : self.free]
        out = np.empty((len(theta), len(self.window)))
        width, depth = np.exp(theta[:, -2]), np.exp(theta[:, -1])
        pit_heights(*self._places, self.spot.bends, place, width, depth, self.tip_radius, out)
        return out

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray]:
        return point_nodes(self.window, self.spot, self.tip_radius)


@dataclass(frozen=True, eq=False)
class GrooveShape:
    """Grooves with upright walls and a flat bottom: lateral modes, rounding and places of ends, log width, log depth.

    In plan an end is square (rounding 0), or a half circle as a cutter leaves it (1). It is where the mouth ends.
    """

    window: Window
    chart: Chart
    modes: CurveModes
    tip_radius: float
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("end rounding", "start", "end")
        return (*self.modes.names, *ends, "log width", "log depth")

    @property
    def units(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("", "m", "m")
        return (*self.modes.units, *ends, "ln m", "ln m")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights (negative) over the base's trace, m."""
        from mapping.geometry.templates import groove_heights

        courses = np.ascontiguousarray(theta[:, : self.modes.count])
        width, depth = np.exp(theta[:, -2]), np.exp(theta[:, -1])
        ends, rounded = np.tile([-1e300, 1e300], (len(theta), 1)), np.zeros(len(theta))
        if not self.chart.closed:
            ends, rounded = np.ascontiguousarray(theta[:, -4:-2]), 0.5 * width * rounding_of(theta[:, -5])
        out = np.empty((len(theta), len(self.window)))
        groove_heights(*self._places, courses, ends, rounded, width, depth, self.tip_radius, out)
        return out

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        return line_nodes(self.window, self.chart, self.modes)


def line_nodes(
    window: Window, chart: Chart, modes: CurveModes
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """(n, nodes) places along and across the chart, (2, m, n, nodes) modes and slopes, and the base's two bends."""
    nodes = bin_nodes(window)
    s, lateral, leg = chart.coordinates(nodes.reshape(-1, 3))
    shape = nodes.shape[:2]
    basis = np.stack([modes.basis(s), modes.slopes(s)]).reshape(2, -1, *shape)
    bend, bend_along = (each[leg].reshape(shape) for each in (chart.bend, chart.bend_along))
    return s.reshape(shape), lateral.reshape(shape), basis, bend, bend_along


def point_nodes(window: Window, spot: Spot, tip: float) -> tuple[FloatArray, FloatArray]:
    """(n, nodes) coordinates about a spot of the nodes of each bin, m: their distance from it is along the base.

    Towards each node the base is taken for a circle of its curvature there, whose foot under the ball's centre counts:
    the centre is where it was felt, while the foot on a facet of a coarse mesh is r sin(tilt) beside it.
    """
    centers = bin_nodes(window) + ((tip + window.height)[:, None] * window.normals)[:, None] - spot.point
    x, y, z = centers @ spot.axes[0], centers @ spot.axes[1], centers @ spot.normal
    flat = np.sqrt(np.maximum(x**2 + y**2, np.finfo(float).tiny))
    bend = (x**2 * spot.bends[0] + y**2 * spot.bends[1]) / flat**2
    turned = np.arctan2(bend * flat, 1.0 + bend * z)
    longer = np.where(bend == 0.0, 1.0, turned / np.where(bend == 0.0, 1.0, bend * flat))
    return x * longer, y * longer


def bin_nodes(window: Window) -> FloatArray:
    """(n, nodes, 3) places within each bin, m."""
    return np.ascontiguousarray(
        window.feet[:, None] + (window.half[:, None] * NODES)[..., None] * window.tangents[:, None]
    )
