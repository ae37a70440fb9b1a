"""Many short sweeps: a detail that all of them lie on is found, and sweeps that stand off each other hold none."""

import numpy as np
import pytest

from mapping import Surface, Trace
from mapping.base import Base, fit_base
from mapping.detection import detect

TIP, STEP, SD, LENGTH = 10e-3, 0.05e-3, 3e-6, 12e-3


def rows(height, seed=0, count=25, apart=1e-3, lines=0.0):
    """Sweeps side by side of a ball over heights (x, y) -> z of its trace, each on a line of its own."""
    rng = np.random.default_rng(seed)
    x = np.arange(0.0, LENGTH, STEP)
    centers = []
    for k in range(count):
        z = height(x, k * apart) + SD * rng.standard_normal(len(x))
        z += lines * SD * (rng.standard_normal() + rng.standard_normal() * np.linspace(-1.0, 1.0, len(x)))
        centers.append(np.column_stack([x, np.full(len(x), k * apart), TIP + z])[:: -1 if k % 2 else 1])
    samples = np.concatenate(centers)
    return Trace(0.01 * np.arange(len(samples)), samples, np.repeat(np.arange(count), len(x)), TIP)


def wire(diameter):
    """The trace of a wire a little aslant across the middle of the rows (theory section 4)."""

    def height(x, y):
        reach = TIP + 0.5 * diameter
        away = x - 0.5 * LENGTH - 0.09 * (y - 12e-3)
        return np.maximum(0.5 * diameter - TIP + np.sqrt(np.maximum(reach**2 - away**2, 0.0)), 0.0)

    return height


def plate():
    corners = 0.1 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]])))


@pytest.mark.parametrize("base", [plate, None])
def test_a_wire_that_takes_most_of_every_row_is_no_noise(base):
    trace = rows(wire(0.6e-3))
    on = fit_base(trace) if base is None else base()
    assert on.kind == "plane" or base is not None
    found = detect(trace, on)
    assert found.noise.sd < 2.0 * SD
    assert found.detection_limit < 0.02e-3
    heights = {c.sweep: c.height for c in found.crossings if c.kind == "convex"}
    assert len(heights) >= 16  # of 25; a feature needs three
    assert np.median(list(heights.values())) == pytest.approx(0.6e-3, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("lines", [0.0, 1.0, 3.0, 10.0])
def test_short_rows_that_stand_off_each_other_hold_nothing(lines):
    trace = rows(lambda x, y: 0.0 * x, seed=5, lines=lines)
    found = detect(trace, fit_base(trace))
    assert found.crossings == ()
    assert found.detection_limit < 0.01e-3
