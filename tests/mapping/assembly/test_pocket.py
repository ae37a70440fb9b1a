"""The walls of a pocket and of a boss under a raster: together they are one hollow or ridge."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.assembly.assemble import assemble
from mapping.base.fit import fit_base
from mapping.detection.detect import detect
from mapping.inference.joint import refine_all
from mapping.trace import Trace

TIP, DEPTH, WHITE = 1.5e-3, 0.5e-3, 4e-6
HALF = np.array([8e-3, 5e-3])  # of the rectangle, along the sweeps and across


def felt(inside_is_high: bool, pitch: float) -> Trace:
    """A raster over a rectangle of upright walls, by closed form: the ball rests on a floor, or on the nearest rim."""
    rows = np.arange(-0.011, 0.0111, pitch)
    x = np.arange(-0.016, 0.016, 0.1e-3)
    centers = []
    for k, y in enumerate(rows):
        way = x if k % 2 == 0 else x[::-1]
        beyond = np.abs(np.column_stack([way, np.full(len(way), y)])) - HALF
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)  # distance from the rectangle
        within = np.maximum(-beyond.max(axis=1), 0.0)  # and, inside, from its rim
        to_high = outside if inside_is_high else within
        rolling = np.sqrt(np.maximum(TIP**2 - to_high**2, 0.0)) - TIP
        height = np.where(to_high < TIP, np.maximum(rolling, -DEPTH), -DEPTH) + (DEPTH if inside_is_high else 0.0)
        centers.append(np.column_stack([way, np.full(len(way), y), TIP + height]))
    points = np.concatenate(centers)
    points[:, 2] += WHITE * np.random.default_rng(3).standard_normal(len(points))
    sweep = np.repeat(np.arange(len(rows)), len(x))
    return Trace(1e-2 * np.arange(len(points)), points, sweep, TIP)


@pytest.mark.parametrize("inside_is_high", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("pitch", [1e-3, pytest.param(0.5e-3, marks=pytest.mark.slow)])
def test_all_four_walls_are_those_of_one_feature(inside_is_high, pitch):
    trace = felt(inside_is_high, pitch)
    base = fit_base(trace)
    detections = detect(trace, base)
    found = assemble(detections, trace, base)
    (feature,) = refine_all(found, trace, 1, base=base, noise=detections.noise, confirm=None)
    assert feature.kind == ("ridge" if inside_is_high else "groove")
    assert abs(abs(feature.height.median) - DEPTH) < 2e-6
    assert abs(feature.length.median - 2.0 * HALF[0]) < 60e-6
    assert np.abs(feature.axis[:, 1]).max() < 60e-6
    touched = feature.details.top if inside_is_high else feature.width.median
    assert abs(touched - 2.0 * HALF[1]) < 60e-6


def test_a_plateau_that_goes_on_beyond_the_rows_keeps_its_two_steps():
    whole = felt(False, 1e-3)
    trace = whole.select(np.abs(whole.centers[:, 1]) < HALF[1] - TIP)
    base = fit_base(trace)
    kinds = [feature.kind for feature in assemble(detect(trace, base), trace, base)]
    assert kinds == ["step", "step"]


@pytest.mark.slow
def test_a_pocket_beside_another_is_no_part_of_it():
    """What a neighbour's hollow leaves in the window is the neighbour's."""
    whole = felt(False, 1e-3)
    beside = whole.centers.copy()
    beside[:, 0] += 0.024
    both = np.concatenate([whole.centers, beside])
    row = np.concatenate([whole.sweep, whole.sweep])
    order = np.lexsort((both[:, 0], row))
    trace = Trace(1e-2 * np.arange(len(both)), both[order], row[order], TIP)
    base = fit_base(trace)
    detections = detect(trace, base)
    found = assemble(detections, trace, base)
    features = refine_all(found, trace, 1, base=base, noise=detections.noise, confirm=None)
    assert [feature.kind for feature in features] == ["groove", "groove"]
    for feature in features:
        assert abs(feature.width.median - 2.0 * HALF[1]) < 0.15e-3
        assert abs(feature.length.median - 2.0 * HALF[0]) < 0.15e-3


@pytest.mark.slow
def test_a_bar_across_three_rows_runs_across_them():
    half, high, tip = 1e-3, 0.4e-3, 3e-3
    x = np.arange(0.0, 40e-3, 0.1e-3)
    rng = np.random.default_rng(10)
    rows = []
    for k in range(3):
        away = np.maximum(np.abs(x - 20e-3) - half, 0.0)
        z = np.maximum(high + np.sqrt(np.maximum(tip**2 - away**2, 0.0)), tip)
        rows.append(np.column_stack([x, np.full(len(x), 1e-3 * k), z + rng.normal(0.0, 10e-6, len(x))]))
    points = np.concatenate(rows)
    trace = Trace(1e-2 * np.arange(len(points)), points, np.repeat(np.arange(3), len(x)), tip)
    base = fit_base(trace)
    detections = detect(trace, base)
    found = assemble(detections, trace, base)
    (bar,) = refine_all(found, trace, 1, base=base, noise=detections.noise, confirm=None)
    assert bar.kind == "ridge" and bar.length.censored
    assert bar.width.low < 2.0 * half < bar.width.high
    assert np.ptp(bar.axis[:, 1]) > 5.0 * np.ptp(bar.axis[:, 0])
