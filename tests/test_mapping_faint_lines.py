"""Lines too faint for one sweep, among the places of crossed sweeps."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.crest_trace import crest_trace, distances
from mapping.faint_lines import faint_lines, threshold
from mapping.inspection import Inspection

WIDTH, SD = 1.4e-3, 0.03e-3
AXIS = np.array([[-0.015, -0.004, 0.0], [0.014, 0.006, 0.0]])


def places(height: float, seed: int, axis=AXIS, white: float = SD) -> Inspection:
    """Sweeps 4 mm apart along x and along y over 44 mm, means over 0.4 mm."""
    rng = np.random.default_rng(seed)
    along, across = np.arange(-0.022, 0.022, 4e-4), np.arange(-0.022, 0.022, 4e-3)
    x, y = (grid.ravel() for grid in np.meshgrid(along, across, indexing="ij"))
    points = np.concatenate([np.column_stack([x, y, 0 * x]), np.column_stack([y, x, 0 * x])])
    number = np.concatenate([np.searchsorted(across, y), 100 + np.searchsorted(across, y)])
    felt = crest_trace(distances(points, axis), height, WIDTH) if height else np.zeros(len(points))
    return Inspection(points, felt + white * rng.standard_normal(len(points)), white, number, 4e-4)


def found(inspection: Inspection, alarms: float = 0.01):
    normals = np.tile([0.0, 0.0, 1.0], (len(inspection.points), 1))
    nothing = np.zeros(len(inspection.points), dtype=bool)
    return faint_lines(inspection, normals, nothing, WIDTH, 1.0, alarms)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("seed", range(3))
def test_a_line_as_low_as_the_noise_of_a_place_is_found_where_it_lies(sign, seed):
    (line,) = found(places(sign * 1.7 * SD, seed))
    assert np.sign(line.height) == sign
    assert abs(abs(line.height) - 1.7 * SD) < 0.6 * 1.7 * SD
    assert distances(line.axis, np.array([3 * AXIS[0] - 2 * AXIS[1], 3 * AXIS[1] - 2 * AXIS[0]])).max() < WIDTH
    assert line.sweeps >= 4


@pytest.mark.parametrize("seed", range(6))
def test_noise_alone_has_no_lines(seed):
    assert found(places(0.0, seed)) == ()


def test_one_bump_is_no_line():
    assert found(places(6 * SD, 0, axis=np.array([[0.0001, 0.0, 0.0]]))) == ()


def test_fewer_false_lines_need_a_higher_threshold():
    bars = [threshold(1.0, 4e-3, WIDTH, alarms) for alarms in (1.0, 0.1, 0.01)]
    assert bars[0] < bars[1] < bars[2]


def test_a_sweep_that_happens_to_run_along_the_line_speaks_for_it_too():
    crossed = places(-1.7 * SD, 0)
    along = AXIS[0] + np.linspace(0.0, 1.0, 75)[:, None] * (AXIS[1] - AXIS[0]) + [0.0, 0.3 * WIDTH, 0.0]
    felt = crest_trace(distances(along, AXIS), -1.7 * SD, WIDTH) + SD * np.random.default_rng(1).standard_normal(75)
    both = Inspection(
        np.concatenate([crossed.points, along]),
        np.concatenate([crossed.height, felt]),
        SD,
        np.concatenate([crossed.sweep, np.full(75, 999)]),
        crossed.spacing,
    )
    (line,) = found(both)
    assert line.height < 0 and distances(line.axis, 3 * AXIS - 2 * AXIS.mean(axis=0)).max() < WIDTH


@pytest.mark.parametrize("angle", np.radians([2.9, 17.2, 48.7, 101.2, 160.3]))
def test_a_long_line_is_found_in_any_direction(angle):
    way = 0.021 * np.array([np.cos(angle), np.sin(angle), 0.0])
    for seed in range(4):
        (line,) = found(places(-2.4 * SD, seed, axis=np.stack([-way, way])))
        heading = (line.axis[1] - line.axis[0]) / np.linalg.norm(line.axis[1] - line.axis[0])
        assert abs(heading @ way) / 0.021 > np.cos(0.1)
