"""A cross-section shows the trace that was recorded beside the one that the feature predicts."""

import numpy as np
import pytest
from reported_wire import AXIS, BASE, HEIGHT, TIP, crossing, ridge, sweeps

from explore3d.pictures.cross_section import cross_section
from mapping.feature import Feature, Interval, Support
from mapping.geometry.templates.shapes import cap_height, step_height
from mapping.trace import Trace

UP = np.array([0.0, 0.0, 1.0])


def test_across_a_wire_trace_and_prediction_are_the_closed_form() -> None:
    section = cross_section(ridge(), sweeps(), BASE, [crossing(4, -0.006)])
    assert section is not None and section.sweep == 4 and section.across
    exact = cap_height(section.x, HEIGHT, 0.5 * HEIGHT, TIP)
    np.testing.assert_allclose(section.height, exact, atol=1e-12)
    np.testing.assert_allclose(section.predicted, cap_height(section.grid, HEIGHT, 0.5 * HEIGHT, TIP), atol=1e-9)
    assert section.grid[0] < -3.6e-3 and section.grid[-1] > 3.6e-3
    assert (section.low <= section.predicted + 1e-12).all() and (section.predicted <= section.high + 1e-12).all()


def test_without_a_crossing_the_nearest_sweep_is_taken() -> None:
    section = cross_section(ridge(), sweeps(), BASE, [])
    assert section is not None and section.sweep == 5


def test_a_feature_that_no_sweep_came_near_has_no_section() -> None:
    size = Interval.normal(1e-4, 1e-6)
    far = Feature("bump", np.array([[0.0, 0.5, 0.0]]), UP[None], size, size, size, Support(9.0, 1), True, 1e-5)
    assert cross_section(far, sweeps(), BASE, []) is None


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_step_is_turned_and_shifted_to_the_side_that_is_high(side: float) -> None:
    y = np.arange(-0.02, 0.02, 1e-4)
    z = TIP - 2e-4 + step_height(side * y, 5e-4, TIP)
    trace = Trace(np.arange(float(len(y))), np.column_stack([0 * y, y, z]), np.zeros(len(y), dtype=int), TIP)
    size = Interval.normal(5e-4, 1e-6)
    step = Feature("step", AXIS, np.tile(UP, (2, 1)), size, Interval(0, 0, 0), size, Support(9.0, 1), True, 1e-5)
    section = cross_section(step, trace, BASE, [])
    assert section is not None
    # Linear interpolation between samples cuts the kink by at most its slope times a quarter of their spacing.
    recorded = np.interp(section.grid, section.x, section.height)
    np.testing.assert_allclose(section.predicted, recorded, atol=0.25e-4 * np.sqrt(2 * TIP * 5e-4) / TIP)
