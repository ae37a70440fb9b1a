"""How far a base that was found by feeling reaches: where the ball met nothing there is no body."""

from __future__ import annotations

import numpy as np

from mapping.base.base import Base
from mapping.base.extent import over_base, touched_part
from mapping.surface import Surface
from mapping.trace import Trace

TIP = 0.01


def left(empty: list[float]) -> float:
    """Area of a plate of 100 x 100 mm, felt along nine lines, beside a place (6,) where nothing was felt, m^2."""
    edge = np.linspace(-0.05, 0.05, 41)
    corner = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    faces = np.concatenate(
        [np.column_stack([corner, corner + 41, corner + 1]), np.column_stack([corner + 41, corner + 42, corner + 1])]
    )
    x, y = (grid.ravel() for grid in np.meshgrid(edge, edge, indexing="ij"))
    plate = Base(Surface(np.column_stack([x, y, 0.0 * x]), faces), "plane")
    across, along = (grid.ravel() for grid in np.meshgrid(np.linspace(-0.05, 0.05, 9), edge, indexing="ij"))
    centers = np.column_stack([along, across, 0.0 * along + TIP])
    trace = Trace(np.arange(len(centers)) * 1e-3, centers, np.repeat(np.arange(9), 41), TIP)
    box = np.array([[-0.06, -0.06, -0.01], [0.06, 0.06, 0.01]])
    part = touched_part(plate, trace, np.array([empty]), box, np.array([[0.0, 0.0, 1.0]]))
    return float(part.surface.face_areas.sum())


def test_a_pressed_sweep_that_met_nothing_leaves_a_hole() -> None:
    assert left([0.003, 0.006, 0.98 * TIP, 0.0, 0.0, 1.0]) < 0.01 - 0.5 * np.pi * (0.5 * TIP) ** 2


def test_a_place_clear_of_the_body_or_beside_a_steep_flank_leaves_none() -> None:
    assert abs(left([0.003, 0.006, 1.5 * TIP, 0.0, 0.0, 1.0]) - 0.01) < 1e-9
    assert abs(left([0.003, 0.006, 0.5 * TIP, 1.0, 0.0, 0.0]) - 0.01) < 1e-9


def test_a_long_trace_leaves_the_base_where_its_single_samples_do() -> None:
    side = 0.02
    plate = Base(
        Surface([[-side, -side, 0], [side, -side, 0], [side, side, 0], [-side, side, 0]], [[0, 1, 2], [0, 2, 3]])
    )
    along = np.tile(np.linspace(-0.026, 0.026, 8000), 5)
    across = np.repeat(np.linspace(-0.015, 0.015, 5), 8000)
    beyond = np.maximum(np.abs(along) - side, 0.0)  # it rolls off both edges
    centers = np.column_stack([along, across, np.sqrt(TIP**2 - beyond**2)])
    trace = Trace(1e-3 * np.arange(len(along)), centers, np.repeat(np.arange(5), 8000), TIP)
    few = [over_base(part, plate) for _, part in trace.select(np.arange(len(trace)) % 16 == 0).sweeps()]
    over = over_base(trace, plate)
    assert np.array_equal(over[::16], np.concatenate(few))
    assert np.array_equal(over, beyond < TIP * np.sin(np.radians(5.0)))
