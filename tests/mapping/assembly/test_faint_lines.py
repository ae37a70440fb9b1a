"""Lines too faint for one sweep, among the places of crossed sweeps."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mapping import Feature, Interval, Support
from mapping.assembly.faint_features import _is_weak
from mapping.assembly.faint_lines import _polished, faint_lines, threshold
from mapping.assembly.linking.inspection import Inspection, inspect
from mapping.base.base import Base
from mapping.geometry.mesh.polyline import distances
from mapping.geometry.templates.small_heights import crest_trace
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

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
    return Inspection(
        points, felt + white * rng.standard_normal(len(points)), np.full(len(points), white), number, 4e-4
    )


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
        np.full(len(crossed.points) + 75, SD),
        np.concatenate([crossed.sweep, np.full(75, 999)]),
        crossed.spacing,
    )
    (line,) = found(both)
    assert line.height < 0 and distances(line.axis, 3 * AXIS - 2 * AXIS.mean(axis=0)).max() < WIDTH


def test_a_sweep_that_drifted_does_not_hide_a_line_that_all_others_show(monkeypatch):
    drifted = []
    for seed in range(4):
        plain = places(-2.0 * SD, seed)
        off = (plain.sweep == 8) & (np.abs(plain.points[:, 0]) < 0.012)
        height = plain.height - 3.0 * SD * off
        drifted.append(Inspection(plain.points, height, plain.sd, plain.sweep, plain.spacing))
    for (line,) in map(found, drifted):
        assert distances(line.axis, 3 * AXIS - 2 * AXIS.mean(axis=0)).max() < WIDTH
    monkeypatch.setattr("mapping.assembly.faint_lines.WITHOUT", 0)
    assert not any(found(inspection) for inspection in drifted)


@pytest.mark.parametrize("angle", np.radians([2.9, 17.2, 48.7, 101.2, 160.3]))
def test_a_long_line_is_found_in_any_direction(angle):
    way = 0.021 * np.array([np.cos(angle), np.sin(angle), 0.0])
    for seed in range(4):
        (line,) = found(places(-2.4 * SD, seed, axis=np.stack([-way, way])))
        heading = (line.axis[1] - line.axis[0]) / np.linalg.norm(line.axis[1] - line.axis[0])
        assert abs(heading @ way) / 0.021 > np.cos(0.1)


def test_places_that_are_known_less_well_count_for_less():
    # half of the sweeps were four times as fast: their means are twice as uncertain
    rng, worse = np.random.default_rng(3), 2.0 * SD
    for seed in range(6):
        calm = places(0.0, seed)
        fast = calm.sweep % 2 == 0
        height = np.where(fast, worse * rng.standard_normal(len(fast)), calm.height)
        sd = np.where(fast, worse, SD)
        assert found(Inspection(calm.points, height, sd, calm.sweep, calm.spacing)) == ()
    faint = places(1.7 * SD, 0)
    height = faint.height + np.where(fast, np.sqrt(3.0) * SD * rng.standard_normal(len(fast)), 0.0)
    (line,) = found(Inspection(faint.points, height, sd, faint.sweep, faint.spacing))
    assert line.height == pytest.approx(1.7 * SD, abs=4.0 * line.height_sd)
    # a slow half carries the line: it is as certain as by the slow half and a quarter of the rest
    assert line.height_sd == pytest.approx(found(faint)[0].height_sd * np.sqrt(1.0 / 0.625), rel=0.1)


def test_slow_sweeps_are_known_better_than_fast_ones():
    base = Base(Surface(0.1 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]]))
    parts = []
    for number, step in enumerate((1e-4, 1e-5)):
        x = np.arange(-0.02, 0.02, step)
        centers = np.column_stack([x, np.full(len(x), 1e-3 * number), np.full(len(x), 5e-3)])
        parts.append(Trace(number + x, centers, np.full(len(x), number), 5e-3))
    both = inspect(Trace.concatenate(parts), base, Noise(1e-5), [1e-3])[1e-3]
    assert np.median(both.sd[both.sweep == 0]) == pytest.approx(1e-5 / np.sqrt(10), rel=1e-6)
    assert np.median(both.sd[both.sweep == 1]) == pytest.approx(1e-5 / np.sqrt(100), rel=1e-6)


@pytest.mark.parametrize("shown", [3, 30])
def test_what_few_sweeps_show_one_by_one_is_weak_however_many_passed_over_it(shown):
    """Of a groove 0.04 mm deep three of hundreds of sweeps felt a dip: their piece of it is a part of the line."""
    axis = np.array([[0.0, 0.0, 0.0], [0.004, 0.0, 0.0]])
    size = Interval(-4e-5, -5e-5, -3e-5)
    piece = Feature("groove", axis, np.tile([0.0, 0.0, 1.0], (2, 1)), size, Interval(2e-3, 1e-3, 3e-3),
                    Interval(4e-3, 4e-3, 4e-3), Support(14.0, 446), True, 1e-4)  # fmt: skip
    points = np.linspace(axis[0], axis[1], shown)
    crossings = [SimpleNamespace(point=point) for point in (*points, np.array([0.05, 0.0, 0.0]))]
    detections = SimpleNamespace(crossings=crossings, threshold=4.7, detection_limit=0.2e-3)
    assert _is_weak(piece, detections, 0.01) == (shown == 3)


def test_what_is_not_known_of_the_noise_raises_what_a_line_needs():
    inspection = places(1.7 * SD, 0)
    normals, nothing = np.tile([0.0, 0.0, 1.0], (len(inspection.points), 1)), np.zeros(len(inspection.points), bool)
    (line,) = found(inspection)
    needed = threshold(len(inspection.points) * inspection.spacing, inspection.pitch, WIDTH, 0.01)
    assert line.snr > 1.1 * needed
    assert len(faint_lines(inspection, normals, nothing, WIDTH, 1.0, 0.01, 1.1)) == 1
    assert faint_lines(inspection, normals, nothing, WIDTH, 1.0, 0.01, 1.01 * line.snr / needed) == ()


@pytest.mark.parametrize("free", [0.0, 1.0])
def test_a_line_that_nothing_about_it_speaks_for_stays_as_it_is(free):
    inspection = places(3 * SD, 0)
    line = found(inspection)[0]
    against = replace(inspection, height=-np.abs(inspection.height))
    kept = _polished(line, against, np.full(len(inspection.points), bool(free)), 1.0)
    np.testing.assert_array_equal(kept.axis, line.axis)
    assert kept.snr == line.snr
