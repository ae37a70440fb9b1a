"""A finger that yields: its compliance is told by how the recorded forces vary, and heights are put back."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import Surface, Trace
from mapping.base import Base, LaidTrace
from mapping.estimate.deviation import Yielding, yielding
from mapping.geometry.templates.shapes import cap_height

TIP, HEIGHT, COMPLIANCE, NOISE = 4e-3, 0.1e-3, 200e-6, 15e-6
ALONG, ROWS = np.arange(-0.05, 0.05, 40e-6), 8


def plate() -> Base:
    corners = 0.08 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    return Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]])))


def felt(varies: float, compliance: float = COMPLIANCE, outward: float = 1.0) -> tuple[Trace, np.ndarray]:
    """Sweeps over a wire on a plate with a fifth less force on top of it, and the heights of the tip."""
    rng, x = np.random.default_rng(3), np.tile(ALONG, ROWS)
    y = np.repeat(2e-3 * np.arange(float(ROWS)), len(ALONG))
    true = TIP + cap_height(np.abs(x), HEIGHT, 0.5 * HEIGHT, TIP)
    turns = np.repeat(rng.uniform(0.0, 2.0 * np.pi, ROWS), len(ALONG))
    pressed = 1.0 + varies * np.sin(x / 4e-3 + turns) - 0.2 * (true - TIP) / HEIGHT
    recorded = true - compliance * pressed + NOISE * rng.standard_normal(len(x))
    centers, force = np.column_stack([x, y, recorded]), outward * pressed[:, None] * [0.0, 0.0, 1.0]
    force = force + 0.01 * rng.standard_normal(force.shape)
    sweep = np.repeat(np.arange(ROWS), len(ALONG))
    return Trace(1e-3 * np.arange(float(len(x))), centers, sweep, TIP, force=force), true


@pytest.mark.parametrize("outward", [1.0, -1.0])
def test_what_a_finger_yields_by_is_told_and_put_back(outward: float):
    trace, true = felt(0.05, outward=outward)
    found = yielding(LaidTrace.of(trace, plate()))
    assert found is not None and found.outward == outward
    assert abs(found.compliance - COMPLIANCE) < 3.0 * found.sd and found.sd < 0.05 * COMPLIANCE
    left = found.without(trace).centers[:, 2] - true
    on = true > TIP + 0.9 * HEIGHT
    # a fifth of 200 um was missing on the wire
    assert abs(left[on].mean() - left[~on].mean()) < 3e-6
    assert abs(left.mean()) < 3.0 * found.sd


def test_what_presses_alike_all_along_is_no_yielding():
    assert yielding(LaidTrace.of(felt(0.0)[0], plate())) is None


def test_a_finger_whose_yielding_was_put_back_already_yields_no_more():
    assert yielding(LaidTrace.of(felt(0.05, compliance=0.0)[0], plate())) is None


def test_heights_that_rise_with_the_force_are_no_yielding():
    assert yielding(LaidTrace.of(felt(0.05, compliance=-COMPLIANCE)[0], plate())) is None


def test_a_height_carries_the_doubt_of_what_was_pressed_otherwise_there():
    finger = Yielding(COMPLIANCE, 10e-6, 1.0, 1.0, 100.0)
    trace = finger.without(felt(0.05)[0])
    wire = np.array([[0.0, 0.0, 0.0], [0.0, 14e-3, 0.0]])
    # on top of it about a fifth of a newton less, as far as the sweeps press alike
    assert 0.5 < finger.height_sd(trace, wire, HEIGHT) / (10e-6 * 0.2) < 1.0
    assert finger.height_sd(trace, wire + np.array([0.03, 0.0, 0.0]), HEIGHT) < 10e-6 * 0.03
