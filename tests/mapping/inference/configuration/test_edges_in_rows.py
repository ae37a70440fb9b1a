"""Rows over one edge of the base tell one step, upright or slanted, and nothing that stands in for its form."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import Trace
from mapping.assembly import assemble
from mapping.assembly.linking import Inspections
from mapping.base import fit_base
from mapping.detection import detect
from mapping.instrument import Noise

ROWS, NOISE = 16, 1e-6


def rows(tip: float, *edges: tuple[float, float, float]) -> Trace:
    """Rows over edges at places that climb by heights over runs, m, felt by brute force."""
    x, fine = np.arange(0.0, 30e-3, 60e-6), np.arange(-2.0 * tip, 30e-3 + 2.0 * tip, 1e-3 * tip)
    ground = sum(high * np.clip((fine - place) / max(run, 1e-9), 0.0, 1.0) for place, high, run in edges)
    z = np.empty(len(x))
    for k, at in enumerate(x):
        near = np.abs(fine - at) <= tip
        z[k] = (ground[near] + np.sqrt(np.maximum(tip**2 - (fine[near] - at) ** 2, 0.0))).max()
    every, noise = np.tile(x, ROWS), np.random.default_rng(3).normal(0.0, NOISE, ROWS * len(x))
    centers = np.column_stack([every, 1e-3 * np.repeat(np.arange(ROWS), len(x)), np.tile(z, ROWS) + noise])
    return Trace(1e-2 * np.arange(len(centers)), centers, np.repeat(np.arange(ROWS), len(x)), tip)


@pytest.mark.parametrize(("height", "run", "tip"), [(2e-3, 0.0, 0.5e-3), (0.3e-3, 1.5e-3, 2e-3)])
def test_an_edge_across_rows_is_one_step(height: float, run: float, tip: float) -> None:
    """At a wall higher than the ball's radius the mean of a place is off by what the ball rose in one step; a ridge
    stood for that. Of a slanted one two ridges stood for the flank."""
    trace = rows(tip, (17.3e-3, height, run))
    base = fit_base(trace)
    found = assemble(detect(trace, base), trace, base)
    assert [feature.kind for feature in found] == ["step"]
    assert abs(abs(found[0].height.median) - height) < 0.02 * height


def test_a_mean_is_doubted_where_the_ball_rose_from_one_sample_to_the_next() -> None:
    """By the rise's share of its samples there, and by more than noise nowhere else."""
    trace = rows(0.5e-3, (17.3e-3, 2e-3, 0.0))
    spacing = 5.0 * 60e-6
    inspection = Inspections.of(trace, fit_base(trace), Noise(NOISE, 0.0, spacing), [spacing]).at(spacing)
    doubted = inspection.jumped > 5.0 * NOISE
    assert len(np.unique(inspection.sweep[doubted])) == ROWS
    assert (np.abs(inspection.points[doubted, 0] - 16.8e-3) < spacing).all()
    assert np.abs(inspection.jumped[doubted] / (1.5e-3 / (5.0 * np.sqrt(12.0))) - 1.0).max() < 0.2
    assert np.count_nonzero(inspection.jumped[~doubted]) < 0.01 * len(doubted)


def test_a_ramp_among_stairs_is_a_slanted_step_among_upright_ones() -> None:
    """The slope of the base is that of pairs so near that most stand on one level; the climb is too wide for the window
    of an upright edge, and no side of an extruded body."""
    trace = rows(0.5e-3, (6e-3, 0.3e-3, 0.0), (14e-3, 0.25e-3, 1.5e-3), (22e-3, 0.2e-3, 0.0))
    base = fit_base(trace)
    assert base.kind == "plane" and len(base.levels) == 4
    found = assemble(detect(trace, base), trace, base)
    assert [feature.kind for feature in found] == ["step"] * 3
    (slanted,) = (feature for feature in found if feature.details.run is not None)
    assert abs(slanted.height.median - 0.25e-3) < 5e-6
    assert abs(slanted.axis[:, 0] - 14.75e-3).max() < 0.2e-3
