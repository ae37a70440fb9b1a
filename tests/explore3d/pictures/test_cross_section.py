"""A cross-section shows the trace that was recorded beside the one that the feature predicts."""

from dataclasses import replace

import numpy as np
import pytest
from reported_wire import AXIS, BASE, HEIGHT, TIP, crossing, ridge, sweeps

from explore3d.pictures.cross_section import cross_section
from mapping.estimate.envelope import estimate_surface
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


def test_a_sweep_that_shows_both_sides_is_shown_rather_than_a_nearer_one_that_turns_on_the_crest() -> None:
    every = sweeps()
    turned = every.select((every.sweep != 4) | (every.centers[:, 1] < 0.3e-3))
    section = cross_section(ridge(), turned, BASE, [crossing(4, -0.006), crossing(2, -0.018)])
    assert section is not None and section.sweep == 2


def test_a_sweep_that_turns_beside_the_line_shows_one_passage() -> None:
    """To and fro under one number, the way back 3 mm further along the line, where it is only half as high."""
    there = np.arange(-5e-3, 2e-3, 20e-6)
    y, x = np.concatenate([there, there[::-1]]), np.repeat([0.0, 3e-3], len(there))
    felt = cap_height(y, HEIGHT, 0.5 * HEIGHT, TIP) * np.where(x > 0.0, 0.5, 1.0)
    trace = Trace(np.arange(len(y)), np.column_stack([x, y, TIP + felt]), np.zeros(len(y), dtype=np.int64), TIP)
    section = cross_section(ridge(), trace, BASE, [crossing(0, 0.0)])
    assert section is not None
    np.testing.assert_allclose(section.height, cap_height(section.x, HEIGHT, 0.5 * HEIGHT, TIP), atol=1e-9)
    assert (np.diff(section.x) > 0.0).all() and np.ptp(section.x) > 4.5e-3


def test_a_feature_that_no_sweep_came_near_has_no_section() -> None:
    size = Interval.normal(1e-4, 1e-6)
    far = Feature("bump", np.array([[0.0, 0.5, 0.0]]), UP[None], size, size, size, Support(9.0, 1), True, 1e-5)
    assert cross_section(far, sweeps(), BASE, []) is None


def test_the_body_lies_nowhere_above_the_trace_of_the_sweep_that_felt_it() -> None:
    """A ball over a place has that place under it: what stands higher in a section was felt beside it."""
    high, noise, rng = 0.08 * TIP, 2e-4 * TIP, np.random.default_rng(4)
    x = np.arange(-2.0 * TIP, 2.0 * TIP, 0.05 * TIP)
    rows = 0.3 * TIP * np.arange(-4, 5)
    feet = np.concatenate([np.column_stack([x, np.full_like(x, y), 0 * x]) for y in rows])
    slant = np.array([0.2, 1.0, 0.0]) / np.hypot(0.2, 1.0)
    away = feet @ np.array([slant[1], -slant[0], 0.0])
    height = cap_height(away, high, 1e-9, TIP) + noise * rng.standard_normal(len(x) * len(rows))
    trace = Trace(
        np.arange(float(len(feet))), feet + (TIP + height)[:, None] * UP, np.repeat(np.arange(9), len(x)), TIP
    )
    size = Interval.normal(high, 1e-6)
    axis = np.outer([-1.2 * TIP, 1.2 * TIP], slant)
    line = Feature("ridge", axis, np.tile(UP, (2, 1)), size, Interval(0, 0, 0), size, Support(99.0, 9), True, 1e-5)
    section = cross_section(line, trace, BASE, [], estimate_surface(trace, base=BASE))
    assert section is not None and len(section.body_x) > 10
    above = section.body_z - np.interp(section.body_x, section.x, section.height)
    assert above.max() < 4.0 * noise


def test_over_a_bump_places_are_measured_along_the_sweep_though_noise_exceeds_its_step() -> None:
    """Samples 50 um apart whose places beside the sweep scatter by 300 um: the nearest ones lie in any direction."""
    rng = np.random.default_rng(8)
    x, high = np.arange(-0.8 * TIP, 0.8 * TIP, 5e-3 * TIP), 0.05 * TIP
    beside = 3e-2 * TIP * rng.standard_normal(len(x))
    z = TIP + cap_height(x, high, 1e-9, TIP)
    trace = Trace(np.arange(float(len(x))), np.column_stack([x, beside, z]), np.zeros(len(x), dtype=int), TIP)
    size = Interval.normal(high, 1e-6)
    bump = Feature("bump", np.zeros((1, 3)), UP[None], size, Interval(0, 0, 0), size, Support(9.0, 1), True, 1e-5)
    section = cross_section(bump, trace, BASE, [])
    assert section is not None and len(section.x) > 250
    np.testing.assert_allclose(section.height, cap_height(section.x, high, 1e-9, TIP), atol=1e-3 * TIP)


def test_the_prediction_lies_on_the_level_of_the_samples_about_it() -> None:
    lifted = Trace(sweeps().t, sweeps().centers + 2e-5 * UP, sweeps().sweep, TIP)
    section = cross_section(ridge(), lifted, BASE, [crossing(4, -0.006)])
    assert section is not None
    exact = 2e-5 + cap_height(section.grid, HEIGHT, 0.5 * HEIGHT, TIP)
    np.testing.assert_allclose(section.predicted, exact, atol=1e-7)


def test_the_level_is_asked_where_no_other_feature_is() -> None:
    """A wire between two that touch it on both sides: the bare base is less than half of what is shown."""
    apart = 1.6 * float(np.sqrt(2.0 * TIP * HEIGHT))
    y = np.arange(-0.02, 0.02, 2e-5)
    wires = [replace(ridge(), axis=ridge().axis + apart * k * np.array([0.0, 1.0, 0.0])) for k in (-2, -1, 0, 1, 2)]
    felt = np.max([cap_height(y - apart * k, HEIGHT, 0.5 * HEIGHT, TIP) for k in (-2, -1, 0, 1, 2)], axis=0)
    trace = Trace(np.arange(float(len(y))), np.column_stack([0 * y, y, TIP + felt]), np.zeros(len(y), dtype=int), TIP)
    section = cross_section(wires[2], trace, BASE, [], None, wires)
    assert section is not None
    exact = cap_height(section.grid, HEIGHT, 0.5 * HEIGHT, TIP)
    np.testing.assert_allclose(section.predicted, exact, atol=1e-6)
    unaware = cross_section(wires[2], trace, BASE, [])
    assert unaware is not None and np.abs(unaware.predicted - exact).max() > 0.1 * HEIGHT


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
