"""Rows that run along a fine line at a slant show it as wide as they like: the rows that cross it say what it is."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mapping import Feature, FloatArray, Interval, Support, Trace
from mapping.assembly import assemble
from mapping.assembly.free import outweighed
from mapping.assembly.linking import Inspection
from mapping.base import fit_base
from mapping.detection import detect

TIP, WIRE, NOISE, HALF = 10e-3, 0.65e-3, 60e-6, 16e-3


def felt(axes: list[FloatArray]) -> Trace:
    """Rows and columns over round wires on a plate: the ball's centre stays r + a off their axes (exact)."""
    run, places = np.arange(-HALF, HALF, 50e-6), np.arange(-HALF + 0.7e-3, HALF, 2e-3)
    rows = [np.column_stack([run, np.full(len(run), place)]) for place in places]
    feet = np.concatenate([*rows, *(row[:, ::-1] for row in rows)])
    away = cKDTree(np.concatenate(axes)).query(feet)[0]
    top = 0.5 * WIRE + np.sqrt(np.clip((TIP + 0.5 * WIRE) ** 2 - away**2, 0.0, None))
    height = np.maximum(top, TIP) + 0.6 * NOISE * np.random.default_rng(11).standard_normal(len(feet))
    sweep = np.repeat(np.arange(2 * len(places)), len(run))
    return Trace(1e-3 * np.arange(len(feet)), np.column_stack([feet, height]), sweep, TIP)


def stroke(*corners: tuple[float, float]) -> FloatArray:
    """A polyline with corners in mm, every 50 um, m."""
    line = 1e-3 * np.array(corners)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    even = np.arange(0.0, s[-1], 50e-6)
    return np.column_stack([np.interp(even, s, line[:, 0]), np.interp(even, s, line[:, 1])])


@pytest.mark.slow
def test_a_ring_that_rows_run_beside_is_one_closed_ridge_not_a_wide_one() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 900)
    trace = felt([7e-3 * np.column_stack([np.cos(turn), np.sin(turn)]) + [0.5e-3, 0.9e-3]])
    base = fit_base(trace)
    (ring,) = assemble(detect(trace, base), trace, base)
    assert ring.kind == "ridge" and ring.closed
    assert np.abs(np.hypot(ring.axis[:, 0] - 0.5e-3, ring.axis[:, 1] - 0.9e-3) - 7e-3).max() < 0.2e-3
    assert ring.height.median == pytest.approx(WIRE, abs=0.02e-3)


@pytest.mark.slow
def test_the_strokes_of_a_letter_are_three_ridges() -> None:
    letter = stroke((-6.0, 7.0), (6.0, 7.0), (-6.0, -7.0), (6.0, -7.0))
    trace = felt([letter @ np.array([[0.8, 0.6], [-0.6, 0.8]])])
    base = fit_base(trace)
    found = assemble(detect(trace, base), trace, base)
    assert [feature.kind for feature in found] == ["ridge"] * 3
    assert max(feature.width.median for feature in found) < 2.0 * WIRE


def test_a_step_somewhere_else_is_not_asked_what_a_wide_bump_is() -> None:
    """A step has no width of its own."""
    places = np.column_stack([np.linspace(-40e-3, 40e-3, 400), np.zeros((400, 2))])
    looked = Inspection(
        places, np.zeros(400), np.ones(400), np.arange(400) % 5, 0.2e-3, samples=np.ones(400, dtype=int)
    )
    wide = feature("bump", [[-30e-3, 0.0, 0.0]], height=1e-3, width=8e-3)
    step = feature("step", [[30e-3, -5e-3, 0.0], [30e-3, 5e-3, 0.0]], height=1e-3, width=0.0)
    assert outweighed([wide], [step], [wide, step], looked, TIP) == [False]


def feature(kind: str, axis: list[list[float]], height: float, width: float) -> Feature:
    line = np.linalg.norm(np.ptp(axis, axis=0))
    return Feature(
        kind=kind,
        axis=np.array(axis),
        normals=np.tile([0.0, 0.0, 1.0], (len(axis), 1)),
        height=Interval(height, height, height),
        width=Interval(width, width, width),
        length=Interval(line, line, line),
        evidence=Support(50.0, 5),
        curvature_feature=False,
        position_sd=1e-4,
    )
