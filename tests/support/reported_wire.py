"""A wire on a plate, swept without noise, as the report and the pictures take it."""

import numpy as np

from mapping.base.base import Base
from mapping.detection.crossing import Crossing
from mapping.feature import Feature, Interval, Support
from mapping.geometry.templates.shapes import chain_height
from mapping.surface import Surface
from mapping.trace import Trace

TIP, HEIGHT = 0.01, 6.5e-4


AXIS = np.array([[-0.02, 0.0, 0.0], [0.02, 0.0, 0.0]])


UP = np.array([0.0, 0.0, 1.0])


BASE = Base(Surface([[-0.05, -0.03, 0], [0.05, -0.03, 0], [0.05, 0.03, 0], [-0.05, 0.03, 0]], [[0, 1, 2], [0, 2, 3]]))


def sweeps() -> Trace:
    """Eleven sweeps across a wire, without noise."""
    y = np.arange(-0.025, 0.025, 1e-4)
    feet = np.concatenate([np.column_stack([np.full_like(y, x), y, 0 * y]) for x in np.linspace(-0.03, 0.03, 11)])
    normals = np.tile(UP, (len(feet), 1))
    height = chain_height(feet, normals, AXIS + 0.5 * HEIGHT * UP, 0.5 * HEIGHT, TIP)
    centers = feet + (TIP + height)[:, None] * UP
    return Trace(np.arange(float(len(feet))), centers, np.repeat(np.arange(11), len(y)), TIP)


def crossing(sweep: int, x: float) -> Crossing:
    return Crossing(
        sweep,
        0.0,
        np.array([x, 0.0, 0.0]),
        UP,
        np.array([0.0, 1.0, 0.0]),
        "convex",
        HEIGHT,
        1e-6,
        1e-6,
        3.6e-3,
        97.0,
        99.0,
        True,
        214,
        286,
    )


def ridge() -> Feature:
    return Feature(
        "ridge",
        AXIS,
        np.tile(UP, (2, 1)),
        Interval.normal(HEIGHT, 1e-5),
        Interval.normal(HEIGHT, 3e-5),
        Interval.normal(0.04, 1e-4),
        Support(99.0, 7, (3,)),
        True,
        1e-5,
    )
