"""Dots whose disturbances touch, as of braille: each is a bump of its own; and one line that waves stays one."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.assembly.assemble import assemble
from mapping.assembly.linking import Inspection, summits
from mapping.base.fit import fit_base
from mapping.detection.detect import detect
from mapping.geometry.templates.shapes import cap_height
from mapping.trace import Trace

TIP, WHITE = 1.5e-3, 3e-6
DOT, WIDTH = 0.48e-3, 1.6e-3
CAP = (0.25 * WIDTH**2 + DOT**2) / (2.0 * DOT)  # radius of a dot's cap
DOTS = 2.5e-3 * np.array([[0, 0], [1, 0], [0, 1], [0, 2], [1, 2]]) - [1.25e-3, 2.5e-3]


def raster(height) -> Trace:
    """Rows 0.25 mm apart, to and fro, over heights of feet (n, 2) on a plane."""
    rows, x = np.arange(-5e-3, 5e-3, 0.25e-3), np.arange(-5e-3, 5e-3, 50e-6)
    feet = np.concatenate([np.column_stack([x[:: 1 - 2 * (k % 2)], np.full(len(x), y)]) for k, y in enumerate(rows)])
    noise = WHITE * np.random.default_rng(5).standard_normal(len(feet))
    sweep = np.repeat(np.arange(len(rows)), len(x))
    return Trace(1e-2 * np.arange(len(feet)), np.column_stack([feet, TIP + height(feet) + noise]), sweep, TIP)


def dots(feet):
    return np.max([cap_height(np.linalg.norm(feet - dot, axis=1), DOT, CAP, TIP) for dot in DOTS], axis=0)


@pytest.mark.slow
def test_each_dot_of_a_braille_letter_is_a_bump():
    trace = raster(dots)
    base = fit_base(trace)
    found = assemble(detect(trace, base), trace, base)
    assert [each.kind for each in found] == ["bump"] * len(DOTS)
    gap = np.linalg.norm(DOTS[:, None] - np.array([each.axis[0, :2] for each in found]), axis=2)
    assert gap.min(axis=1).max() < 30e-6
    assert all(abs(each.height.median - DOT) < 0.03 * DOT for each in found)


def seen(height) -> Inspection:
    trace = raster(height)
    foot = trace.centers * [1.0, 1.0, 0.0]
    return Inspection(foot, trace.centers[:, 2] - TIP, np.full(len(foot), WHITE), trace.sweep, 50e-6)


def test_tops_are_told_from_noise_by_the_saddles_between_them():
    inspection = seen(dots)
    basins = summits(np.flatnonzero(inspection.height > 0.1e-3), 1.0, inspection)
    assert len(basins) == len(DOTS)
    tops = inspection.points[[basin[0] for basin in basins], :2]
    assert np.linalg.norm(DOTS[:, None] - tops, axis=2).min(axis=1).max() < 0.2e-3  # a row is 0.25 mm from the next
    assert sum(len(basin) for basin in basins) == (inspection.height > 0.1e-3).sum()


def test_a_hollow_of_one_bottom_is_one():
    inspection = seen(lambda feet: -dots(feet[:, :2] * [1.0, 0.0] + [0.0, 2.5e-3]))
    (basin,) = summits(
        np.flatnonzero((inspection.height < -0.1e-3) & (inspection.points[:, 0] < 0.0)), -1.0, inspection
    )
    assert inspection.height[basin[0]] == inspection.height[inspection.points[:, 0] < 0.0].min()
