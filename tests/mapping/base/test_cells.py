"""Cells: means of short stretches of sweeps, whatever order the sweeps come in."""

import numpy as np
import pytest

from mapping.base.cells import Cells
from mapping.trace import Trace


def test_a_cell_is_the_mean_of_its_samples_and_spans_no_two_sweeps() -> None:
    rng = np.random.default_rng(3)
    sweep = np.array([2] * 7 + [5] * 3 + [2] * 6 + [-1] * 4)
    velocity = {number: rng.normal(size=3) for number in (2, 5, -1)}  # straight on: no mean lies beside the path
    done = {number: np.cumsum(sweep == number) for number in velocity}
    centers = np.array([done[number][k] * velocity[number] for k, number in enumerate(sweep.tolist())])
    trace = Trace(np.arange(20.0), centers, sweep, 0.01)
    group = np.arange(20) * 5 // 20
    wanted = sorted({(s, g) for s, g in zip(sweep.tolist(), group.tolist(), strict=True)})
    cells = Cells.of(trace, 5)
    np.testing.assert_array_equal(cells.sweep, [s for s, _ in wanted])
    means = [trace.centers[(sweep == s) & (group == g)].mean(axis=0) for s, g in wanted]
    np.testing.assert_allclose(cells.centers, means, rtol=0, atol=1e-14)


@pytest.mark.parametrize("most", [100, 317])  # cells of as many samples, and of six and seven
def test_cells_of_a_bent_path_lie_on_it(most: int) -> None:
    angle = np.linspace(0.0, 6.0, 2000)
    centers = 23e-3 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(2000)])
    cells = Cells.of(Trace(np.arange(2000.0), centers, np.zeros(2000, dtype=np.int64), 3e-3), most)
    radius = np.linalg.norm(cells.centers, axis=1)
    chord = 23e-3 * 6.0 / most
    inside = chord**2 / (24 * 23e-3)  # where the means lie
    assert np.abs(radius - 23e-3).max() < 0.05 * inside
