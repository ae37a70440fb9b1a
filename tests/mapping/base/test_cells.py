"""Cells: means of short stretches of sweeps, whatever order the sweeps come in."""

import numpy as np

from mapping.base.cells import Cells
from mapping.trace import Trace


def test_a_cell_is_the_mean_of_its_samples_and_spans_no_two_sweeps() -> None:
    rng = np.random.default_rng(3)
    sweep = np.array([2] * 7 + [5] * 3 + [2] * 6 + [-1] * 4)
    trace = Trace(np.arange(20.0), rng.normal(size=(20, 3)), sweep, 0.01)
    group = np.arange(20) * 5 // 20
    wanted = sorted({(s, g) for s, g in zip(sweep.tolist(), group.tolist(), strict=True)})
    cells = Cells.of(trace, 5)
    np.testing.assert_array_equal(cells.sweep, [s for s, _ in wanted])
    means = [trace.centers[(sweep == s) & (group == g)].mean(axis=0) for s, g in wanted]
    np.testing.assert_allclose(cells.centers, means, rtol=0, atol=1e-15)
