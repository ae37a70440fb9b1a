"""Nodes: the places within the bins of a window at which templates are taken, and where these lie about a feature."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mapping import FloatArray
from mapping.inference.curves import Chart, CurveModes
from mapping.inference.families.bump import Spot
from mapping.inference.likelihood import Shape, Window

# Two Gauss points average a template over its bin: exact for cubics between kinks.
NODES = np.array([-1.0, 1.0]) / np.sqrt(3.0)


class LineShape(Shape, Protocol):
    """A shape along a chart: its first parameters are the lateral modes of its course."""

    @property
    def chart(self) -> Chart: ...

    @property
    def modes(self) -> CurveModes: ...

    @property
    def tip_radius(self) -> float: ...


def line_nodes(
    window: Window, chart: Chart, modes: CurveModes, tip: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """(n, nodes) places along and across the chart, (2, m, n, nodes) modes and slopes, and the base's two bends."""
    nodes = bin_nodes(window)
    shape = nodes.shape[:2]
    s, _, leg = chart.coordinates(nodes.reshape(-1, 3))
    points, laterals, normals, _ = chart.at(s)
    above = ((window.height + tip)[:, None] * window.normals)[:, None]
    offset = (nodes + above).reshape(-1, 3) - points
    across, up = np.einsum("ij,ij->i", offset, laterals), np.einsum("ij,ij->i", offset, normals)
    ahead = np.einsum("ij,ij->i", offset, np.cross(laterals, normals))
    lateral = _arc(across, up, chart.bend[leg])
    s = s + _arc(ahead, up, chart.bend_along[leg])
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
    longer = _arc(flat, z, bend) / flat
    return x * longer, y * longer


def _arc(aside: FloatArray, up: FloatArray, bend: FloatArray) -> FloatArray:
    """(n,) length of a circle of curvature `bend` from its top to the foot of a centre beside and above that, m."""
    turned = np.arctan2(bend * aside, 1.0 + bend * up)
    return np.asarray(np.where(bend == 0.0, aside, turned / np.where(bend == 0.0, 1.0, bend)))


def bin_nodes(window: Window) -> FloatArray:
    """(n, nodes, 3) places within each bin, m."""
    return np.ascontiguousarray(
        window.feet[:, None] + (window.half[:, None] * NODES)[..., None] * window.tangents[:, None]
    )
