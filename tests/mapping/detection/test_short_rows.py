"""Many short sweeps: where they stand off each other, they hold nothing."""

import numpy as np
import pytest

from mapping import Trace
from mapping.base import fit_base
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


@pytest.mark.parametrize("lines", [0.0, 1.0, 3.0, 10.0])
def test_short_rows_that_stand_off_each_other_hold_nothing(lines):
    trace = rows(lambda x, y: 0.0 * x, seed=5, lines=lines)
    found = detect(trace, fit_base(trace))
    assert found.crossings == ()
    assert found.detection_limit < 0.01e-3
